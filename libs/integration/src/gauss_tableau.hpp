#pragma once
#include "kernel/gauss.hpp"

namespace hamelin::integration {

/// The tableau of Gauss–Legendre collocation, docs/theory.md (5.2), with 2 to kernel::max_stages
/// stages, correct to rounding.
[[nodiscard]] kernel::GaussTableau gauss_tableau(std::size_t stages);

}  // namespace hamelin::integration
