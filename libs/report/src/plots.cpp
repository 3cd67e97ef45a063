#include "plots.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <tuple>

#include "hamelin/scene/modelled.hpp"
#include "log_fields.hpp"

namespace hamelin::report {

using Eigen::VectorXd;

namespace {

constexpr std::size_t plotted_joints_max = 24;  // for chains of any length

}  // namespace

Plots::Plots(const Json& header, const simulation::Recorded& recorded, const World& world,
             std::size_t points_max)
    : world_(world),
      recorded_(recorded),
      ws_(world.model),
      plotted_joints_(
          std::min<std::size_t>(static_cast<std::size_t>(world.model.dof()), plotted_joints_max)),
      series_count_(header.value("series", Json::array()).size()),
      first_series_(3 * plotted_joints_ + columns),
      row_(first_series_ + series_count_ + plotted_joints_, unknown),
      bins_(row_.size(), points_max) {
  plan_joints();
  plan("clearance", "clearance", "m", false, {{"smallest", clearance}});
  plan_goals();
  plan_energy();
  plan_solver();
  plan_series(header);
}

std::string Plots::joint_unit(const char* angle, const char* length) const {
  bool has_revolute = false, has_prismatic = false;
  for (const auto& link : world_.model.robot().links)
    (link.joint.type == model::JointType::revolute ? has_revolute : has_prismatic) = true;
  return has_revolute && has_prismatic ? fmt::format("{}, {}", angle, length)
                                       : std::string(has_revolute ? angle : length);
}

void Plots::plan(const char* id, const char* title, const std::string& unit, bool wide_range,
                 std::initializer_list<std::pair<const char*, Column>> lines) {
  plots_.push_back({id, title, unit, {}, wide_range});
  for (const auto& [label, column] : lines)
    plots_.back().lines.emplace_back(label, 3 * plotted_joints_ + column);
}

void Plots::plan_per_joint(const char* id, const std::string& title, const std::string& unit,
                           std::size_t first_column) {
  const auto& links = world_.model.robot().links;
  const std::string suffix =
      plotted_joints_ < links.size() ? fmt::format(" (first {})", plotted_joints_) : "";
  plots_.push_back({id, title + suffix, unit, {}, false});
  for (std::size_t i = 0; i < plotted_joints_; ++i)
    plots_.back().lines.emplace_back(links[i].joint.name, first_column + i);
}

void Plots::plan_joints() {
  plan_per_joint("q", "joint angles", joint_unit("rad", "m"), 0);
  plan_per_joint("v", "joint rates", joint_unit("rad/s", "m/s"), plotted_joints_);
  plan_per_joint("tau", "joint torques", joint_unit("Nm", "N"), 2 * plotted_joints_);
}

void Plots::plan_goals() {
  bool has_tip_goal = false, has_joint_goal = false, has_trajectory = false;
  for (const auto& goal : world_.goals)
    for (const auto& option : scene::options_of(goal)) {
      (option.type == scene::GoalType::joint ? has_joint_goal : has_tip_goal) = true;
      has_trajectory = has_trajectory || option.trajectory;
    }
  if (has_tip_goal) plan("goal", "distance to the goal", "m", false, {{"tip", goal_m}});
  if (has_joint_goal)
    plan(has_tip_goal ? "goal_joint" : "goal", "distance to the joint goal", joint_unit("rad", "m"),
         false, {{"largest joint error", goal_rad}});
  if (!has_trajectory) return;
  plan("trajectory", "distance from the trajectory", joint_unit("rad", "m"), false,
       {{"largest joint error", off_trajectory}});
  if (scene::limits_in_force(recorded_.scene.model, world_.model.robot()).torque)
    plan_per_joint("tau_share", "torques as shares of their limits", "1",
                   first_series_ + series_count_);
}

void Plots::plan_energy() {
  plan("energy", "energy account", "J", false,
       {{"kinetic", kinetic},
        {"potential", potential},
        {"control", control},
        {"gyroscopic work", gyroscopic},
        {"filter work", filter},
        {"recovery work", recovery},
        {"dissipated", dissipated},
        {"held work", held},
        {"node work", node}});
  plan("energy_error", "energy error", "J", true, {{"|E - E0 - work|", energy_error}});
}

void Plots::plan_solver() {
  plan("solver", "solver updates per step", "1", true,
       {{"updates", updates}, {"halvings", halvings}});
  plan("residual", "solver residual", "1", true, {{"residual", residual}});
  plan("tick_us", "time of one tick", "µs", true,
       {{"tick", tick_us}, {"longest since the previous line", tick_us_max}});
}

void Plots::plan_series(const Json& header) {
  const std::size_t first = plots_.size();
  for (std::size_t i = 0; i < series_count_; ++i) {
    const Json& series = header["series"][i];
    const auto name = series.at("name").get<std::string>(),
               series_unit = series.at("unit").get<std::string>();
    if (name == "evasion" && series_unit.empty()) evasion_ = i;
    auto plot = std::find_if(plots_.begin() + static_cast<std::ptrdiff_t>(first), plots_.end(),
                             [&](const Plot& other) { return other.unit == series_unit; });
    if (plot == plots_.end()) {
      const char* const title = "series of the planner";
      plots_.push_back({fmt::format("series {}", series_unit), title, series_unit, {}, false});
      plot = plots_.end() - 1;
    }
    plot->lines.emplace_back(name, first_series_ + i);
  }
}

void Plots::add(const Json& line, const Frame& frame, const log::LogReader& reader) {
  std::fill(row_.begin(), row_.end(), unknown);
  set_joints(line, frame, reader);
  const Json& energy = object_member(line, "energy", reader);
  const Json& solver = object_member(line, "solver", reader);
  const Json& timing = object_member(line, "timing", reader);
  const Json& extrema = object_member(line, "extrema", reader);
  at(clearance) = number(line, "clearance_m", reader);
  set_energy(energy, reader);
  at(updates) = number(solver, "updates", reader);
  at(halvings) = number(solver, "halvings", reader);
  at(residual) = number(solver, "residual", reader);
  at(tick_us) = number(timing, "tick_us", reader);
  at(tick_us_max) = number(timing, "tick_us_max", reader);
  if (series_count_ > 0) set_series(line, reader);
  if (!extrema.empty()) set_extrema(extrema, reader);
  set_references(line, frame, reader);
  if (frame.q.allFinite()) set_goal_distance(frame);
  bins_.add(frame.time_s, row_);
}

void Plots::set_joints(const Json& line, const Frame& frame, const log::LogReader& reader) {
  const int dof = world_.model.dof();
  const auto set = [&](std::size_t index, const VectorXd& x) {
    if (x.size() > 0) std::copy_n(x.data(), plotted_joints_, &row_[index * plotted_joints_]);
  };
  set(0, frame.q);
  set(1, joint_vector(line, "v", dof, reader));
  const VectorXd tau = joint_vector(line, "tau", dof, reader);
  set(2, tau);
  for (std::size_t i = 0; tau.size() > 0 && i < plotted_joints_; ++i)
    if (const auto limit = world_.model.robot().links[i].joint.effort_max)
      row_[first_series_ + series_count_ + i] = tau[static_cast<Eigen::Index>(i)] / *limit;
}

void Plots::set_energy(const Json& energy, const log::LogReader& reader) {
  const std::pair<Column, const char*> entries[] = {
      {kinetic, "kinetic_J"},       {potential, "potential_J"},
      {control, "control_J"},       {gyroscopic, "gyroscopic_work_J"},
      {filter, "filter_work_J"},    {recovery, "recovery_work_J"},
      {dissipated, "dissipated_J"}, {held, "held_work_J"},
      {node, "node_work_J"}};
  for (const auto& [column, key] : entries) at(column) = number(energy, key, reader);
  const auto number_or_zero = [&](const char* key) {
    return energy.contains(key) ? number(energy, key, reader) : 0.0;
  };
  const double balance = at(kinetic) + at(potential) + at(control) -
                         (at(gyroscopic) + at(held) - at(dissipated) + at(node)) -
                         number_or_zero("stop_work_J") - number_or_zero("load_energy_J") -
                         number_or_zero("external_work_J");
  if (!first_balance_) first_balance_ = balance;
  at(energy_error) = std::abs(balance - *first_balance_);
}

void Plots::set_series(const Json& line, const log::LogReader& reader) {
  const VectorXd series =
      numbers(line, "series", static_cast<int>(series_count_), "series", reader);
  if (series.size() > 0) std::copy_n(series.data(), series_count_, &row_[first_series_]);
}

std::optional<double> Plots::evasion() const {
  if (!evasion_) return std::nullopt;
  return row_[first_series_ + *evasion_];
}

void Plots::set_extrema(const Json& extrema, const log::LogReader& reader) {
  if (!std::isnan(at(clearance))) at(clearance) = number(extrema, "clearance_m", reader);
  at(energy_error) = number(extrema, "energy_error_J", reader);
  at(updates) = number(extrema, "updates", reader);
  at(halvings) = number(extrema, "halvings", reader);
  at(residual) = number(extrema, "residual", reader);
}

void Plots::set_references(const Json& line, const Frame& frame, const log::LogReader& reader) {
  if (const Json& target = object_member(line, "target", reader); !target.empty())
    at(goal_m) = number(target, "error_m", reader);
  if (const Json& reference = object_member(line, "reference", reader); !reference.empty())
    if (const VectorXd q = joint_vector(reference, "q", world_.model.dof(), reader); q.size() > 0)
      at(off_trajectory) = (frame.q - q).lpNorm<Eigen::Infinity>();
}

void Plots::set_goal_distance(const Frame& frame) {
  if (world_.goals.empty()) return;
  const auto& goal = world_.goals[std::min(frame.goal_index, world_.goals.size() - 1)];
  if (goal.type == scene::GoalType::follow) return;  // the tick has the distance from its target
  dynamics::forward_kinematics(world_.model, ws_, frame.q);
  const geometry::SE3 tip = dynamics::tip_pose(world_.model, ws_);
  const auto nearer = [](double& least, double distance) {
    if (!(least <= distance)) least = distance;
  };
  for (const scene::Goal& option : scene::options_of(goal))
    if (option.type != scene::GoalType::joint)
      nearer(at(goal_m), (tip.p() - scene::nearest_pose(option, tip).p()).norm());
    else if (option.q.size() == frame.q.size())
      nearer(at(goal_rad), (frame.q - option.q).lpNorm<Eigen::Infinity>());
}

Json Plots::json(Container& container) const {
  constexpr int bits = 12;
  Json plots = Json::array();
  const Json t = container.stepped(bins_.times(), recorded_.scene.step_s);
  for (const Plot& plot : plots_) {
    Json series = Json::array();
    for (const auto& [label, column] : plot.lines) {
      const std::vector<double> y = bins_.values(column);
      const bool known =
          std::any_of(y.begin(), y.end(), [](double value) { return !std::isnan(value); });
      const bool nonzero = std::any_of(
          y.begin(), y.end(), [](double value) { return value != 0.0 && !std::isnan(value); });
      // Only the first line is shown if it is zero throughout, for example not the work of an
      // unused channel.
      if (!known || (!nonzero && !series.empty())) continue;
      series.push_back(
          {{"label", label},
           {"y", plot.wide_range ? container.relative(y, bits) : container.levels(y)}});
    }
    if (series.empty()) continue;
    plots.push_back({{"id", plot.id},
                     {"title", plot.title},
                     {"unit", plot.unit},
                     {"t", t},
                     {"series", std::move(series)},
                     {"marks", marks(plot)}});
  }
  return plots;
}

}  // namespace hamelin::report
