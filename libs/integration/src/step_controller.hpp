#pragma once
#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

/// Chooses the length of one step under step control, for all schemes that have it. With e the error of a try over what
/// is allowed, a try is accepted where e ≤ 1, and the next one is h clamp(safety e^(−1/order), least, most) long.
///
///   StepController control(rule, state, limit);
///   while (control.has_try()) {
///     … a step of control.step() …
///     if (!control.accepts(error)) continue;
///     … the state goes there …
///     control.finish(state, report);
///   }
class StepController {
 public:
  struct Rule {
    double order;        ///< the error goes as this power of the step
    double safety;       ///< the share of the longest step allowed that is taken
    double least, most;  ///< how much shorter or longer than this step the next may be
  };

  /// The first try is as long as the last step wished, at most `limit`.
  StepController(const Rule& rule, const State& state, double limit);

  /// Whether there is another try.
  [[nodiscard]] bool has_try();
  [[nodiscard]] double step() const noexcept { return step_; }
  /// Judges the try by its error; one that is not finite stands for a try that failed.
  [[nodiscard]] bool accepts(double error);
  /// Reports the accepted step and leaves its wish in State::step_next; has_try() is false from here on.
  void finish(State& state, StepReport& report);
  [[nodiscard]] int rejected() const noexcept { return rejected_; }

 private:
  Rule rule_;
  double limit_, wish_, shortest_, step_, next_ = 0.0;
  int rejected_ = 0;
  bool finished_ = false;
};

}  // namespace hamelin::integration
