#include "hamelin/serve/keeper.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <exception>
#include <utility>

#include "hamelin/core/error.hpp"

namespace hamelin::serve {

using Eigen::VectorXd;

namespace {

// Copies what is not of zero size, as outputs that are not asked for are.
void copy(const VectorXd& from, double* to) {
  std::copy(from.begin(), from.end(), to);
}

}  // namespace

Keeper::Keeper(control::Controller& controller, int period_gap_max)
    : controller_(controller), gap_max_(period_gap_max) {
  const int dof = controller.model().dof();
  if (dof > HAMELIN_LINK_JOINTS)
    throw Error(ErrorCode::invalid,
                fmt::format("robot '{}': has {} joints, expected at most {}",
                            controller.model().robot().name, dof, int{HAMELIN_LINK_JOINTS}));
  q_ = v_ = VectorXd::Zero(dof);
}

void Keeper::begin_client() {
  sequence_ = 0;
  request_ = HAMELIN_REQUEST_NONE;
  counts_ = {};
  first_ = true;
}

bool Keeper::take(const hamelin_measurement& measurement) {
  if (measurement.checksum != hamelin_measurement_checksum(&measurement)) {
    ++counts_.damaged;
    return false;
  }
  if (measurement.sequence <= sequence_) {
    ++counts_.late;
    return false;
  }
  // a client that has just come does not begin with a gap
  const std::uint64_t gap = sequence_ == 0 ? 0 : measurement.sequence - sequence_ - 1;
  for (std::uint64_t i = 0; i < std::min<std::uint64_t>(gap, static_cast<unsigned>(gap_max_)); ++i)
    (void)miss();
  sequence_ = measurement.sequence;
  return tick(measurement);
}

bool Keeper::tick(const hamelin_measurement& measurement) {
  q_ = Eigen::Map<const VectorXd>(measurement.q, q_.size());
  v_ = Eigen::Map<const VectorXd>(measurement.v, v_.size());
  shift_time(measurement.time_s);
  const double time_s = measurement.time_s + shift_s_;
  time_s_ = std::isfinite(time_s) ? time_s : time_s_ + controller_.period_s();
  try {
    take_request(measurement.request);
    if (needs_reset_) controller_.reset();
    needs_reset_ = false;
    (void)controller_.tick(time_s, q_, v_);
  } catch (const std::exception& e) {
    // a first tick refuses a measurement that cannot be used, or has no way to stop; a planner may
    // refuse to start again, and is asked once more in the next period
    refuse_to_begin(e.what());
    return true;
  }
  begun_ = true;
  ++counts_.ticks;
  write(false);
  return true;
}

void Keeper::shift_time(double client_s) {
  if (!first_ || !std::isfinite(client_s)) return;
  first_ = false;
  const double next_s = time_s_ + controller_.period_s();
  shift_s_ = begun_ && client_s < time_s_ ? next_s - client_s : 0.0;
}

bool Keeper::miss() {
  if (!begun_) return false;
  ++counts_.lost;
  ++sequence_;
  time_s_ += controller_.period_s();
  (void)controller_.tick_unseen();
  ++counts_.ticks;
  write(true);
  return true;
}

void Keeper::take_request(std::uint32_t request) {
  if (request == request_) return;
  request_ = request;
  if (request == HAMELIN_REQUEST_STOP) controller_.stop("the client has asked for it");
  if (request == HAMELIN_REQUEST_RESUME) wants_resume_ = true;
  if (request == HAMELIN_REQUEST_RESET && begun_) {
    needs_reset_ = true;
    begun_ = false;
  }
}

bool Keeper::wants_resume() noexcept {
  return std::exchange(wants_resume_, false);
}

void Keeper::write(bool unseen) {
  const control::Answer& answer = controller_.answer();
  const auto state_before = setpoint_.state;
  setpoint_.sequence = sequence_;
  setpoint_.time_s = time_s_ - shift_s_;
  copy(answer.torque, setpoint_.torque);
  copy(answer.q_next, setpoint_.q);
  copy(answer.v_next, setpoint_.v);
  setpoint_.clearance_m = controller_.view().clearance_m();
  setpoint_.state = static_cast<std::int32_t>(answer.state);
  setpoint_.reason = static_cast<std::int32_t>(answer.reason);
  setpoint_.flags = 0;
  if (answer.saturated) setpoint_.flags |= HAMELIN_SETPOINT_SATURATED;
  if (answer.stopping) setpoint_.flags |= HAMELIN_SETPOINT_SHIELDED;
  if (unseen) setpoint_.flags |= HAMELIN_SETPOINT_UNSEEN;
  setpoint_.goal_index = static_cast<std::uint32_t>(answer.goal_index);
  finish_setpoint(answer.cause);
  if (answer.state == control::ControlState::stopping && setpoint_.state != state_before)
    ++counts_.stops;
}

void Keeper::refuse_to_begin(const std::string& cause) {
  setpoint_ = {};
  setpoint_.sequence = sequence_;
  setpoint_.time_s = time_s_ - shift_s_;
  setpoint_.state = static_cast<std::int32_t>(control::ControlState::stopping);
  setpoint_.flags = HAMELIN_SETPOINT_NOT_BEGUN;
  finish_setpoint(cause);
}

void Keeper::finish_setpoint(std::string_view cause) {
  setpoint_.lost = counts_.lost;
  setpoint_.late = counts_.late;
  setpoint_.damaged = counts_.damaged;
  setpoint_.cause[cause.copy(setpoint_.cause, HAMELIN_LINK_TEXT - 1)] = '\0';
  setpoint_.checksum = hamelin_setpoint_checksum(&setpoint_);
}

}  // namespace hamelin::serve
