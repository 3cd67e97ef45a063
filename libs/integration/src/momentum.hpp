#pragma once
#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

/// Base of the schemes whose state is (q, p): the velocity is M⁻¹ p, and kicks add to p.
class Momentum : public Integrator {
 protected:
  using Integrator::Integrator;
  void node_velocity(const State& state, VectorRef v) const override {
    dynamics::solve_mass(model_, ws_, state.q, state.p, v);
  }
  void begin(State& state, const ConstVectorRef& v0) override {
    state.history.assign(1, StepHistory(model_.dof()));
    state.p = VectorXd::Zero(model_.dof());
    replace_velocity(state, v0);
  }
  void add_momentum(State& state, const ConstVectorRef& dp) override { state.p += dp; }
  void replace_velocity(State& state, const ConstVectorRef& v) override {
    dynamics::momentum(model_, ws_, state.q, v, state.p);
    for (auto& steps : state.history) steps.restart(v);
  }
};

}  // namespace hamelin::integration
