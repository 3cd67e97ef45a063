#include "hamelin/identification/identify.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"

namespace hamelin::identification {

namespace {

// The time of a sample before which a share of all samples lies.
double time_at_share(const Samples& samples, double share) {
  const auto at = static_cast<std::size_t>(share * static_cast<double>(samples.time_s.size()));
  return samples.time_s[std::min(at, samples.time_s.size() - 1)];
}

std::vector<std::string> notes_on(const model::Robot& robot, const Fit& fit) {
  std::vector<std::string> out;
  for (const int j : fit.still_joints)
    out.push_back(
        fmt::format("joint '{}' does not move: its damping and friction stay as they were",
                    robot.links[static_cast<std::size_t>(j)].joint.name));
  for (const int i : fit.repaired_links)
    out.push_back(
        fmt::format("link '{}': no body has the inertia of its prior; it was replaced by "
                    "the nearest one that a body has",
                    robot.links[static_cast<std::size_t>(i)].name));
  return out;
}

}  // namespace

Identification identify(const model::Model& prior, const Record& record, const Options& options) {
  if (!(options.test_share > 0.0 && options.test_share < 1.0))
    throw Error(ErrorCode::usage, fmt::format("test share {}, expected a number between 0 and 1",
                                              options.test_share));
  const Samples samples = windowed_samples(prior, record, options.windows);
  // windows on both sides of the border share no data
  const double border_s = time_at_share(samples, 1.0 - options.test_share);
  const Samples first = between(samples, -infinity, border_s),
                rest = between(samples, border_s + samples.window_s, infinity);
  Identification out;
  out.before = parameters_of(prior);
  out.held_out =
      torque_errors(rest, fit(prior, first, options.fit, record.where + ": first part").parameters);
  out.fit = fit(prior, samples, options.fit, record.where);
  out.robot = with_parameters(prior, out.fit.parameters);
  out.errors_before = torque_errors(samples, out.before);
  out.errors = torque_errors(samples, out.fit.parameters);
  out.samples = static_cast<std::size_t>(samples.rows());
  out.window_s = samples.window_s;
  out.q_noise = samples.q_noise;
  out.notes = record.notes;
  for (std::string& note : notes_on(prior.robot(), out.fit)) out.notes.push_back(std::move(note));
  return out;
}

TorqueErrors test(const model::Model& model, const Identification& identified, const Record& record,
                  const WindowOptions& options) {
  return torque_errors(windowed_samples(model, record, options), identified.fit.parameters);
}

}  // namespace hamelin::identification
