#include "hamelin/scene/goal.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <tuple>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/geometry/so3.hpp"

namespace hamelin::scene {

std::string_view to_string(GoalType type) noexcept {
  switch (type) {
    case GoalType::joint:
      return "joint";
    case GoalType::position:
      return "position";
    case GoalType::pose:
      return "pose";
    case GoalType::follow:
      return "follow";
    case GoalType::any_of:
      return "any_of";
  }
  return "unknown";
}

std::string_view to_string(WhenLost when) noexcept {
  return when == WhenLost::end ? "end" : "hold";
}

std::string_view type_name(const Goal& goal) noexcept {
  if (goal.trajectory) return "trajectory";
  return goal.path.size() > 0 ? "path" : to_string(goal.type);
}

std::span<const Goal> options_of(const Goal& goal) noexcept {
  if (goal.type == GoalType::any_of) return goal.any_of;
  return {&goal, 1};
}

bool is_option(const Goal& goal) noexcept {
  return goal.type != GoalType::follow && goal.type != GoalType::any_of && goal.path.size() == 0;
}

bool is_region(const Goal& goal) noexcept {
  return goal.free_axis.has_value() || goal.low_m != goal.high_m;
}

bool needs_path(const Goal& goal) noexcept {
  return !path_need(goal).empty();
}

std::string_view path_need(const Goal& goal) noexcept {
  if (!goal.constraints.empty()) return "constraints";
  if (goal.way) return "way";
  if (goal.retreat) return "retreat";
  if (goal.approach) return "approach";
  if (goal.type == GoalType::any_of) return "any_of";
  if (goal.free_axis) return "free_axis";
  return is_region(goal) ? "low_m" : "";
}

geometry::SE3 nearest_pose(const Goal& goal, const geometry::SE3& tip) {
  if (!is_region(goal)) return goal.pose;
  const Eigen::Matrix3d& R = goal.pose.R();
  const Eigen::Vector3d at = R.transpose() * (tip.p() - goal.pose.p());
  const Eigen::Vector3d p = goal.pose.p() + R * at.cwiseMax(goal.low_m).cwiseMin(goal.high_m);
  if (!goal.free_axis) return {R, p};
  const Eigen::Vector3d now = tip.R() * *goal.free_axis, wanted = R * *goal.free_axis;
  return {geometry::rotation_between(now, wanted) * tip.R(), p};
}

namespace {

void check_tolerance(const WayTolerance& tolerance, const std::string& where) {
  for (const auto& [key, value, most] :
       {std::tuple("tolerance_m", tolerance.m, 0.5), {"tolerance_rad", tolerance.rad, 4.0}})
    if (!(value > 0.0 && value <= most))
      throw Error(ErrorCode::invalid, fmt::format("{}/{}: is {}, expected above 0, at most {}",
                                                  where, key, value, most));
}

void check_stretch(const Stretch& stretch, const std::string& where) {
  if (!stretch.direction.allFinite() || std::abs(stretch.direction.norm() - 1.0) > 1e-3)
    throw Error(ErrorCode::invalid,
                fmt::format("{}/direction: is not of length 1, expected a unit vector", where));
  if (!(stretch.distance_m > 0.0 && std::isfinite(stretch.distance_m)))
    throw Error(ErrorCode::invalid, fmt::format("{}/distance_m: is {}, expected more than 0", where,
                                                stretch.distance_m));
  check_tolerance(stretch.tolerance, where);
}

}  // namespace

void check_way(const Goal& goal, const std::string& where) {
  if (goal.way) {
    if (goal.way->through_m && !goal.way->through_m->allFinite())
      throw Error(ErrorCode::invalid,
                  fmt::format("{}/way/through_m: is not finite, expected a point", where));
    check_tolerance(goal.way->tolerance, where + "/way");
    if (goal.approach || goal.retreat)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}/way: is given besides an approach or a retreat, expected one of "
                              "them: it is the whole way",
                              where));
  }
  if (goal.approach) check_stretch(*goal.approach, where + "/approach");
  if (goal.retreat) check_stretch(*goal.retreat, where + "/retreat");
}

void check_region(const Goal& goal, const std::string& where) {
  const auto refuse = [&](const char* key, const char* message) {
    throw Error(ErrorCode::invalid, fmt::format("{}/{}: {}", where, key, message));
  };
  if (!goal.low_m.allFinite() || !goal.high_m.allFinite())
    refuse("low_m", "low_m or high_m is not finite, expected a box of finite size");
  if (!(goal.low_m.array() <= goal.high_m.array()).all())
    refuse("low_m", "is not below high_m on each axis, expected the low corner of a box");
  if (goal.free_axis &&
      !(goal.free_axis->allFinite() && std::abs(goal.free_axis->norm() - 1.0) <= 1e-3))
    refuse("free_axis", "is not of length 1, expected a unit vector of the tip's frame");
}

}  // namespace hamelin::scene
