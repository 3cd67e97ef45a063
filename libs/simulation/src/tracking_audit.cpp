#include "tracking_audit.hpp"

#include <algorithm>
#include <cmath>

#include "hamelin/geometry/so3.hpp"

namespace hamelin::simulation {

using Eigen::Vector3d;

namespace {

constexpr double check_every_s = 0.02;
constexpr double free_by_m = 0.02, free_of_self_m = 0.01;  // clearance of a free target's posture
// The way there is examined every so much of the joint that moves most [rad or m], for this
// clearance.
constexpr double way_step = 0.05, way_by_m = 0.001;
// The iteration (16.12): its number of steps, their largest size, and its damping.
constexpr int ik_iterations = 60;
constexpr double ik_step_max = 0.2, ik_damping = 1e-4, ik_length = 0.25;
constexpr double ik_tolerance = 0.2;  // share of the goal's tolerances
// A target that was away for a shorter time does not count as coming back.
constexpr double away_least_s = 0.1;

}  // namespace

TrackingAudit::TrackingAudit(const model::Model& model, const control::ModelledLimits& limits)
    : model_(model), limits_(limits), ws_(model), J_(6, model.dof()) {}

void TrackingAudit::Sums::add(const control::GoalError& error, double h) {
  const double m = error.metres.value_or(0.0), rad = error.radians.value_or(0.0);
  time_s += h;
  square_m += h * m * m;
  square_rad += h * rad * rad;
  max_m = std::max(max_m, m);
  max_rad = std::max(max_rad, rad);
}

log::Result::Following::Errors TrackingAudit::Sums::errors() const {
  if (time_s <= 0.0) return {};
  return {time_s, std::sqrt(square_m / time_s), max_m, std::sqrt(square_rad / time_s), max_rad};
}

void TrackingAudit::observe(const scene::Goal& goal, const control::TargetState& target,
                            const Eigen::VectorXd& q, control::WorldView& judge, double h) {
  if (target.waiting) return;
  dynamics::forward_kinematics(model_, ws_, q);
  error_ = control::target_error(goal, target.pose, model_, ws_);
  since_check_s_ += h;
  if (!observed_ || since_check_s_ >= check_every_s - 0.5 * h) {
    free_ = is_free(goal, target.pose, q, judge);
    since_check_s_ = 0.0;
  }
  observed_ = true;
  const bool tracked =
      *error_.metres < goal.tolerance_m && error_.radians.value_or(0.0) < goal.tolerance_rad;
  all_.add(error_, h);
  if (free_) while_free_.add(error_, h);
  if (tracked) out_.tracked_s += h;
  if (free_ && !tracked) out_.free_not_tracked_s += h;
  if (target.lost) out_.lost_s += h;
  note_resumption(tracked, h);
}

void TrackingAudit::note_resumption(bool tracked, double h) {
  if (!free_) {
    away_s_ += h;
    if (resume_s_ >= 0.0) ++out_.not_resumed;
    resume_s_ = -1.0;
    return;
  }
  if (away_s_ > away_least_s) resume_s_ = 0.0;
  away_s_ = 0.0;
  if (resume_s_ < 0.0) return;
  resume_s_ += h;
  out_.resume_max_s = std::max(out_.resume_max_s.value_or(0.0), resume_s_);
  if (!tracked) return;
  ++out_.resumed;
  resume_s_ = -1.0;
}

bool TrackingAudit::is_free(const scene::Goal& goal, const geometry::SE3& target,
                            const Eigen::VectorXd& q, control::WorldView& judge) {
  q_ = q;
  if (!solve(goal, target) || !is_clear(q_, judge, free_by_m, free_of_self_m)) return false;
  const double length = (q_ - q).lpNorm<Eigen::Infinity>();
  const int pieces = 1 + static_cast<int>(length / way_step);
  for (int i = 1; i < pieces; ++i) {
    between_ = q + static_cast<double>(i) / pieces * (q_ - q);
    if (!is_clear(between_, judge, way_by_m, way_by_m)) return false;
  }
  return true;
}

bool TrackingAudit::is_clear(const Eigen::VectorXd& q, control::WorldView& judge, double by_m,
                             double from_self_by_m) {
  std::array<scene::Contact, 1> contact;
  if (judge.has_obstacles() && judge.closest(q, by_m, contact) > 0) return false;
  std::array<scene::SelfContact, 1> pair;
  return !judge.has_self() || judge.closest_self(q, from_self_by_m, pair) == 0;
}

// docs/theory.md (16.12)
bool TrackingAudit::solve(const scene::Goal& goal, const geometry::SE3& target) {
  using geometry::Vector6d;
  for (int i = 0; i < ik_iterations; ++i) {
    dynamics::forward_kinematics(model_, ws_, q_);
    const geometry::SE3 tip = dynamics::tip_pose(model_, ws_);
    Vector6d error = Vector6d::Zero();
    error.tail<3>() = target.p() - tip.p();
    if (!goal.position_only)
      error.head<3>() = geometry::SO3(target.R() * tip.R().transpose()).log();
    if (error.tail<3>().norm() < ik_tolerance * goal.tolerance_m &&
        error.head<3>().norm() < ik_tolerance * goal.tolerance_rad)
      return true;
    error.head<3>() *= ik_length;
    dynamics::frame_jacobian(model_, ws_, model_.robot().tip.link, tip.p(), J_);
    J_.topRows<3>() *= goal.position_only ? 0.0 : ik_length;
    inverse_.factor(J_, ik_damping);
    inverse_.apply(J_, error, step_);
    const double size = step_.norm();
    if (size > ik_step_max) step_ *= ik_step_max / size;
    q_ += step_;
    if (limits_.q_lower.size() > 0) q_ = q_.cwiseMax(limits_.q_lower).cwiseMin(limits_.q_upper);
  }
  return false;
}

std::optional<log::Result::Following> TrackingAudit::figures() const {
  if (!observed_) return std::nullopt;
  log::Result::Following out = out_;
  out.all = all_.errors();
  out.free = while_free_.errors();
  return out;
}

}  // namespace hamelin::simulation
