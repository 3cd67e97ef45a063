#include "hamelin/reactive/field_drive.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "hamelin/reactive/approach_speed.hpp"

namespace hamelin::reactive {

namespace {

using Eigen::Vector3d;

// Gain with which the velocity follows the attraction [1/s], and its largest joint acceleration
// [rad/s² or m/s²]. The difference from acceleration_max is a reserve for obstacles.
constexpr double velocity_gain = 20.0, drive_acceleration = 10.0, acceleration_max = 15.0;
// Distance from the goal below which repulsion fades.
constexpr double fade_distance = 0.5;
// Added to the mobility aᵀWa of a point, so that a row that hardly moves it is hardly used [1/kg].
constexpr double least_mobility = 0.01;
// Approaches are braked with this gain [1/s] to a speed from which this deceleration [m/s²] stops
// the arm this far from the obstacle [m]; near it the speed is proportional to the distance [1/s].
constexpr double brake_gain = 60.0, brake_deceleration = 3.0, brake_distance_m = 0.008,
                 brake_rate = 16.0;
// The repulsion of joint limits: [rad³/s² or m³/s²] and [rad or m].
constexpr Repulsion limit_repulsion{1e-3, 0.15, 0.03};
// The speed towards a joint limit is one from which this deceleration [rad/s² or m/s²] stops the
// joint at this distance from it [rad or m]; near it the speed is proportional to the distance
// [1/s].
constexpr double limit_deceleration = 7.5, limit_distance = 0.005, limit_rate = 8.0;
// Share of the velocity limits that is used, of the torque limits, and of these for turning.
constexpr double speed_share = 0.9, torque_share = 0.98, turning_share = 0.3;
// Motors that act late get the velocity bounds this much earlier, which also lowers the gain for
// noise [s].
constexpr double sampled_horizon_s = 0.01;

constexpr double infinity = std::numeric_limits<double>::infinity();

/// Scales x so that no component exceeds `most`.
void scale_to(double most, Eigen::VectorXd& x) {
  const double largest = x.cwiseAbs().maxCoeff();
  if (largest > most) x *= most / largest;
}

}  // namespace

FieldDrive::FieldDrive(const planning::Setup& setup, const FieldDriveParams& params)
    : setup_(setup),
      model_(setup.model()),
      ws_(model_),
      horizon_s_(setup.sampled() ? std::max(sampled_horizon_s, setup.control_period_s())
                                 : setup.control_period_s()),
      law_(setup, model_, {.cruise_speed = params.cruise_speed}),
      inertia_(setup.dof()),
      obstacles_(setup, contact_range_m(params.range_m)),
      disturbance_(setup.dof()) {
  const int n = setup.dof();
  for (auto* x : {&q_, &v_, &a_, &row_, &Wa_, &turning_, &turned_, &torque_})
    *x = Eigen::VectorXd::Zero(n);
  J_.setZero(3, n);
}

void FieldDrive::update(const planning::Tick& tick) {
  q_ = tick.q();
  v_ = tick.v();
  inertia_.update(model_, ws_, q_);
  dynamics::forward_kinematics(model_, ws_, q_);
  obstacles_.update(model_, ws_, tick.contacts(), tick.self_contacts());
  turning_.setZero();
  disturbance_.take(tick, setup_, inertia_.M());
  attract(tick);
}

// docs/theory.md (9.19), (9.20), (9.21)
void FieldDrive::attract(const planning::Tick& tick) {
  const Target target{&tick.goal()};
  goal_distance_ = law_.distance(model_, ws_, q_, target);
  goal_factor_ = std::min(1.0, std::pow(goal_distance_ / fade_distance, 2));
  at_goal_ = law_.within(model_, ws_, q_, tick.goal(), 1.0);
  law_.attract(model_, ws_, q_, target, a_);
  a_ = velocity_gain * (tick.speed_scale() * a_ - v_);
  scale_to(drive_acceleration, a_);
}

Vector3d FieldDrive::velocity(const NearPoint& point) const {
  return dynamics::point_velocity(model_, ws_, point.link, point.arm_point, v_);
}

Eigen::Matrix3d FieldDrive::inertia(const NearPoint& point) {
  dynamics::point_jacobian(model_, ws_, point.link, point.arm_point, J_);
  return dynamics::operational_inertia(model_, ws_, q_, J_);
}

void FieldDrive::push(const NearPoint& point, double f) {
  Wa_.noalias() = inertia_.W() * point.row;
  a_ += f / (point.row.dot(Wa_) + least_mobility) * Wa_;
}

void FieldDrive::brake(const NearPoint& point) {
  const double allowed =
      reactive::approach_speed(point.distance - brake_distance_m, brake_deceleration, brake_rate);
  const double excess = approach_speed(point) - std::max(0.0, allowed);
  if (excess > 0.0) push(point, brake_gain * excess);
}

void FieldDrive::turn(const NearPoint& point, const Vector3d& w, planning::Command& command) {
  command.add_gyroscopic(
      point.link, dynamics::link_pose(model_, ws_, point.link).inverse() * point.arm_point, w);
  dynamics::point_jacobian_transpose(model_, ws_, point.link, point.arm_point,
                                     w.cross(velocity(point)), row_);
  turning_ += row_;
}

void FieldDrive::pull(const NearPoint& point, const Vector3d& force) {
  dynamics::point_jacobian_transpose(model_, ws_, point.link, point.arm_point, force, row_);
  a_.noalias() += inertia_.W() * row_;
}

// docs/theory.md (9.24)
void FieldDrive::repel_joint_limits() {
  const auto add = [&](const std::optional<planning::ConstVectorMap>& limit, double side) {
    if (!limit) return;
    for (int k = 0; k < setup_.dof(); ++k) {
      const double offset = side * ((*limit)[k] - q_[k]);
      if (offset < limit_repulsion.rho0)
        a_[k] -= side * goal_factor_ * limit_repulsion.force(offset);
    }
  };
  add(setup_.q_lower(), -1.0);
  add(setup_.q_upper(), 1.0);
}

/// The largest speed towards a joint limit at this offset, docs/theory.md (9.25); negative where
/// the joint must leave the limit.
double FieldDrive::joint_room(double offset) const {
  if (!std::isfinite(offset)) return infinity;
  return reactive::approach_speed(offset - limit_distance, limit_deceleration, limit_rate);
}

// docs/theory.md (9.26), (9.27). The gyroscopic terms do no work, so that only the limits of the
// joints bound them.
void FieldDrive::bound_acceleration() {
  scale_to(acceleration_max, a_);
  turned_.noalias() = inertia_.W() * turning_;
  const auto lower = setup_.q_lower(), upper = setup_.q_upper(), fastest = setup_.velocity_max();
  for (int k = 0; k < setup_.dof(); ++k) {
    const double most = fastest ? speed_share * (*fastest)[k] : infinity;
    const double high = upper ? std::min(most, joint_room((*upper)[k] - q_[k])) : most,
                 low = lower ? std::max(-most, -joint_room(q_[k] - (*lower)[k])) : -most;
    const double least = (low - v_[k]) / horizon_s_ - turned_[k],
                 largest = (high - v_[k]) / horizon_s_ - turned_[k],
                 reserve = 2.0 * acceleration_max + std::abs(turned_[k]);
    a_[k] = std::clamp(std::min(std::max(a_[k], least), largest), -reserve, reserve);
  }
}

// docs/theory.md (9.29). The other torque is the reserve that keeps the limits of the joints.
void FieldDrive::bound_turning(planning::Command& command) {
  const auto effort = setup_.effort_max();
  if (!effort) return;
  const double excess = turning_.cwiseAbs().cwiseQuotient(turning_share * *effort).maxCoeff();
  if (excess <= 1.0) return;
  turning_ /= excess;
  for (std::size_t i = 0; i < command.gyroscopic_count(); ++i)
    planning::VectorMap(command.gyroscopic(i).w_world, 3) /= excess;
}

// docs/theory.md (9.28)
void FieldDrive::apply(planning::Command& command) {
  bound_turning(command);
  repel_joint_limits();
  bound_acceleration();
  row_ = a_ + turned_ - disturbance_.acceleration;
  dynamics::inverse_dynamics(model_, ws_, q_, v_, row_, torque_);
  if (const auto effort = setup_.effort_max())
    torque_ = torque_.cwiseMin(torque_share * *effort).cwiseMax(-torque_share * *effort);
  command.held_torque() = torque_ - turning_;
}

}  // namespace hamelin::reactive
