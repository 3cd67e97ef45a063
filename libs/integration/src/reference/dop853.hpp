#pragma once
#include <array>

#include "explicit.hpp"

namespace hamelin::integration {

/// DOP853 of Hairer, Nørsett, Wanner (Solving Ordinary Differential Equations I, 2nd edition, 1993,
/// code dop853.f): twelve stages, order 8, error estimate of orders 5 and 3, docs/theory.md (7.11).
/// With rtol or atol their controller chooses the step, otherwise it is fixed. The thirteenth
/// evaluation of the published code is the first of the next step and is made there, so only
/// State::step_next passes from step to step.
class Dop853 final : public Explicit {
 public:
  Dop853(const Model& model, const Dop853Options& options);
  [[nodiscard]] std::string criterion() const override;
  [[nodiscard]] int order() const override { return 8; }

 private:
  StepReport attempt(State& state, const Channels& channels, double h) override;
  StepReport controlled_step(State& state, const Channels& channels, double limit) override;

  /// The derivative at the node. It does not depend on h, so all tries share it.
  void first_stage(const State& state, const Channels& channels, StepReport& report);
  /// All other stages, then q_new_, v_new_ at the end of the step.
  void stages(const State& state, const Channels& channels, double h, StepReport& report);
  template <std::size_t s>
  void stage(const State& state, const Channels& channels, double h, StepReport& report);
  /// docs/theory.md (7.11), over q and v together; at most 1 if the tolerances are met.
  [[nodiscard]] double error_norm(const State& state, double h) const;

  static constexpr std::size_t count = 12;
  std::array<VectorXd, count> v_, a_;  ///< derivatives of q and v at the stages
  StepReport first_;                   ///< power of the channels at the node
  VectorXd q_, q_new_, v_new_;
};

}  // namespace hamelin::integration
