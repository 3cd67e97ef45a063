#pragma once
#include "hamelin/integration/options.hpp"

namespace hamelin::integration {

/// The options with what follows from others: atol where rtol is alone.
/// @throws Error usage for numbers out of range
[[nodiscard]] Options checked(Options options);

}  // namespace hamelin::integration
