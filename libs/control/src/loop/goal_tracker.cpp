#include "hamelin/control/goal_tracker.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <span>

namespace hamelin::control {

namespace {

double angle_between(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return Eigen::AngleAxisd(a.transpose() * b).angle();
}

double tip_speed(const model::Model& model, const dynamics::Workspace& ws,
                 const Eigen::VectorXd& v) {
  const Eigen::Vector3d tip = dynamics::tip_pose(model, ws).p();
  return dynamics::point_velocity(model, ws, model.robot().tip.link, tip, v).norm();
}

// @param passes whether the speed does not matter
GoalError option_error(const scene::Goal& goal, bool passes, const model::Model& model,
                       const dynamics::Workspace& ws, const Eigen::VectorXd& q,
                       const Eigen::VectorXd& v) {
  const bool slow = passes || v.lpNorm<Eigen::Infinity>() < goal.speed_max;
  GoalError error;
  if (goal.type == scene::GoalType::joint) {
    error.radians = (q - goal.q).lpNorm<Eigen::Infinity>();
    error.reached = *error.radians < goal.tolerance_rad && slow;
    return error;
  }
  const geometry::SE3 tip = dynamics::tip_pose(model, ws);
  const geometry::SE3 wanted = scene::nearest_pose(goal, tip);
  error.metres = (tip.p() - wanted.p()).norm();
  const bool tip_slow =
      passes || !goal.tip_speed_max_m_s || tip_speed(model, ws, v) < *goal.tip_speed_max_m_s;
  error.reached = *error.metres < goal.tolerance_m && slow && tip_slow;
  if (goal.type == scene::GoalType::pose) {
    error.radians = angle_between(tip.R(), wanted.R());
    error.reached = error.reached && *error.radians < goal.tolerance_rad;
  }
  return error;
}

// In tolerances.
double size_of(const GoalError& error, const scene::Goal& goal) {
  return std::max(error.metres ? *error.metres / goal.tolerance_m : 0.0,
                  error.radians ? *error.radians / goal.tolerance_rad : 0.0);
}

}  // namespace

GoalError goal_error(const scene::Goal& goal, const model::Model& model,
                     const dynamics::Workspace& ws, const Eigen::VectorXd& q,
                     const Eigen::VectorXd& v) {
  GoalError best;
  if (goal.type == scene::GoalType::follow) return best;
  const std::span<const scene::Goal> options = scene::options_of(goal);
  for (std::size_t i = 0; i < options.size(); ++i) {
    GoalError error = option_error(options[i], goal.passes, model, ws, q, v);
    error.size = size_of(error, options[i]);
    if (i > 0 && (best.reached || (!error.reached && !(error.size < best.size)))) continue;
    best = error;
    best.option = i;
  }
  return best;
}

GoalError target_error(const scene::Goal& goal, const geometry::SE3& target,
                       const model::Model& model, const dynamics::Workspace& ws) {
  const geometry::SE3 tip = dynamics::tip_pose(model, ws);
  GoalError error;
  error.metres = (tip.p() - target.p()).norm();
  if (!goal.position_only) error.radians = angle_between(tip.R(), target.R());
  return error;
}

GoalTracker::GoalTracker(const std::vector<scene::Goal>& goals,
                         const std::optional<scene::StallRule>& rule, const model::Model& model)
    : goals_(&goals), rule_(rule), model_(&model) {}

bool GoalTracker::advance(const dynamics::Workspace& ws, const Eigen::VectorXd& q,
                          const Eigen::VectorXd& v) {
  if (all_reached() || !goal_error(goal(), *model_, ws, q, v).reached) return false;
  ++index_;
  rest_s_ = 0.0;
  return true;
}

bool GoalTracker::stalled(const dynamics::Workspace& ws, const Eigen::VectorXd& v, double dt_s) {
  if (!rule_ || follows()) return false;
  bool away = true;
  if (goal().type == scene::GoalType::position || goal().type == scene::GoalType::pose) {
    const geometry::SE3 tip = dynamics::tip_pose(*model_, ws);
    away = (tip.p() - scene::nearest_pose(goal(), tip).p()).norm() > rule_->distance_m;
  }
  rest_s_ = tip_speed(*model_, ws, v) < rule_->speed_m_s && away ? rest_s_ + dt_s : 0.0;
  return rest_s_ >= rule_->hold_s;
}

const scene::Goal* follow_goal_of(const std::vector<scene::Goal>& goals) noexcept {
  if (goals.empty() || goals.back().type != scene::GoalType::follow) return nullptr;
  return &goals.back();
}

}  // namespace hamelin::control
