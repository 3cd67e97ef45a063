#pragma once
#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/joint_box.hpp"
#include "hamelin/search/search.hpp"

namespace hamelin::search {

/// @throws Error invalid for what does not fit the model, or is not finite
void check(const model::Model& model, const Settings& settings);
void check(const model::Model& model, const Problem& problem);

/// The joint limits, with what searches leave of them.
[[nodiscard]] inline dynamics::JointBox joint_box(const model::Model& model,
                                                  const Settings& settings) {
  constexpr double reserve = 1e-3;  // [rad or m]
  return {model.dof(), settings.q_lower, settings.q_upper, reserve};
}

[[nodiscard]] inline Rng rng_of(const Settings& settings, const Problem& problem) {
  return Rng(settings.seed + 0x632be59bd9b4e019ULL * (problem.number + 1));
}

}  // namespace hamelin::search
