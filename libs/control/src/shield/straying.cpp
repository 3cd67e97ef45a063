#include "shield/straying.hpp"

#include <algorithm>
#include <cmath>

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// The deviation from a stop's motion grows with the square of the step from here on [s].
constexpr double usual_step_s = 0.001;
// By how much a joint strays at most from a stop's motion if an unexplained acceleration stays
// within ±d, in units of d/ω²: docs/theory.md (14.18). Of a feedback with an estimate of the
// disturbance, where the period and the delay act in units of 1/ω; and of one with an integral.
constexpr double gain_estimate = 0.33, gain_period = 0.45, gain_delay = 1.4, gain_delay2 = 0.85;
constexpr double gain_integral = 0.55, gain_integral_period = 0.6;
// The share of a torque that does not change when a stop begins: it is a step where it is unknown
// at first, but does not reverse.
constexpr double of_standing = 0.5;
// The same while torques change as fast as they may, in units of the square of that time.
constexpr double ramp_compliance = 0.1;
// How long torques take to change for a stop, where their rate is bounded [s].
constexpr double usual_ramp_s = 0.05;
// Deviations at other postures than the given one may be larger by this factor.
constexpr double other_postures = 2.0;
// An arm at rest is disturbed, too: it counts as a stop of this length [s].
constexpr double hold_time_s = 0.007;
// The error of a velocity per unexplained acceleration: as a share of the time until a torque acts,
// of the estimator's time constant, and of the time in which torques change; docs/theory.md
// (14.22).
constexpr double late_share = 0.5, estimator_share = 0.05, ramp_share_of_speed = 0.4;
// The drift from a stop's motion per change of velocity, as a share of the period, where velocities
// are measured: differences of positions lag by half a period; docs/theory.md (14.17).
constexpr double lag_share = 0.25;
// Longer than any disturbance acts before feedback answers it [s].
constexpr double long_s = 1.0;
// On a shorter line, torques and masses change so little that its beginning suffices [rad or m];
// and by how much they may rise between the points of a line at which they are examined.
constexpr double short_line = 0.02, between_examined = 1.1;
// Noise is covered up to so many standard deviations.
constexpr double noise_deviations = 4.0;

double gain_of_feedback(const scene::Scene& scene, double period_s, double feedback_rate) {
  const double period = feedback_rate * period_s, delay = feedback_rate * scene.actuation.delay_s;
  if (scene.actuation.type == scene::ActuationType::ideal)
    return gain_integral + gain_integral_period * period;
  return gain_estimate + gain_period * period + delay * (gain_delay + gain_delay2 * delay);
}

}  // namespace

VectorXd unknown_friction(const scene::Scene& scene, const model::Robot& robot) {
  VectorXd out = joint_limits(robot, &model::Joint::effort_max, 0.0);
  out *= scene.safety.friction_share;
  return out;
}

void Straying::Bounds::include(const Bounds& others) {
  tracking = tracking.cwiseMax(others.tracking);
  errors = errors.cwiseMax(others.errors);
  shapes = shapes.cwiseMax(others.shapes);
}

