#include "hamelin/control/goal_tracker.hpp"

#include <Eigen/Geometry>

namespace hamelin::control {

namespace {

double angle_between(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return Eigen::AngleAxisd(a.transpose() * b).angle();
}

}  // namespace

GoalTracker::GoalTracker(const std::vector<scene::Goal>& goals,
                         const std::optional<scene::StallRule>& rule, const model::Model& model)
    : goals_(&goals), rule_(rule), model_(model) {}

double GoalTracker::tip_speed(const dynamics::Workspace& ws, const Eigen::VectorXd& v) const {
  const Eigen::Vector3d tip = dynamics::tip_pose(model_, ws).p();
  return dynamics::point_velocity(model_, ws, model_.robot().tip.link, tip, v).norm();
}

GoalError GoalTracker::error(const dynamics::Workspace& ws, const Eigen::VectorXd& q,
                             const Eigen::VectorXd& v) const {
  const scene::Goal& target = goal();
  const bool slow = v.lpNorm<Eigen::Infinity>() < target.speed_max;
  GoalError error;
  if (target.type == scene::GoalType::joint) {
    error.radians = (q - target.q).lpNorm<Eigen::Infinity>();
    error.reached = *error.radians < target.tolerance_rad && slow;
    return error;
  }
  const geometry::SE3 tip = dynamics::tip_pose(model_, ws);
  error.metres = (tip.p() - target.pose.p()).norm();
  error.reached = *error.metres < target.tolerance_m && slow &&
                  !(target.tip_speed_max_m_s && !(tip_speed(ws, v) < *target.tip_speed_max_m_s));
  if (target.type == scene::GoalType::pose) {
    error.radians = angle_between(tip.R(), target.pose.R());
    error.reached = error.reached && *error.radians < target.tolerance_rad;
  }
  return error;
}

bool GoalTracker::advance(const dynamics::Workspace& ws, const Eigen::VectorXd& q,
                          const Eigen::VectorXd& v) {
  if (all_reached() || !error(ws, q, v).reached) return false;
  ++index_;
  rest_s_ = 0.0;
  return true;
}

bool GoalTracker::stalled(const dynamics::Workspace& ws, const Eigen::VectorXd& v, double dt_s) {
  if (!rule_) return false;
  bool away = true;
  if (goal().type != scene::GoalType::joint)
    away = (dynamics::tip_pose(model_, ws).p() - goal().pose.p()).norm() > rule_->distance_m;
  rest_s_ = tip_speed(ws, v) < rule_->speed_m_s && away ? rest_s_ + dt_s : 0.0;
  return rest_s_ >= rule_->hold_s;
}

}  // namespace hamelin::control
