#pragma once
#include <string_view>

namespace hamelin {

/// The instruction set that the libraries were compiled for: "x86-64", "v2", "v3" or "v4" (the levels of the x86-64
/// psABI), "aarch64" or "other". The same results to the bit are promised on one set only.
[[nodiscard]] std::string_view instruction_set() noexcept;

/// HAMELIN_ISA, where it is set, must name that set: a build has one path.
/// @throws Error usage
void check_instruction_set();

}  // namespace hamelin
