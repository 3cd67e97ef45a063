#include "summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "hamelin/scene/tip_constraint.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

std::string number(const Json& value, int digits = 4) {
  return value.is_null() ? "not finite" : fmt::format("{:.{}g}", value.get<double>(), digits);
}

std::string joints(const Json& q) {
  constexpr std::size_t shown = 10;
  std::string text;
  for (std::size_t i = 0; i < std::min(q.size(), shown); ++i)
    text += (i > 0 ? ", " : "") + number(q[i], 6);
  if (q.size() > shown) text += fmt::format(", ... ({} joints)", q.size());
  return text;
}

Colour colour_of(const std::string& outcome) {
  if (outcome == "reached" || outcome == "completed" || outcome == "followed") return Colour::good;
  if (outcome == "stalled" || outcome == "timeout" || outcome == "interrupted") return Colour::fair;
  return Colour::bad;
}

std::string goal_line(const Json& goal) {
  std::string text = goal["type"].get<std::string>();
  if (goal["count"].get<std::size_t>() > 1)
    text += fmt::format(", {} of {} reached", goal["index"].get<std::size_t>(),
                        goal["count"].get<std::size_t>());
  if (!goal["error_m"].is_null()) text += fmt::format(", error {} m", number(goal["error_m"]));
  if (!goal["error_rad"].is_null())
    text += fmt::format(", error {} rad", number(goal["error_rad"]));
  return text;
}

std::string following_line(const Json& f) {
  const Json& free = f["free"];
  return fmt::format(
      "free for {} s of {} s: error {} mm, {} rad root mean square, {} mm, {} rad at most; tracked "
      "for {} s{}",
      number(free["time_s"]), number(f["all"]["time_s"]),
      number(1e3 * free["rms_m"].get<double>(), 3), number(free["rms_rad"], 2),
      number(1e3 * free["max_m"].get<double>(), 3), number(free["max_rad"], 2),
      number(f["tracked_s"]),
      f["resume_max_s"].is_null()
          ? ""
          : fmt::format(", resumed within {} s", number(f["resume_max_s"])));
}

std::string trajectory_line(const Json& t) {
  return fmt::format("{} s long, took {} s; error {} root mean square, {} at most",
                     number(t["duration_s"]), number(t["time_s"]), number(t["error_rms"], 2),
                     number(t["error_max"], 2));
}

std::string shield_line(const Json& shield) {
  std::string causes;
  for (const auto& [cause, count] : shield["causes"].items())
    causes += fmt::format("{}{} {}", causes.empty() ? "" : ", ", cause, count.get<long>());
  const long refused = shield["refused"].get<long>(), stops = shield["stops"].get<long>();
  return fmt::format("{} of {} steps refused{}; margin {} mm at most", refused,
                     shield["steps"].get<long>(),
                     stops == 0 ? "" : fmt::format(" in {} stops ({})", stops, causes),
                     number(1e3 * shield["margin_m"].get<double>(), 2));
}

void add_line(std::string& text, const char* name, const std::string& value) {
  text += fmt::format("{:<12}{}\n", name, value);
}

void add_outcome(std::string& text, const Json& r) {
  const auto outcome = r["outcome"].get<std::string>();
  add_line(text, "outcome",
           coloured(outcome, colour_of(outcome)) +
               (r["cause"].is_null() ? "" : fmt::format(": {}", r["cause"].get<std::string>())));
  add_line(text, "time",
           fmt::format("{} s, {} steps with {}{}", number(r["time_s"], 6), r["steps"].get<long>(),
                       r["integrator"].get<std::string>(),
                       r["planner"].is_null()
                           ? ""
                           : fmt::format(", planner {}", r["planner"].get<std::string>())));
}

std::string clearance_line(const Json& r) {
  return fmt::format(
      "{} m at least{}", number(r["min_clearance_m"]),
      r["certified_share"].is_null()
          ? ""
          : fmt::format("; {:.2f} % of the steps proved clear, the tightest by {} m",
                        100.0 * r["certified_share"].get<double>(), number(r["tightest_step_m"])));
}