Straying::Straying(const scene::Scene& scene, const model::Model& model,
                   const scene::Levers& levers, double period_s, double feedback_rate,
                   double torque_rate)
    : model_(model),
      levers_(levers),
      period_s_(period_s),
      feedback_rate_(feedback_rate),
      limits_rate_(torque_rate > 0.0),
      mass_error_(scene.safety.mass_error),
      noise_(noise_deviations * scene::safety_bounds(scene).joint_noise_rad),
      ws_(model) {
  const Index n = model.dof();
  const double coarse = std::max(1.0, period_s / usual_step_s);
  stated_ = VectorXd::Constant(n, scene::safety_bounds(scene).tracking_rad * coarse * coarse);
  compliance_s2_ =
      gain_of_feedback(scene, period_s, feedback_rate) / (feedback_rate * feedback_rate);
  estimate_s2_ = scene.actuation.estimates_velocity
                     ? 1.0 / (std::exp(1.0) * feedback_rate * scene.actuation.estimator_bandwidth)
                     : 0.0;
  velocity_error_s_ = late_share * (period_s + scene.actuation.delay_s);
  if (scene.actuation.estimates_velocity)
    velocity_error_s_ += estimator_share / scene.actuation.estimator_bandwidth;
  if (scene.actuation.type == scene::ActuationType::sampled) lag_s_ = lag_share * period_s;
  friction_ = unknown_friction(scene, model.robot());
  if (has_model_errors() || noise_ > 0.0)
    bounds_.shapes = VectorXd::Zero(static_cast<Index>(model.shapes().size()));
  bounds_.tracking = bounds_.errors = torque_ = bias_ = q_ = velocity_ = acceleration_ =
      VectorXd::Zero(n);
  before_ = bounds_;
  response_ = jacobian_ = dynamics::Matrix6Xd::Zero(6, n);
  mass_ = mass_inverse_ = Eigen::MatrixXd::Identity(n, n);
  factors_.compute(mass_);  // allocates its memory
}

// Masses and torques change along the line, so that its beginning, middle and end count.
void Straying::bound(const StopMotion& stop) {
  const VectorXd& w = stop.line_velocity();
  acceleration_ = stop.braking().rate * w;
  begin(w, acceleration_);
  if (has_model_errors()) {
    const double duration_s = stop.duration_s(), ramp_s = stop.braking().ramp_s;
    include_model_errors({stop.line_start(), w, acceleration_, duration_s, ramp_s});
    if ((stop.end() - stop.line_start()).lpNorm<Eigen::Infinity>() > short_line) {
      for (const double share : {0.5, 1.0}) {
        q_ = stop.line_start() + share * (stop.end() - stop.line_start());
        velocity_ = std::sqrt(1.0 - share) * w;
        include_model_errors({q_, velocity_, acceleration_, duration_s, ramp_s});
      }
    }
    bounds_.errors *= between_examined;
    bounds_.shapes *= between_examined;
  }
  if (noise_ > 0.0) add_noise();
}

// At five places of the stop, the largest velocity and acceleration of each joint.
void Straying::bound(const PathStop& stop) {
  constexpr int places = 5;
  torque_.setZero();  // the largest velocities
  bias_.setZero();    // and accelerations
  for (int k = 0; k < places; ++k) {
    stop.path_at(stop.braking_s() * static_cast<double>(k) / places, q_, velocity_, acceleration_);
    torque_ = torque_.cwiseMax(velocity_.cwiseAbs());
    bias_ = bias_.cwiseMax(acceleration_.cwiseAbs());
  }
  bias_ *= between_examined;
  // a velocity that lags by half a period acts like a disturbance: docs/theory.md (14.36)
  const double lag_s2 = lag_s_ > 0.0 ? period_s_ / feedback_rate_ : 0.0;
  velocity_ = (lag_s_ * torque_).cwiseMin(lag_s2 * bias_);
  torque_.setZero();
  begin(torque_, bias_);
  bounds_.tracking += velocity_;
  bounds_.tracking += stop.widest();
  if (has_model_errors()) {
    for (const double share : {0.0, 0.5, 0.9}) {
      stop.path_at(share * stop.braking_s(), q_, velocity_, acceleration_);
      include_model_errors({q_, velocity_, acceleration_, stop.duration_s(), stop.ramp_s()});
    }
    bounds_.errors *= between_examined;
    bounds_.shapes *= between_examined;
  }
  if (noise_ > 0.0) add_noise();
}

void Straying::bound_at_rest(const VectorXd& q) {
  velocity_.setZero();
  begin(velocity_, velocity_);
  if (has_model_errors()) include_model_errors({q, velocity_, velocity_, long_s, usual_ramp_s});
  if (noise_ > 0.0) add_noise();
}

