#include "shield/fail_safe.hpp"

#include <algorithm>

namespace hamelin::control {

using Eigen::VectorXd;

FailSafe::FailSafe(Eigen::Index dof) : stop_(dof), path_stop_(dof) {
  way_ = target_ = VectorXd::Zero(dof);
}

void FailSafe::set_stop(const VectorXd& q, const VectorXd& v, const VectorXd& a,
                        const StopMotion::Braking& braking) {
  move_s_ = 0.0;
  along_path_ = false;
  stop_.set(q, v, a, braking);
}

void FailSafe::set_at_rest(const VectorXd& q) {
  move_s_ = 0.0;
  along_path_ = false;
  stop_.set_at_rest(q);
}

void FailSafe::set_path_stop(const CertifiedPath& path, const PathStop::Place& from,
                             const PathStop::Deviation& deviation, double braking,
                             const PathStop::Bounds& bounds) {
  move_s_ = 0.0;
  along_path_ = true;
  path_stop_.set(path, from, deviation, braking, bounds);
}

void FailSafe::set_move(const VectorXd& target, double duration_s) {
  target_ = target;
  way_ = target - stop_end();
  move_s_ = duration_s;
}

// docs/theory.md (14.24)
FailSafe::Profile FailSafe::profile(double share) {
  const double x = std::clamp(share, 0.0, 1.0), y = x * (1.0 - x);
  return {x * x * x * (10.0 + x * (6.0 * x - 15.0)), 30.0 * y * y, 60.0 * y * (1.0 - 2.0 * x)};
}

void FailSafe::at(double time_s, VectorXd& q, VectorXd& v) const {
  if (!moves() || time_s < stop_s()) {
    along_path_ ? path_stop_.at(time_s, q, v) : stop_.at(time_s, q, v);
  } else {
    const Profile at = profile((time_s - stop_s()) / move_s_);
    q = stop_end() + at.position * way_;
    v = at.velocity / move_s_ * way_;
  }
}

}  // namespace hamelin::control
