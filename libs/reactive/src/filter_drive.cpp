#include "hamelin/reactive/filter_drive.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "hamelin/reactive/approach_speed.hpp"

namespace hamelin::reactive {

namespace {

using Eigen::VectorXd;

constexpr double row_brake_share = 0.6;      // of the braking room that one row counts on
constexpr double row_brake_least = 0.3;      // braking that every row counts on [m/s²]
constexpr double momentum_box_share = 0.98;  // of the torque limits
// A joint beyond its limit goes back at this rate [1/s].
constexpr double limit_leaving_rate = 8.0;
constexpr int rows_max = 4 * Obstacles::max_points;

}  // namespace

FilterDrive::FilterDrive(const planning::Setup& setup, const model::Model& model, double radius_m,
                         double horizon_s)
    : setup_(setup),
      model_(model),
      ws_(model),
      radius_(radius_m),
      horizon_s_(setup.control_period_s()),
      inertia_(setup.dof()),
      obstacles_(setup, radius_m),
      filter_(setup.dof(), rows_max),
      disturbance_(setup.dof()) {
  if (setup.sampled()) {
    const double period = setup.control_period_s();
    horizon_s_ = std::max(period, horizon_s);
    if (const auto rate = setup.effort_rate_max()) ramp_.emplace(*rate, period, setup.delay_s());
  }
  const int n = setup.dof();
  for (auto* x : {&q_, &v_, &w_, &x_, &bias_, &lower_, &upper_, &scratch_, &torque_, &last_torque_})
    *x = VectorXd::Zero(n);
}

void FilterDrive::update(const planning::Tick& tick) {
  q_ = tick.q();
  v_ = tick.v();
  inertia_.update(model_, ws_, q_);
  dynamics::bias_torque(model_, ws_, q_, v_, bias_);
  last_torque_ = tick.torque() ? *tick.torque() : planning::ConstVectorMap(bias_.data(), q_.size());
  disturbance_.take(tick, setup_, inertia_.M());
  w_ = v_;
  if (ramp_) {
    scratch_ = bias_ - disturbance_.torque;
    ramp_->update(last_torque_, scratch_, inertia_.W(), v_);
    w_ = ramp_->coasting_velocity();
  }
  dynamics::forward_kinematics(model_, ws_, q_);
  obstacles_.update(model_, ws_, tick.contacts(), tick.self_contacts());
}

void FilterDrive::begin_boxes(const Pace& pace) {
  filter_.begin(inertia_.M(), inertia_.W());
  set_joint_box(pace);
  set_momentum_box();
}

void FilterDrive::set_joint_box(const Pace& pace) {
  const double dt = horizon_s_;
  const auto velocity_max = setup_.velocity_max();
  if (velocity_max) {
    double excess = 1.0;
    for (int k = 0; k < setup_.dof(); ++k)
      excess = std::max(excess, std::abs(x_[k]) / (*velocity_max)[k]);
    x_ /= excess;
  }
  for (int k = 0; k < setup_.dof(); ++k) {
    const auto [low, high] = joint_bounds(k, pace);
    // The acceleration bound goes last, docs/theory.md (10.12): a limit that cannot be kept is
    // approached with the hardest braking.
    const double slowest = w_[k] - dt * pace.acceleration, fastest = w_[k] + dt * pace.acceleration;
    lower_[k] = std::clamp(low, slowest, fastest);
    upper_[k] = std::clamp(high, slowest, fastest);
    if (lower_[k] > upper_[k])
      lower_[k] = upper_[k] = std::clamp(0.5 * (low + high), slowest, fastest);
  }
  filter_.set_box(lower_, upper_);
}

std::pair<double, double> FilterDrive::joint_bounds(int k, const Pace& pace) const {
  const auto velocity_max = setup_.velocity_max(), q_lower = setup_.q_lower(),
             q_upper = setup_.q_upper();
  double low = -std::numeric_limits<double>::infinity(), high = -low;
  if (velocity_max) low = -(*velocity_max)[k], high = (*velocity_max)[k];
  if (q_lower) low = std::max(low, joint_approach(k, (*q_lower)[k] - q_[k], -1.0, pace));
  if (q_upper) high = std::min(high, joint_approach(k, (*q_upper)[k] - q_[k], 1.0, pace));
  return {low, high};
}

// The velocity bound at a joint limit at the signed distance `offset` in the direction `side` (±1):
// φ of docs/theory.md (10.10).
double FilterDrive::joint_approach(int k, double offset, double side, const Pace& pace) const {
  const double x = side * offset;
  if (!std::isfinite(x)) return side * std::numeric_limits<double>::infinity();
  if (x <= 0.0) return side * limit_leaving_rate * x;
  if (!ramp_) return side * approach_speed(x, pace.joint_brake, pace.joint_rate);
  return side * approach_speed(x, pace.joint_brake, pace.joint_rate,
                               ramp_->loss_of_joint(k, side, inertia_.W(), pace.joint_brake));
}

// Momenta within the torque limits, docs/theory.md (10.13). The bias torque is held at x, not at w;
// the share covers the difference.
void FilterDrive::set_momentum_box() {
  const auto effort = setup_.effort_max();
  if (!effort) return;
  torque_.noalias() = inertia_.M() * w_;
  scratch_ = bias_ - disturbance_.torque;
  lower_ = torque_ + horizon_s_ * (-momentum_box_share * *effort - scratch_);
  upper_ = torque_ + horizon_s_ * (momentum_box_share * *effort - scratch_);
  filter_.set_momentum_box(lower_, upper_);
}

void FilterDrive::add_point(const NearPoint& point, const Pace& pace, double softness) {
  const double dt = horizon_s_, x = point.distance - point.margin;
  double bound = point.obstacle_speed - approach_speed(x, pace.brake, pace.rate);
  const double present = point.row.dot(w_);
  // Near its limit a row demands no more braking than the boxes surely allow.
  if (ramp_ || present - row_brake_least * dt <
                   point.obstacle_speed - approach_speed(x, row_brake_least, pace.rate)) {
    const double room = filter_.braking_room(point.row, w_);
    const double brake = std::clamp(row_brake_share * room / dt, row_brake_least, pace.brake);
    const double speed =
        ramp_ ? approach_speed(x, brake, pace.rate, ramp_->loss(point.row, inertia_.W(), brake))
              : approach_speed(x, brake, pace.rate);
    bound = std::min(point.obstacle_speed - speed, present + room);
  }
  const double floor =
      point.obstacle_speed - pace.rate * std::max(1e-9, point.distance - 0.5 * point.margin);
  (void)filter_.add_row(point.row, bound, floor, softness);
}

// As a joint is kept from its limits. Where that cannot be, the arm moves on: obstacles count more.
void FilterDrive::add_kept(const planning::Kept& kept, const Pace& pace) {
  constexpr double never = -1e9;
  for (Eigen::Index i = 0; i < kept.slack.size(); ++i) {
    const double x = kept.slack[i];
    scratch_ = kept.gradient.col(i);
    if (scratch_.isZero(0.0)) continue;
    const double bound = x > 0.0 ? -approach_speed(x, pace.joint_brake, pace.joint_rate)
                                 : -limit_leaving_rate * x,
                 present = scratch_.dot(w_), room = filter_.braking_room(scratch_, w_);
    (void)filter_.add_row(scratch_, std::min(bound, present + room), never);
  }
}

void FilterDrive::apply(planning::Command& command) {
  project(command);
  if (setup_.sampled())
    answer_by_torque(command);
  else
    answer_by_velocity(command);
}

// Books the work of the filter, docs/theory.md (10.16), (10.17).
void FilterDrive::project(planning::Command& command) {
  scratch_ = x_;
  const auto report = filter_.project(x_, filter_passes_);
  held_back_ = (x_ - scratch_).norm() > 1e-3 * horizon_s_ || obstacles_.clearance() < radius_;
  const double share = setup_.control_period_s() / horizon_s_;
  command.set_accounts(share * (report.energy_after_J - report.energy_before_J - report.recovery_J),
                       share * report.recovery_J);
}

// The node's velocity and the bias torque that keeps it through the step: docs/theory.md (10.21).
void FilterDrive::answer_by_velocity(planning::Command& command) {
  command.node_velocity() = x_;
  dynamics::bias_torque(model_, ws_, q_, x_, bias_);
  command.held_torque() = bias_;
}

// The torque that leads to x over the horizon, by the nominal model and what it does not explain:
// docs/theory.md (10.22).
void FilterDrive::answer_by_torque(planning::Command& command) {
  scratch_ = (x_ - w_) / horizon_s_ - disturbance_.acceleration;
  torque_.noalias() = inertia_.M() * scratch_;
  torque_ += bias_;
  if (const auto effort = setup_.effort_max())
    torque_ = torque_.cwiseMin(*effort).cwiseMax(-*effort);
  if (ramp_) ramp_->limit(torque_, last_torque_);
  command.held_torque() = torque_;
}

}  // namespace hamelin::reactive
