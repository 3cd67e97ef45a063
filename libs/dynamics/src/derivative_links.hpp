#pragma once
#include <vector>

#include "hamelin/dynamics/kernel/derivatives.hpp"
#include "hamelin/model/model.hpp"

namespace hamelin::dynamics {

/// The constants of all links for derivatives.
[[nodiscard]] std::vector<kernel::DerivativeLink> derivative_links(const model::Model& model);

}  // namespace hamelin::dynamics
