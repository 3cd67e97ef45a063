#include "loop/goal_list.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "hamelin/control/goal_tracker.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"

namespace hamelin::control {

namespace {

void check(bool right, std::size_t goal, std::string_view message) {
  if (!right) throw Error(ErrorCode::invalid, fmt::format("goal {}: {}", goal + 1, message));
}

void check_joint_goal(const scene::Goal& goal, std::size_t i, const scene::Scene& scene,
                      const model::Model& model, std::size_t path_points_max) {
  const int dof = model.dof();
  check(goal.q.size() == dof, i,
        fmt::format("q: {} values given, expected {} (one per joint of '{}')", goal.q.size(), dof,
                    model.robot().name));
  check(goal.q.allFinite(), i, "q: is not finite, expected finite numbers");
  check(goal.tolerance_rad > 0.0, i,
        fmt::format("tolerance_rad: {} is not allowed, expected more than 0", goal.tolerance_rad));
  if (scene.model.joint_limits)
    for (int k = 0; k < dof; ++k) {
      const auto& joint = model.robot().links[static_cast<std::size_t>(k)].joint;
      check(goal.q[k] >= joint.lower.value_or(goal.q[k]) &&
                goal.q[k] <= joint.upper.value_or(goal.q[k]),
            i,
            fmt::format("q: {} is beyond a limit of joint '{}', expected {} to {}", goal.q[k],
                        joint.name, joint.lower.value_or(goal.q[k]),
                        joint.upper.value_or(goal.q[k])));
    }
  if (goal.path.size() == 0) return;
  if (goal.trajectory) {
    scene::check(*goal.trajectory, fmt::format("goal {}: trajectory", i + 1));
    const std::string defect = joints_defect(*goal.trajectory, model);
    check(defect.empty(), i, "trajectory: " + defect);
    check(goal.trajectory->q == goal.path, i,
          "path: differs from the trajectory, expected its points");
  }
  check(goal.path.rows() == dof && goal.path.allFinite(), i,
        fmt::format("path: expected {} finite numbers per way-point", dof));
  check(goal.path.rightCols(1) == goal.q, i, "path: its end is not q, expected q as its end");
  check(static_cast<std::size_t>(goal.path.cols()) <= path_points_max, i,
        fmt::format("path: {} way-points, expected at most {} (path_points_max)", goal.path.cols(),
                    path_points_max));
}

void check_follow_goal(const scene::Goal& goal, std::size_t i, bool last, bool follows) {
  check(follows, i,
        "follow: the planner does not follow targets, expected one that does, such as hybrid");
  check(last, i, "follow: is never reached, expected it as the last goal");
  check(goal.pose.p().allFinite() && goal.pose.R().allFinite(), i,
        "pose: is not finite, expected finite numbers");
  const scene::TargetStream& bounds = goal.stream;
  for (const auto& [key, value] :
       {std::pair("tolerance_m", goal.tolerance_m), std::pair("tolerance_rad", goal.tolerance_rad),
        std::pair("gap_max_s", bounds.gap_max_s), std::pair("jump_max_m", bounds.jump_max_m),
        std::pair("jump_max_rad", bounds.jump_max_rad), std::pair("noise_m", bounds.noise_m),
        std::pair("noise_rad", bounds.noise_rad), std::pair("leash_m", bounds.leash_m),
        std::pair("leash_rad", bounds.leash_rad)})
    check(value > 0.0 && std::isfinite(value), i,
          fmt::format("{}: {} is not allowed, expected more than 0", key, value));
}

void check_tip_goal(const scene::Goal& goal, std::size_t i) {
  check(goal.pose.p().allFinite() && goal.pose.R().allFinite(), i,
        "pose: is not finite, expected finite numbers");
  check(goal.tolerance_m > 0.0, i,
        fmt::format("tolerance_m: {} is not allowed, expected more than 0", goal.tolerance_m));
  check(goal.type != scene::GoalType::pose || goal.tolerance_rad > 0.0, i,
        fmt::format("tolerance_rad: {} is not allowed, expected more than 0", goal.tolerance_rad));
  scene::check_region(goal, fmt::format("goal {}", i + 1));
}

void check_options(const scene::Goal& goal, std::size_t i, const scene::Scene& scene,
                   const model::Model& model, std::size_t path_points_max) {
  const std::span<const scene::Goal> options = scene::options_of(goal);
  check(!options.empty(), i, "any_of: is empty, expected at least one goal");
  check(options.size() <= scene::options_max, i,
        fmt::format("any_of: {} goals given, expected at most {}", options.size(),
                    scene::options_max));
  for (const scene::Goal& option : options) {
    if (option.type == scene::GoalType::joint)
      check_joint_goal(option, i, scene, model, path_points_max);
    else
      check_tip_goal(option, i);
    check(option.speed_max > 0.0, i,
          fmt::format("speed_max: {} is not allowed, expected more than 0", option.speed_max));
    check(&option == &goal || scene::is_option(option), i,
          fmt::format("any_of: has a {} goal, expected joint, position or pose",
                      scene::type_name(option)));
  }
}

}  // namespace

GoalList::GoalList(std::uint64_t of_number, std::vector<scene::Goal> all,
                   std::vector<std::uint64_t> allowed, Motions of_goals, std::uint64_t of_load)
    : number(of_number),
      shared(std::make_shared<const std::vector<scene::Goal>>(std::move(all))),
      goals(*shared),
      allowances(std::move(allowed)),
      motions(std::move(of_goals)),
      load(of_load) {
  for (const auto& goal : goals) for_planner.push_back(to_c(goal));
}

hamelin_goal to_c(const scene::Goal& given) {
  const scene::Goal& goal = scene::options_of(given).front();
  const bool joint = goal.type == scene::GoalType::joint;
  hamelin_goal out{};
  out.struct_size = sizeof out;
  out.type = joint                                    ? HAMELIN_GOAL_JOINT
             : goal.type == scene::GoalType::position ? HAMELIN_GOAL_POSITION
             : goal.type == scene::GoalType::follow   ? HAMELIN_GOAL_FOLLOW
                                                      : HAMELIN_GOAL_POSE;
  out.follows_rotation = goal.type == scene::GoalType::follow && !goal.position_only ? 1 : 0;
  const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(goal.pose.R());
  std::copy_n(goal.pose.p().data(), 3, out.position_world_m);
  std::copy_n(wxyz.data(), 4, out.quaternion_wxyz);
  out.tolerance_m = goal.tolerance_m;
  out.tolerance_rad = goal.tolerance_rad;
  out.speed_max = given.passes ? infinity : goal.speed_max;
  out.q = joint ? goal.q.data() : nullptr;
  out.path = goal.path.size() > 0 ? goal.path.data() : nullptr;
  out.path_points = static_cast<std::size_t>(goal.path.cols());
  return out;
}

void check_goals(const std::vector<scene::Goal>& goals, const scene::Scene& scene,
                 const model::Model& model, std::size_t path_points_max,
                 const planning::Plugin& planner) {
  if (goals.empty())
    throw Error(ErrorCode::invalid, "goals: none are given, expected at least one");
  for (std::size_t i = 0; i < goals.size(); ++i) {
    const scene::Goal& goal = goals[i];
    if (goal.type == scene::GoalType::follow)
      check_follow_goal(goal, i, i + 1 == goals.size(), planner.follows_targets());
    else
      check_options(goal, i, scene, model, path_points_max);
    check(!goal.trajectory || planner.follows_trajectories(), i,
          "trajectory: the planner does not follow trajectories, expected one that does, such as "
          "hybrid");
    scene::check(goal.may_touch, fmt::format("goal {}: may_touch", i + 1));
    const std::string defect = path_defect(goal, scene, planner);
    check(defect.empty(), i, defect);
    for (std::size_t k = 0; k < goal.constraints.size(); ++k)
      scene::check(goal.constraints[k], fmt::format("goal {}: constraints: {}", i + 1, k + 1));
  }
}

std::string path_defect(const scene::Goal& goal, const scene::Scene& scene,
                        const planning::Plugin& planner) {
  if (!scene::needs_path(goal)) return {};
  if (goal.constraints.size() > scene::constraints_max)
    return fmt::format("constraints: {} given, expected at most {}", goal.constraints.size(),
                       scene::constraints_max);
  if (!goal.constraints.empty() && (goal.type == scene::GoalType::follow || goal.path.size() > 0))
    return fmt::format(
        "constraints: are given for a {} goal, expected joint, position, "
        "pose or any_of",
        scene::type_name(goal));
  if (scene.guide.type == scene::GuideType::none || !planner.follows_paths())
    return fmt::format(
        "{}: planner '{}' moves without a path, expected one that follows paths, such as hybrid, "
        "and a guide",
        scene::path_need(goal), planner.name());
  return {};
}

void set_target(const TargetState& target, hamelin_goal& goal) noexcept {
  const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(target.pose.R());
  std::copy_n(target.pose.p().data(), 3, goal.position_world_m);
  std::copy_n(wxyz.data(), 4, goal.quaternion_wxyz);
  std::copy_n(target.velocity.data(), 3, goal.velocity_world_m_s);
  std::copy_n(target.acceleration.data(), 3, goal.acceleration_world_m_s2);
  std::copy_n(target.angular_velocity.data(), 3, goal.angular_velocity_world_rad_s);
  std::copy_n(target.angular_acceleration.data(), 3, goal.angular_acceleration_world_rad_s2);
  goal.target_lost = target.lost ? 1 : 0;
}

void set_reference(const ReferenceState& reference, hamelin_goal& goal) noexcept {
  goal.reference_q = reference.q.data();
  goal.reference_v = reference.v.data();
  goal.reference_a = reference.a.data();
  goal.reference_time_s = reference.time_s;
  goal.reference_rate = reference.rate;
  goal.reference_certified = reference.certified ? 1 : 0;
}

std::string joints_defect(const scene::JointTrajectory& trajectory, const model::Model& model) {
  const auto& links = model.robot().links;
  if (trajectory.q.rows() != model.dof())
    return fmt::format("{} joints, expected {} (those of '{}')", trajectory.q.rows(), model.dof(),
                       model.robot().name);
  for (std::size_t i = 0; i < trajectory.joints.size(); ++i)
    if (trajectory.joints[i] != links[i].joint.name)
      return fmt::format("joint {} is '{}', expected '{}' (the joints of '{}' in their order)",
                         i + 1, trajectory.joints[i], links[i].joint.name, model.robot().name);
  return {};
}

std::vector<scene::Allowance> allowances_of(const std::vector<scene::Goal>& goals) {
  std::vector<scene::Allowance> out;
  out.reserve(goals.size());
  for (const auto& goal : goals) out.push_back(goal.may_touch);
  return out;
}

std::size_t longest_path(const std::vector<scene::Goal>& goals) {
  Eigen::Index longest = 0;
  for (const auto& goal : goals) longest = std::max(longest, goal.path.cols());
  return static_cast<std::size_t>(longest);
}

}  // namespace hamelin::control
