// What was identified, as a document and as tables.
#include <fmt/format.h>

#include <cmath>

#include "hamelin/identification/identify.hpp"

namespace hamelin::identification {

namespace {

using Eigen::Index;
using Eigen::Vector3d;

Json finite(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

Vector3d center_of(const Parameters& parameters, Index link) {
  const auto part = parameters.inertial.segment<10>(10 * link);
  return part[0] > 0.0 ? Vector3d(part.segment<3>(1) / part[0]) : Vector3d(Vector3d::Zero());
}

Json body_json(const Parameters& parameters, Index link) {
  const Vector3d center = center_of(parameters, link);
  return {{"mass_kg", parameters.inertial[10 * link]},
          {"center_m", {center.x(), center.y(), center.z()}}};
}

Json error_json(const TorqueError& error) {
  return {{"rms", error.rms}, {"share", error.share}};
}

Json errors_json(const TorqueErrors& errors) {
  Json joints = Json::array();
  for (const TorqueError& joint : errors.joints) joints.push_back(error_json(joint));
  return {{"joints", joints}, {"all", error_json(errors.all)}};
}

std::string percent(double share) {
  return fmt::format("{:.2f}", 100.0 * share);
}

std::string with_error(double value, double error) {
  return std::isfinite(error) ? fmt::format("{:.4g} ± {:.2g}", value, error)
                              : fmt::format("{:.4g}", value);
}

// fmt counts the bytes of "±", which has two, as two columns in older versions.
std::string padded(const std::string& text, std::size_t width) {
  std::size_t columns = 0;
  for (const char c : text) columns += (static_cast<unsigned char>(c) & 0xC0U) != 0x80U ? 1U : 0U;
  return std::string(columns < width ? width - columns : 0, ' ') + text;
}

std::string links_table(const Identification& identified) {
  std::string text = fmt::format("{:<20} {:>9} {:>9}   {:>24}   {:>24}\n", "link", "mass", "before",
                                 "centre of mass", "before");
  for (std::size_t i = 0; i < identified.robot.links.size(); ++i) {
    const auto at = static_cast<Index>(i);
    const Vector3d now = center_of(identified.fit.parameters, at),
                   before = center_of(identified.before, at);
    text += fmt::format(
        "{:<20} {:>9.4g} {:>9.4g}   {:>8.4f}{:>8.4f}{:>8.4f}   "
        "{:>8.4f}{:>8.4f}{:>8.4f}\n",
        identified.robot.links[i].name, identified.fit.parameters.inertial[10 * at],
        identified.before.inertial[10 * at], now.x(), now.y(), now.z(), before.x(), before.y(),
        before.z());
  }
  return text;
}

std::string joints_table(const Identification& identified,
                         const std::optional<TorqueErrors>& test) {
  std::string text =
      fmt::format("{:<20} {:>19} {:>19} {:>9} {:>8} {:>8} {:>10}{}\n", "joint", "damping",
                  "friction", "residual", "%", "% before", "% held out", test ? "   % test" : "");
  const auto row = [&](const std::string& name, const std::string& damping,
                       const std::string& friction, auto&& error_of) {
    const TorqueError now = error_of(identified.errors);
    text += fmt::format("{:<20} {} {} {:>9.3g} {:>8} {:>8} {:>10}", name, padded(damping, 19),
                        padded(friction, 19), now.rms, percent(now.share),
                        percent(error_of(identified.errors_before).share),
                        percent(error_of(identified.held_out).share));
    if (test) text += fmt::format(" {:>8}", percent(error_of(*test).share));
    text += "\n";
  };
  const Fit& fit = identified.fit;
  for (std::size_t j = 0; j < identified.robot.links.size(); ++j) {
    const auto at = static_cast<Index>(j);
    row(identified.robot.links[j].joint.name,
        with_error(fit.parameters.damping[at], fit.damping_error[at]),
        with_error(fit.parameters.friction[at], fit.friction_error[at]),
        [&](const TorqueErrors& errors) { return errors.joints[j]; });
  }
  row("all", "", "", [](const TorqueErrors& errors) { return errors.all; });
  return text;
}

}  // namespace

Json to_json(const Identification& identified, const std::optional<TorqueErrors>& test) {
  const Fit& fit = identified.fit;
  Json links = Json::array(), joints = Json::array();
  for (std::size_t i = 0; i < identified.robot.links.size(); ++i) {
    const auto at = static_cast<Index>(i);
    links.push_back({{"name", identified.robot.links[i].name},
                     {"identified", body_json(fit.parameters, at)},
                     {"before", body_json(identified.before, at)}});
    joints.push_back({{"name", identified.robot.links[i].joint.name},
                      {"damping", fit.parameters.damping[at]},
                      {"damping_error", finite(fit.damping_error[at])},
                      {"damping_before", identified.before.damping[at]},
                      {"friction", fit.parameters.friction[at]},
                      {"friction_error", finite(fit.friction_error[at])},
                      {"friction_before", identified.before.friction[at]},
                      {"q_noise", identified.q_noise[at]}});
  }
  return {{"links", links},
          {"joints", joints},
          {"torque_error",
           {{"before", errors_json(identified.errors_before)},
            {"identified", errors_json(identified.errors)},
            {"held_out", errors_json(identified.held_out)},
            {"test", test ? errors_json(*test) : Json(nullptr)}}},
          {"base_parameters", fit.base_parameters},
          {"determined", fit.determined},
          {"condition", finite(fit.condition)},
          {"windows", identified.samples},
          {"window_s", identified.window_s},
          {"notes", identified.notes}};
}

std::string to_table(const Identification& identified, const std::optional<TorqueErrors>& test) {
  std::string text = links_table(identified) + "\n" + joints_table(identified, test);
  text +=
      "masses in kg, centres of mass in m in the frames of the joints; damping in Nm s/rad or "
      "N s/m,\nfriction and residual in Nm or N; %: root mean square of the difference over "
      "that of the torque\n";
  text += fmt::format(
      "parameters: {} of the {} combinations that torques depend on are determined by the motion, "
      "condition {:.3g}\nmotion: {} windows of {:.3g} s, noise of the positions {:.2g} at most\n",
      identified.fit.determined, identified.fit.base_parameters, identified.fit.condition,
      identified.samples, identified.window_s, identified.q_noise.maxCoeff());
  for (const std::string& note : identified.notes) text += fmt::format("note: {}\n", note);
  return text;
}

}  // namespace hamelin::identification