std::string constraint_line(const Json& kept) {
  const double excess = kept["excess"].get<double>();
  return fmt::format("{} of goal {} ({}): {} by {} {}", kept["constraint"].get<std::size_t>(),
                     kept["goal"].get<std::size_t>(), kept["type"].get<std::string>(),
                     excess > 0.0 ? "exceeded" : "kept", number(std::abs(excess)),
                     scene::unit_of(kept["type"].get<std::string>()));
}

// What was reached and kept, where the run has it.
void add_requirements(std::string& text, const Json& r) {
  if (!r["goal"].is_null()) add_line(text, "goal", goal_line(r["goal"]));
  if (r.contains("trajectory")) add_line(text, "trajectory", trajectory_line(r["trajectory"]));
  if (r.contains("following")) add_line(text, "following", following_line(r["following"]));
  if (!r["min_clearance_m"].is_null()) add_line(text, "clearance", clearance_line(r));
  if (r.contains("may_touch"))
    for (const Json& allowed : r["may_touch"])
      add_line(text, "may touch",
               fmt::format("at goal {}, {} m from it at least", allowed["goal"].get<std::size_t>(),
                           number(allowed["clearance_m"])));
  if (r.contains("constraints"))
    for (const Json& kept : r["constraints"]) add_line(text, "constraint", constraint_line(kept));
}

std::string torque_line(const Json& change) {
  return fmt::format("changes by {} Nm from tick to tick on the mean, by {} Nm at most",
                     number(change["mean"], 3), number(change["max"], 3));
}

std::string plant_line(const Json& plant) {
  return fmt::format("{} {}; nodes in contact: {} by its own detection, {} by the judge",
                     plant["type"].get<std::string>(), plant["version"].get<std::string>(),
                     plant["contacts"].get<long>(), plant["judge_contacts"].get<long>());
}

void add_energy(std::string& text, const Json& r) {
  add_line(text, "energy",
           fmt::format("{} J at the start, {} J at the end, largest error {} J",
                       number(r["energy_initial_J"]), number(r["energy_final_J"]),
                       number(r["energy_error_max_J"], 3)));
  if (!r["planner"].is_null())
    add_line(text, "work",
             fmt::format("dissipated {} J, held torque {} J, gyroscopic {} J, node velocity {} "
                         "J (filter {}, recovery {})",
                         number(r["dissipated_J"]), number(r["held_work_J"]),
                         number(r["gyroscopic_work_J"], 2), number(r["node_work_J"]),
                         number(r["filter_work_J"], 3), number(r["recovery_work_J"], 3)));
  if (r.contains("external_work_J"))
    add_line(text, "pushes",
             fmt::format("wrenches of the surroundings did {} J", number(r["external_work_J"])));
}

std::string solver_line(const Json& solver) {
  return fmt::format("{} updates per step, {} at most; residual {} at most ({}); {} halvings",
                     solver["updates_mean"].is_null() ? "no" : number(solver["updates_mean"], 3),
                     solver["updates_max"].get<long>(), number(solver["residual_max"], 2),
                     solver["criterion"].get<std::string>(), solver["halvings"].get<long>());
}

std::string cpu_line(const Json& timing) {
  const Json& tick_us = timing["tick_us"];
  if (tick_us.is_null()) return fmt::format("{} s", number(timing["cpu_s"], 3));
  return fmt::format("{} s; a tick takes {} us (p50), {} us (p99)", number(timing["cpu_s"], 3),
                     number(tick_us["p50"], 3), number(tick_us["p99"], 3));
}

}  // namespace

std::string summary(const Json& r, const std::vector<std::filesystem::path>& written) {
  std::string text;
  add_outcome(text, r);
  add_requirements(text, r);
  if (r.contains("torque_change")) add_line(text, "torque", torque_line(r["torque_change"]));
  if (r.contains("shield")) add_line(text, "shield", shield_line(r["shield"]));
  if (r.contains("plant")) add_line(text, "plant", plant_line(r["plant"]));
  add_line(text, "q", joints(r["q"]));
  add_energy(text, r);
  add_line(text, "solver", solver_line(r["solver"]));
  add_line(text, "cpu", cpu_line(r["timing"]));
  for (const auto& warning : r["warnings"]) add_line(text, "warning", warning.get<std::string>());
  for (const auto& file : written) add_line(text, "written", file.string());
  return text;
}

}  // namespace hamelin::app