void Straying::include_move(const FailSafe& motion) {
  before_ = bounds_;
  const double time_s = motion.move_s();
  velocity_ = FailSafe::peak_velocity / time_s * motion.way();
  acceleration_ = FailSafe::peak_acceleration / (time_s * time_s) * motion.way();
  begin(velocity_, acceleration_);
  if (has_model_errors()) {
    for (const double share : {0.0, 0.5, 1.0}) {
      q_ = motion.stop_end() + share * motion.way();
      include_model_errors({q_, velocity_, acceleration_, time_s, 0.0});
    }
    bounds_.errors *= between_examined;
    bounds_.shapes *= between_examined;
  }
  if (noise_ > 0.0) add_noise();
  bounds_.include(before_);
}

// docs/theory.md (14.17)
void Straying::begin(const VectorXd& velocity, const VectorXd& acceleration) {
  bounds_.tracking = stated_ + lag_s_ * velocity.cwiseAbs() +
                     0.25 * period_s_ * period_s_ * acceleration.cwiseAbs();
  bounds_.errors.setZero();
  bounds_.shapes.setZero();
}

// docs/theory.md (14.19)
void Straying::include_model_errors(const Effort& effort) {
  const double time_s = effort.duration_s + hold_time_s;
  const double ramp = limits_rate_ ? effort.ramp_s : 0.0;
  const double compliance =
      std::min(compliance_s2_ + estimate_s2_ + ramp_compliance * ramp * ramp, time_s * time_s);
  invert_mass(effort.q);
  torque_.noalias() = mass_ * effort.acceleration;
  dynamics::bias_torque(model_, ws_, effort.q, effort.velocity, bias_);
  torque_ = mass_error_ * (torque_.cwiseAbs() + of_standing * bias_.cwiseAbs()) + friction_;
  include_shapes(effort.q, compliance);
  for (Index j = 0; j < torque_.size(); ++j)
    bounds_.errors[j] =
        std::max(bounds_.errors[j], compliance * mass_inverse_.col(j).cwiseAbs().dot(torque_));
}

// Errors of different joints are independent: docs/theory.md (14.21).
void Straying::add_noise() {
  bounds_.shapes += noise_ * levers_.shapes().rowwise().norm();
  bounds_.errors.array() += 2.0 * noise_;  // at both ends of a stop
}

void Straying::invert_mass(const VectorXd& q) {
  dynamics::mass_matrix(model_, ws_, q, mass_);
  factors_.compute(mass_);
  mass_inverse_.setIdentity();
  factors_.solveInPlace(mass_inverse_);
}

// The response of a point to all torques together is far less than the sum of what each joint would
// do alone: docs/theory.md (14.20).
void Straying::include_shapes(const VectorXd& q, double compliance_s2) {
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
    double& bound = bounds_.shapes[static_cast<Index>(i)];
    bound = std::max(
        bound, compliance_s2 * (moving + turning * (shape.center.norm() + shape.half_axis.norm())));
  }
}

Straying::AtRest Straying::at_rest(const VectorXd& q) {
  AtRest bound{VectorXd::Constant(q.size(), noise_) + stated_, VectorXd::Zero(q.size())};
  if (!has_model_errors()) return bound;
  invert_mass(q);
  dynamics::gravity_torque(model_, ws_, q, bias_);
  const double ramp = limits_rate_ ? usual_ramp_s : 0.0;
  const double compliance = compliance_s2_ + estimate_s2_ + ramp_compliance * ramp * ramp,
               speed_s = velocity_error_s_ + ramp_share_of_speed * ramp;
  torque_ = of_standing * mass_error_ * bias_.cwiseAbs() + friction_;
  bias_ = mass_error_ * bias_.cwiseAbs() + friction_;
  for (Index j = 0; j < torque_.size(); ++j) {
    const auto response = mass_inverse_.col(j).cwiseAbs();
    bound.position[j] += other_postures * compliance * response.dot(torque_);
    bound.velocity[j] = speed_s * response.dot(bias_);
  }
  return bound;
}

}  // namespace hamelin::control
