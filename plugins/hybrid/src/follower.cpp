#include "follower.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "hamelin/reactive/approach_speed.hpp"

namespace hamelin::hybrid {

using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// The length ℓ [m] that makes a rotation by one radian comparable with a displacement.
constexpr double turn_length = 0.25;
// Singular values below the first are damped, with the second at zero [m/rad].
constexpr double singular_below = 0.08, damping_at_zero = 0.05;
// Eigenvalues of J Jᵀ below this belong to directions that are not part of the task.
constexpr double not_a_direction = 1e-14;
constexpr double comfort_gain = 0.5;  // towards the comfortable posture [1/s]
constexpr int fixed_at_most = 3;      // joints that others replace at a limit
// Desired motions below this are not compared with what took place [m/s]; time constant of the
// comparison; and the least share of the pull that is left to an arm that is held back.
constexpr double least_desired = 0.01, progress_time_s = 0.1, least_pull = 0.2;
// The metric in which u is changed near obstacles: weight of joint velocities beside the tip's.
constexpr double joint_weight = 0.02;
constexpr int clear_passes = 20;
constexpr double row_square = 0.05;  // least |a|² by which a repulsion is divided
// A target that has gone so far has left its place.
constexpr double left_m = 0.05, left_rad = 0.3;

// A correction with the gain, at most `fastest`.
Vector3d bounded(const Vector3d& error, double gain, double fastest) {
  const double size = error.norm();
  return size > 0.0 ? Vector3d(error * std::min(gain, fastest / size)) : Vector3d::Zero();
}

}  // namespace

Follower::Follower(const planning::Setup& setup, const model::Model& model)
    : model_(model),
      comfortable_(VectorXd::Zero(model.dof())),
      J_(6, model.dof()),
      preferred_(VectorXd::Zero(model.dof())),
      fixed_(preferred_),
      is_fixed_(static_cast<std::size_t>(model.dof())),
      filter_(model.dof(), Obstacles::max_points),
      identity_(Eigen::MatrixXd::Identity(model.dof(), model.dof())) {
  metric_ = inverse_metric_ = identity_;
  llt_.compute(metric_);  // allocates its memory

  const auto lower = setup.q_lower(), upper = setup.q_upper();
  limited_ = lower && upper && lower->allFinite() && upper->allFinite();
  if (limited_) comfortable_ = 0.5 * (*lower + *upper);
}

void Follower::start(const VectorXd& q) noexcept {
  if (!limited_) comfortable_ = q;
  restart();
}

// docs/theory.md (16.5)
void Follower::observe(const dynamics::Workspace& ws, const VectorXd& v, double period_s) {
  const double square = desired_.squaredNorm();
  double share = 1.0;
  if (square > least_desired * least_desired) {
    place_jacobian(ws, rotates_);
    const Vector6d motion = J_ * v;
    share = std::clamp(motion.dot(desired_) / square, 0.0, 1.0);
  }
  progress_ += (1.0 - std::exp(-period_s / progress_time_s)) * (share - progress_);
}

void Follower::velocity(const dynamics::Workspace& ws, const VectorXd& q, const hamelin_goal& goal,
                        std::span<const NearPoint> points, double lag_s, const VectorXd& lower,
                        const VectorXd& upper, VectorXd& u) {
  rotates_ = rotates(goal);
  desire(ws, goal, lag_s);
  remaining_ = desired_;
  place_jacobian(ws, rotates_);
  metric_ = joint_weight * identity_;
  metric_.noalias() += J_.transpose() * J_;
  prefer(q, points);
  std::fill(is_fixed_.begin(), is_fixed_.end(), false);
  fixed_.setZero();
  // docs/theory.md (16.9), (16.10)
  for (int i = 0; i <= fixed_at_most; ++i) {
    decompose(rotates_);
    resolve(remaining_ - J_ * preferred_, u);
    u += preferred_;
    const double speed = u.norm();
    if (speed > params_.joint_speed) u *= params_.joint_speed / speed;
    if (!fix_worst(lower, upper, u)) break;
  }
  u += fixed_;
}

// docs/theory.md (16.4)
void Follower::desire(const dynamics::Workspace& ws, const hamelin_goal& goal, double lag_s) {
  const TipError error = tip_error(model_, ws, goal);
  using planning::vec3;
  desired_.tail<3>() =
      vec3(goal.velocity_world_m_s) + lag_s * vec3(goal.acceleration_world_m_s2) +
      bounded(error.position, params_.gain, params_.tip_speed * std::max(least_pull, progress_));
  desired_.head<3>().setZero();
  if (!rotates(goal)) return;
  desired_.head<3>() = turn_length * (vec3(goal.angular_velocity_world_rad_s) +
                                      lag_s * vec3(goal.angular_acceleration_world_rad_s2) +
                                      bounded(error.rotation, params_.gain, params_.tip_turn));
}

