#include "hamelin/control/straying.hpp"

#include <algorithm>
#include <cmath>

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// The deviation from a stop's motion grows with the square of the step from here on [s].
constexpr double usual_step_s = 0.001;
// By how much a joint strays per unexplained acceleration, in units of 1/ω²: the feedback of a stop
// and the estimate of the disturbance together, docs/theory.md (14.18).
constexpr double stop_compliance = 0.3;
// The same while torques change as fast as they may, in units of the square of that time.
constexpr double ramp_compliance = 0.1;
// How long torques take to change for a stop, where their rate is bounded [s].
constexpr double usual_ramp_s = 0.05;
// Deviations at other postures than the given one may be larger by this factor.
constexpr double other_postures = 2.0;
// An arm at rest is disturbed, too: it counts as a stop of this length [s].
constexpr double hold_time_s = 0.01;
// The error of a velocity per unexplained acceleration: as a share of the time until a torque acts,
// of the estimator's time constant, and of the time in which torques change; docs/theory.md
// (14.22).
constexpr double late_share = 0.5, estimator_share = 0.05, ramp_share_of_speed = 0.4;
// Longer than any disturbance acts before feedback answers it [s].
constexpr double long_s = 1.0;
// Noise is covered up to so many standard deviations.
constexpr double noise_deviations = 4.0;

}  // namespace

Straying::Straying(const scene::Scene& scene, const model::Model& model, const Levers& levers,
                   double period_s, double feedback_rate, double torque_rate)
    : model_(model),
      levers_(levers),
      period_s_(period_s),
      limits_rate_(torque_rate > 0.0),
      mass_error_(scene.safety.mass_error),
      noise_(noise_deviations * scene.safety.joint_noise_rad),
      ws_(model) {
  const Index n = model.dof();
  const double coarse = std::max(1.0, period_s / usual_step_s);
  stated_ = VectorXd::Constant(n, scene.safety.tracking_rad * coarse * coarse);
  compliance_s2_ = stop_compliance / (feedback_rate * feedback_rate);
  if (scene.actuation.estimates_velocity)
    compliance_s2_ += 1.0 / (std::exp(1.0) * feedback_rate * scene.actuation.estimator_bandwidth);
  velocity_error_s_ = late_share * (period_s + scene.actuation.delay_s);
  if (scene.actuation.estimates_velocity)
    velocity_error_s_ += estimator_share / scene.actuation.estimator_bandwidth;
  friction_ = VectorXd::Zero(n);
  if (scene.safety.friction_share > 0.0)
    friction_ =
        scene.safety.friction_share * joint_limits(model.robot(), &model::Joint::effort_max, 0.0);
  if (has_model_errors() || noise_ > 0.0)
    shapes_ = VectorXd::Zero(static_cast<Index>(model.shapes().size()));
  tracking_ = errors_ = torque_ = bias_ = velocity_ = acceleration_ = VectorXd::Zero(n);
  before_tracking_ = before_errors_ = tracking_;
  before_shapes_ = shapes_;
  response_ = jacobian_ = dynamics::Matrix6Xd::Zero(6, n);
  mass_ = mass_inverse_ = Eigen::MatrixXd::Identity(n, n);
  factors_.compute(mass_);  // allocates its memory
}

void Straying::bound(const StopMotion& stop) {
  acceleration_ = stop.braking().rate * stop.line_velocity();
  bound({stop.line_start(), stop.line_velocity(), acceleration_, stop.duration_s(),
         stop.braking().ramp_s});
}

void Straying::bound_at_rest(const VectorXd& q) {
  velocity_.setZero();
  bound({q, velocity_, velocity_, long_s, usual_ramp_s});
}

void Straying::include_move(const FailSafe& motion) {
  before_tracking_ = tracking_;
  before_errors_ = errors_;
  before_shapes_ = shapes_;
  const double time_s = motion.move_s();
  velocity_ = FailSafe::peak_velocity / time_s * motion.way();
  acceleration_ = FailSafe::peak_acceleration / (time_s * time_s) * motion.way();
  bound({motion.stop().end(), velocity_, acceleration_, time_s, 0.0});
  tracking_ = tracking_.cwiseMax(before_tracking_);
  errors_ = errors_.cwiseMax(before_errors_);
  shapes_ = shapes_.cwiseMax(before_shapes_);
}

