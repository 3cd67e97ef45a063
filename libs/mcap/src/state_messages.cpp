#include "state_messages.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "foxglove.hpp"

namespace hamelin::mcap {

namespace {

void add_finite(Json& object, const char* key, const Eigen::VectorXd& x, Eigen::Index i) {
  if (i < x.size() && std::isfinite(x[i])) object[key] = x[i];
}

void add_number(Json& object, const char* name, const Json& from, const char* key) {
  const auto found = from.find(key);
  if (found != from.end() && found->is_number()) object[name] = *found;
}

Json entry(std::uint64_t time_ns, bool warns, const std::string& message) {
  constexpr int info = 2, warning = 3;
  return {{"timestamp", time_json(time_ns)},
          {"level", warns ? warning : info},
          {"message", message},
          {"name", "hamelin"},
          {"file", ""},
          {"line", 0}};
}

// A member of an object, as text; "" if it is not a text.
std::string text_of(const Json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : "";
}

}  // namespace

Json joint_states(std::uint64_t time_ns, const std::vector<std::string>& joints,
                  const log::Trajectory::Point& point) {
  Json states = Json::array();
  for (std::size_t i = 0; i < joints.size(); ++i) {
    Json joint{{"name", joints[i]}};
    const auto at = static_cast<Eigen::Index>(i);
    add_finite(joint, "position", point.q, at);
    add_finite(joint, "velocity", point.v, at);
    add_finite(joint, "effort", point.tau, at);
    states.push_back(std::move(joint));
  }
  return {{"timestamp", time_json(time_ns)}, {"joints", std::move(states)}};
}

Json state(std::uint64_t time_ns, const Json& tick, const std::vector<std::string>& series) {
  Json out{{"timestamp", time_json(time_ns)}};
  for (const char* key : {"goal_index", "clearance_m", "self_clearance_m"})
    add_number(out, key, tick, key);
  if (const auto found = tick.find("certified"); found != tick.end() && found->is_boolean())
    out["certified"] = *found;
  const auto stop = tick.find("stop");
  out["stop"] = stop == tick.end() ? "" : text_of(*stop, "cause");
  if (const auto target = tick.find("target"); target != tick.end())
    add_number(out, "target_error_m", *target, "error_m");
  out["energy"] = Json::object();
  for (const char* key : {"kinetic_J", "potential_J", "control_J"})
    add_number(out["energy"], key, tick["energy"], key);
  out["series"] = Json::array();
  const Json values = tick.value("series", Json::array());
  for (std::size_t i = 0; i < std::min(series.size(), values.size()); ++i)
    if (values[i].is_number()) out["series"].push_back({{"name", series[i]}, {"value", values[i]}});
  return out;
}

Json log_entry(std::uint64_t time_ns, const Json& line) {
  if (line["type"] != "result") return entry(time_ns, false, text_of(line, "text"));
  const std::string outcome = text_of(line, "outcome"), cause = text_of(line, "cause");
  const bool well = outcome == "completed" || outcome == "reached" || outcome == "followed";
  return entry(time_ns, !well,
               fmt::format("the run ends: {}{}{}", outcome, cause.empty() ? "" : ": ", cause));
}

}  // namespace hamelin::mcap
