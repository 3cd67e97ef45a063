#pragma once
#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

/// Chooses the length of one step under step control, docs/theory.md (7.16). With e the error of a
/// try relative to the tolerance, a try is accepted if e ≤ 1, and the next one has the length h
/// clamp(safety e^(−1/order), least, most).
///
///   StepController control(rule, state, limit);
///   while (control.has_try()) {
///     … try a step of control.step() …
///     if (!control.accepts(error)) continue;
///     … update the state …
///     control.finish(state, report);
///   }
class StepController {
 public:
  struct Rule {
    double order;        ///< the error is proportional to this power of the step
    double safety;       ///< factor on the longest step that would be accepted
    double least, most;  ///< bounds of the ratio of the next step to this one
  };

  /// The first try has the length that the last step proposed, at most `limit`.
  StepController(const Rule& rule, const State& state, double limit);

  /// Whether there is another try.
  [[nodiscard]] bool has_try();
  [[nodiscard]] double step() const noexcept { return step_; }
  /// Whether the try is accepted; pass NaN for a try that failed.
  [[nodiscard]] bool accepts(double error);
  /// Reports the accepted step and writes its proposal to State::step_next; has_try() is then
  /// false.
  void finish(State& state, StepReport& report);
  [[nodiscard]] int rejected() const noexcept { return rejected_; }

 private:
  Rule rule_;
  double limit_, proposed_, shortest_, step_, next_ = 0.0;
  int rejected_ = 0;
  bool finished_ = false;
};

}  // namespace hamelin::integration