// docs/theory.md (14.17)
void Straying::bound(const Effort& effort) {
  tracking_ = stated_ + 0.25 * period_s_ * period_s_ * effort.acceleration.cwiseAbs();
  errors_.setZero();
  shapes_.setZero();
  if (has_model_errors()) add_model_errors(effort);
  if (noise_ > 0.0) add_noise();
}

// docs/theory.md (14.19)
void Straying::add_model_errors(const Effort& effort) {
  const double time_s = effort.duration_s + hold_time_s;
  const double ramp = limits_rate_ ? effort.ramp_s : 0.0;
  const double compliance =
      std::min(compliance_s2_ + ramp_compliance * ramp * ramp, 0.5 * time_s * time_s);
  invert_mass(effort.q);
  torque_.noalias() = mass_ * effort.acceleration;
  dynamics::bias_torque(model_, ws_, effort.q, effort.velocity, bias_);
  torque_ = mass_error_ * (torque_.cwiseAbs() + bias_.cwiseAbs()) + friction_;
  bound_shapes(effort.q, compliance);
  for (Index j = 0; j < torque_.size(); ++j)
    errors_[j] = compliance * mass_inverse_.col(j).cwiseAbs().dot(torque_);
}

// Errors of different joints are independent: docs/theory.md (14.21).
void Straying::add_noise() {
  shapes_ += noise_ * levers_.shapes().rowwise().norm();
  errors_.array() += 2.0 * noise_;  // at both ends of a stop
}

void Straying::invert_mass(const VectorXd& q) {
  dynamics::mass_matrix(model_, ws_, q, mass_);
  factors_.compute(mass_);
  mass_inverse_.setIdentity();
  factors_.solveInPlace(mass_inverse_);
}

// The response of a point to all torques together is far less than the sum of what each joint would
// do alone: docs/theory.md (14.20).
void Straying::bound_shapes(const VectorXd& q, double compliance_s2) {
  dynamics::forward_kinematics(model_, ws_, q);
  int link = -1;
  double turning = 0.0, moving = 0.0;
  for (std::size_t i = 0; i < model_.shapes().size(); ++i) {
    const auto& shape = model_.shapes()[i];
    if (shape.link != link) {
      link = shape.link;
      dynamics::frame_jacobian(model_, ws_, link, dynamics::link_pose(model_, ws_, link).p(),
                               jacobian_);
      response_.noalias() = jacobian_ * mass_inverse_;
      turning = response_.topRows<3>().colwise().norm().dot(torque_);
      moving = response_.bottomRows<3>().colwise().norm().dot(torque_);
    }
    shapes_[static_cast<Index>(i)] =
        compliance_s2 * (moving + turning * (shape.center.norm() + shape.half_axis.norm()));
  }
}

Straying::AtRest Straying::at_rest(const VectorXd& q) {
  AtRest bound{VectorXd::Constant(q.size(), noise_) + stated_, VectorXd::Zero(q.size())};
  if (!has_model_errors()) return bound;
  invert_mass(q);
  dynamics::gravity_torque(model_, ws_, q, bias_);
  torque_ = mass_error_ * bias_.cwiseAbs() + friction_;
  const double ramp = limits_rate_ ? usual_ramp_s : 0.0;
  const double compliance = compliance_s2_ + ramp_compliance * ramp * ramp;
  for (Index j = 0; j < torque_.size(); ++j) {
    const double acceleration = mass_inverse_.col(j).cwiseAbs().dot(torque_);
    bound.position[j] += other_postures * compliance * acceleration;
    bound.velocity[j] = (velocity_error_s_ + ramp_share_of_speed * ramp) * acceleration;
  }
  return bound;
}

}  // namespace hamelin::control
