#pragma once
#include <array>

#include "channels/channel_forces.hpp"
#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

/// Base of the schemes whose state is (q, v), with forward dynamics at a point. A kick dp changes v
/// by M⁻¹ dp.
class Explicit : public Integrator {
 public:
  [[nodiscard]] std::string criterion() const override { return "explicit"; }

 protected:
  Explicit(std::string name, const Model& model, const Settings& settings);
  void node_velocity(const State& state, VectorRef v) const override { v = state.v; }
  void begin(State& state, const ConstVectorRef& v0) override { state.v = v0; }
  void add_momentum(State& state, const ConstVectorRef& dp) override;
  void replace_velocity(State& state, const ConstVectorRef& v) override { state.v = v; }
  /// acceleration_ = a(q, v) under gravity and the channels, docs/theory.md (7.1).
  void accelerate(const Channels& channels, const VectorXd& q, const VectorXd& v,
                  StepReport& report);

  ChannelForces forces_;
  VectorXd acceleration_;
};

/// docs/theory.md (7.2): v⁺ = v + h a(q, v), q⁺ = q + h v⁺. Order 1; the baseline of Shen, Wang,
/// Shi (2021).
class SemiImplicitEuler final : public Explicit {
 public:
  SemiImplicitEuler(const Model& model, const SemiImplicitEulerOptions& options);
  [[nodiscard]] int order() const override { return 1; }

 private:
  StepReport attempt(State& state, const Channels& channels, double h) override;

  VectorXd q_, v_;
};

/// The classical Runge–Kutta scheme of order 4, docs/theory.md (7.3), (7.4).
class Rk4 final : public Explicit {
 public:
  Rk4(const Model& model, const Rk4Options& options);
  [[nodiscard]] int order() const override { return 4; }

 private:
  StepReport attempt(State& state, const Channels& channels, double h) override;

  VectorXd q_, v_, q_sum_, v_sum_;
};

}  // namespace hamelin::integration
