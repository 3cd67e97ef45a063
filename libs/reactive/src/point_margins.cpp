#include "hamelin/reactive/point_margins.hpp"

#include <algorithm>

namespace hamelin::reactive {

namespace {

// Motors that act late, with friction and noise, let the arm come about a millimetre nearer.
constexpr double smallest_m = 0.001, smallest_sampled_m = 0.003;
// Least margins are so much wider than those of a shield.
constexpr double least_beyond_shield_m = 0.001;
constexpr double self_beyond_shield_m = 0.002;  // kept of the distance between parts besides
constexpr double voxel_at_goal = 0.4;           // share of a voxel that is kept near a tip goal

}  // namespace

MarginParams margins_in_scene(const planning::Setup& setup, MarginParams wanted) {
  // A map may lack objects that fill less than half of a voxel.
  const double voxel = setup.map_resolution_m();
  wanted.full_m = std::max(wanted.full_m, voxel);
  wanted.goal_m = std::min(std::max(wanted.goal_m, voxel_at_goal * voxel), wanted.full_m);
  wanted.slack_m = std::min(wanted.slack_m, wanted.full_m);
  // Inside the margin of a shield, the arm could not leave its place.
  wanted.self_m = std::max(wanted.self_m, setup.shield_self_margin_m() + self_beyond_shield_m);
  return wanted;
}

PointMargins::PointMargins(const planning::Setup& setup, const MarginParams& params)
    : params_(params),
      smallest_m_(setup.sampled() ? smallest_sampled_m : smallest_m),
      least_m_(std::max(smallest_m, setup.shield_margin_m() + least_beyond_shield_m)),
      least_self_m_(std::max(smallest_m, setup.shield_self_margin_m() + least_beyond_shield_m)),
      goal_q_(Eigen::VectorXd::Zero(setup.dof())),
      self_at_goal_(params.self_m),
      clearance_at_goal_(setup.shapes().size()) {}

void PointMargins::set_goal(Surroundings& surroundings, const hamelin_goal& goal, double radius) {
  joint_goal_ = goal.type == HAMELIN_GOAL_JOINT;
  std::fill(clearance_at_goal_.begin(), clearance_at_goal_.end(), radius);
  self_at_goal_ = params_.self_m;
  if (!joint_goal_) return;
  goal_q_ = planning::ConstVectorMap(goal.q, goal_q_.size());
  surroundings.query(goal_q_, radius, 2.0 * params_.self_m + params_.slack_m);
  for (const auto& contact : surroundings.contacts()) {
    auto& clearance = clearance_at_goal_[static_cast<std::size_t>(contact.shape)];
    clearance = std::min(clearance, contact.distance_m);
  }
  for (const auto& contact : surroundings.self_contacts())
    self_at_goal_ =
        std::min(self_at_goal_, std::max(smallest_m_, contact.distance_m - params_.slack_m));
}

double PointMargins::at_goal(const NearPoint& point) const {
  if (point.obstacle == NearPoint::self) return self_at_goal_;
  if (!joint_goal_) return params_.goal_m;
  const double remaining =
      clearance_at_goal_[static_cast<std::size_t>(point.shape)] - params_.slack_m;
  return std::min(params_.full_m, std::max(smallest_m_, remaining));
}

void PointMargins::set(std::span<NearPoint> points, double weight) const {
  for (auto& point : points) {
    const double full = point.obstacle == NearPoint::self ? params_.self_m : params_.full_m;
    point.margin = (1.0 - weight) * at_goal(point) + weight * full;
  }
}

void PointMargins::set_least(std::span<NearPoint> points) const {
  for (auto& point : points)
    point.margin = point.obstacle == NearPoint::self ? least_self_m_ : least_m_;
}

bool PointMargins::tight_at_goal(const NearPoint& point) const {
  if (point.obstacle == NearPoint::self) return self_at_goal_ < params_.self_m;
  return joint_goal_ && clearance_at_goal_[static_cast<std::size_t>(point.shape)] < params_.full_m;
}

}  // namespace hamelin::reactive
