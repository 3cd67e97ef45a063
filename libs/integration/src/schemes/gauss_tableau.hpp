#pragma once
#include "kernel/gauss.hpp"

namespace hamelin::integration {

/// The tableau of Gauss–Legendre collocation, docs/theory.md (5.2), with 2 to kernel::max_stages
/// stages, correct to rounding.
[[nodiscard]] kernel::GaussTableau gauss_tableau(std::size_t stages);

/// The guess of a step, docs/theory.md (5.9). @param ratio length of the step over that of the step
/// before @param older_at GaussMemory::older_at
[[nodiscard]] kernel::GaussGuess gauss_guess(const kernel::GaussTableau& tableau, double ratio,
                                             double older_at);

}  // namespace hamelin::integration
