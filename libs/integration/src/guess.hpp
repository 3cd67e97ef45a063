#pragma once
#include <algorithm>

#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

/// Guess of the displacement: polynomial extrapolation through up to four past ones (State::deltas, newest first); h v
/// where State::delta_count is −1, after a start or a new velocity; scaled where the step changed.
inline void extrapolate(const State& state, double h, VectorXd& delta) {
  const auto& d = state.deltas;
  const int known = state.delta_count;
  if (known < 0)
    delta = h * state.v;
  else if (known == 0)
    delta.setZero();
  else if (state.step_previous != h)
    delta = d[0] * (h / state.step_previous);
  else if (known == 1)
    delta = d[0];
  else if (known == 2)
    delta = 2.0 * d[0] - d[1];
  else if (known == 3)
    delta = 3.0 * (d[0] - d[1]) + d[2];
  else
    delta = 4.0 * (d[0] + d[2]) - 6.0 * d[1] - d[3];
}

/// Remembers the displacement of an accepted step of length h for the next guess.
inline void remember(State& state, double h, const VectorXd& delta) {
  const bool same_step = state.step_previous == h && state.delta_count > 0;
  std::rotate(state.deltas.begin(), state.deltas.end() - 1, state.deltas.end());
  state.deltas[0] = delta;
  state.delta_count = same_step ? std::min(state.delta_count + 1, 4) : 1;
  state.step_previous = h;
}

}  // namespace hamelin::integration
