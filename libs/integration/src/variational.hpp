#pragma once
#include <memory>
#include <variant>

#include "hamelin/integration/integrator.hpp"
#include "kernel/variational.hpp"

namespace hamelin::integration {

/// hamel-variational: the exact variation of L_d = h [T(θ_mid, Δ/h) − ½U(θ^k) − ½U(θ^{k+1})] (SPEC §3), solved for Δ by
/// the exact O(n) Newton step or by the paper's feedback (16).
class Variational final : public Integrator {
 public:
  Variational(const Model& model, const Options& options);
  [[nodiscard]] std::string criterion() const override;
  [[nodiscard]] int order() const override { return 2; }
  void velocity(const State& state, VectorXd& v) override;
  void kick(State& state, const VectorXd& dp) override;
  void set_velocity(State& state, const VectorXd& v) override;

 private:
  void begin(State& state, const VectorXd& v0) override;
  StepReport attempt(State& state, const Channels& channels, double h) override;
  void guess(const State& state, double h);
  /// Residual of the left equation at delta_; leaves plus_ and force_.
  void evaluate(const State& state, const Channels& channels, double h);
  bool factor(const Channels& channels, double h);
  /// correction_ = what the kept factors make of residual_.
  void correct();
  bool solve_newton(const State& state, const Channels& channels, double h, StepReport& report);
  bool solve_feedback(const State& state, const Channels& channels, double h, StepReport& report);

  std::variant<kernel::VariationalScratch<dynamics::kernel::Spatial<double>>,
               kernel::VariationalScratch<dynamics::kernel::Planar<double>>>
      links_;
  VectorXd delta_, correction_, mid_, rate_, minus_, plus_, residual_, gradient_;
};

}  // namespace hamelin::integration
