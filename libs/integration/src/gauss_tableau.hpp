#pragma once
#include "kernel/gauss.hpp"

namespace hamelin::integration {

/// The tableau of Gauss–Legendre collocation with 2 to kernel::most_stages stages, right to rounding.
[[nodiscard]] kernel::GaussTableau gauss_tableau(std::size_t stages);

}  // namespace hamelin::integration
