#pragma once
#include "hamelin/integration/options.hpp"

namespace hamelin::integration {

/// The options with derived values filled in: atol = rtol if only rtol is given.
/// @throws Error usage for values out of range
[[nodiscard]] Options checked(Options options);

}  // namespace hamelin::integration
