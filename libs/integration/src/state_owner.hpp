#pragma once
#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

/// Whether gauss steps (q, p) with these options, its structure mode; otherwise (q, v).
[[nodiscard]] inline bool structure_mode(const GaussOptions& o) noexcept {
  return !(o.rtol > 0.0 || o.atol > 0.0) && o.tolerance <= 1e-12;
}

/// The owner of the states of a scheme with these options, which were checked.
[[nodiscard]] StateOwner owner_of_states(const Model& model, const Options& options);

/// Throws the Error (usage) for a state whose owner is not the expected one.
[[noreturn]] void refuse_owner(const char* function, const State& state, const StateOwner& expected,
                               const Model& model);

}  // namespace hamelin::integration
