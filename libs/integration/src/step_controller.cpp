#include "step_controller.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hamelin::integration {

namespace {

constexpr double stretch = 1.01;  // a step that would end within 1 % of the limit ends at it
constexpr double after_failure = 0.5;
constexpr int max_rejections = 60;

}  // namespace

StepController::StepController(const Rule& rule, const State& state, double limit)
    : rule_(rule),
      limit_(limit),
      proposed_(state.step_next > 0.0 ? state.step_next : limit),
      shortest_(10.0 * std::numeric_limits<double>::epsilon() * std::abs(state.time_s)),
      step_(proposed_) {}

bool StepController::has_try() {
  if (finished_ || rejected_ > max_rejections || !(step_ > shortest_)) return false;
  if (stretch * step_ >= limit_) step_ = limit_;
  return true;
}

bool StepController::accepts(double error) {
  if (!std::isfinite(error)) {
    ++rejected_;
    step_ *= after_failure;
    return false;
  }
  const double factor =
      std::clamp(rule_.safety * std::pow(error, -1.0 / rule_.order), rule_.least, rule_.most);
  next_ = factor * step_;
  if (error > 1.0) {
    ++rejected_;
    step_ = next_;
    return false;
  }
  if (rejected_ > 0) next_ = std::min(next_, step_);
  // A step that the limit cut short does not reduce the proposal.
  if (rejected_ == 0 && step_ < proposed_) next_ = std::max(next_, proposed_);
  return true;
}

void StepController::finish(State& state, StepReport& report) {
  state.step_next = next_;
  report.step_s = step_;
  report.converged = true;
  finished_ = true;
}

}  // namespace hamelin::integration
