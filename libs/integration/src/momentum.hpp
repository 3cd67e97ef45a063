#pragma once
#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

/// What the schemes share that keep the node's momentum: a state (q, p), velocity as M⁻¹ p, kicks as they are.
class Momentum : public Integrator {
 public:
  void velocity(const State& state, VectorXd& v) override { dynamics::solve_mass(model_, ws_, state.q, state.p, v); }
  void kick(State& state, const VectorXd& dp) override { state.p += dp; }
  void set_velocity(State& state, const VectorXd& v) override {
    dynamics::momentum(model_, ws_, state.q, v, state.p);
    state.v = v;
    state.delta_count = -1;  // a guess of the displacement is h v
  }

 protected:
  using Integrator::Integrator;
  void begin(State& state, const VectorXd& v0) override { set_velocity(state, v0); }
};

}  // namespace hamelin::integration
