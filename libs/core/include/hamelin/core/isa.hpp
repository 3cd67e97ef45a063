#pragma once
#include <cstdint>
#include <string_view>

namespace hamelin {

/// The instruction sets that the numerical kernels are compiled for. `baseline` is what the whole program needs;
/// v3 adds AVX2 and FMA, v4 AVX-512 (F, VL, DQ): names after the levels of the x86-64 psABI.
enum class Isa : std::int32_t { baseline, v3, v4 };

/// The set that kernels made from now on use: the best that this machine and this build have, or what the environment
/// variable HAMELIN_ISA names ("x86-64", "v3" or "v4"). The same results to the bit are promised on one set only.
/// @throws Error usage where HAMELIN_ISA names a set that is unknown, not built or not there
[[nodiscard]] Isa selected_isa();

/// Its name: "x86-64" (elsewhere "generic"), "v3" or "v4".
/// @throws Error usage as selected_isa
[[nodiscard]] std::string_view instruction_set();

/// Sets HAMELIN_ISA for this process, its plugins included; a repeated run takes the path of the first so.
/// @throws Error usage as selected_isa; the variable is then as before
void force_instruction_set(std::string_view name);

}  // namespace hamelin