// docs/theory.md (16.5)
void Follower::place_jacobian(const dynamics::Workspace& ws, bool rotates) {
  dynamics::frame_jacobian(model_, ws, model_.robot().tip.link, dynamics::tip_pose(model_, ws).p(),
                           J_);
  if (rotates)
    J_.topRows<3>() *= turn_length;
  else
    J_.topRows<3>().setZero();
}

// docs/theory.md (16.6), (16.7)
void Follower::decompose(bool rotates) {
  const Matrix6d G = J_ * J_.transpose();
  modes_.compute(G);
  smallest_ = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 6; ++i) {
    const double square = std::max(0.0, modes_.eigenvalues()[i]);
    if (rotates || i >= 3) smallest_ = std::min(smallest_, std::sqrt(square));
    const double near = std::max(0.0, 1.0 - square / (singular_below * singular_below)),
                 damping = damping_at_zero * near;
    inverse_[i] = square > not_a_direction ? 1.0 / (square + damping * damping) : 0.0;
  }
}

void Follower::resolve(const Vector6d& tip_motion, VectorXd& u) const {
  const Vector6d along = modes_.eigenvectors().transpose() * tip_motion;
  const Vector6d force = modes_.eigenvectors() * inverse_.cwiseProduct(along);
  u.noalias() = J_.transpose() * force;
}

// docs/theory.md (16.11)
void Follower::keep_clear(std::span<const NearPoint> points, double brake, double rate,
                          const VectorXd& lower, const VectorXd& upper, VectorXd& u) {
  if (points.empty()) return;
  llt_.compute(metric_);
  inverse_metric_ = identity_;
  llt_.solveInPlace(inverse_metric_);
  filter_.begin(metric_, inverse_metric_);
  constexpr double no_floor = -1e9;
  for (const auto& point : points)
    (void)filter_.add_row(
        point.row,
        point.obstacle_speed - approach_speed(point.distance - point.margin, brake, rate),
        no_floor);
  filter_.set_box(lower, upper);
  (void)filter_.project(u, clear_passes);
}

// docs/theory.md (16.8)
void Follower::prefer(const VectorXd& q, std::span<const NearPoint> points) {
  preferred_ = comfort_gain * (comfortable_ - q);
  for (const auto& point : points) {
    const double h = std::max(point.distance - point.margin, 0.0);
    if (h >= params_.repulsion_range) continue;
    preferred_ += (params_.repulsion_speed * (1.0 - h / params_.repulsion_range) /
                   std::max(row_square, point.row.squaredNorm())) *
                  point.row;
  }
}

// A fixed joint has no column in the Jacobian any more, so that the others do its part.
bool Follower::fix_worst(const VectorXd& lower, const VectorXd& upper, const VectorXd& u) {
  Eigen::Index worst = -1;
  double most = 1e-9;
  for (Eigen::Index k = 0; k < u.size(); ++k) {
    const double beyond = std::max(lower[k] - u[k], u[k] - upper[k]);
    if (is_fixed_[static_cast<std::size_t>(k)] || beyond <= most) continue;
    most = beyond;
    worst = k;
  }
  if (worst < 0) return false;
  is_fixed_[static_cast<std::size_t>(worst)] = true;
  fixed_[worst] = std::clamp(u[worst], lower[worst], upper[worst]);
  remaining_ -= fixed_[worst] * J_.col(worst);
  J_.col(worst).setZero();
  preferred_[worst] = 0.0;
  return true;
}

void TargetAnchor::set(const hamelin_goal& target) noexcept {
  goal_ = target;
  goal_.type = rotates(target) ? HAMELIN_GOAL_POSE : HAMELIN_GOAL_POSITION;
  searches = 0;
}

bool TargetAnchor::left_by(const hamelin_goal& target) const noexcept {
  const Vector3d moved =
      planning::vec3(target.position_world_m) - planning::vec3(goal_.position_world_m);
  if (moved.norm() > left_m) return true;
  if (!rotates(target)) return false;
  const Eigen::Map<const Eigen::Vector4d> now(target.quaternion_wxyz),
      before(goal_.quaternion_wxyz);
  return std::abs(now.dot(before)) < std::cos(0.5 * left_rad);
}

}  // namespace hamelin::hybrid
