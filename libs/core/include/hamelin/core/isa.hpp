#pragma once
#include <cstdint>
#include <string_view>

namespace hamelin {

/// The instruction sets that the numerical kernels are compiled for. The whole program needs
/// `baseline`; v3 adds AVX2 and FMA, v4 adds AVX-512 (F, VL, DQ). The names are those of the levels
/// in the x86-64 psABI. Results are bit-identical on one set, not between sets.
enum class Isa : std::int32_t { baseline, v3, v4 };

/// Whether this machine and this build have the instruction set.
[[nodiscard]] bool is_available(Isa isa) noexcept;

/// The set that kernels use unless their caller names one: the best available set, until
/// set_default_isa chooses another. A library that is linked into a plugin has a default of its
/// own, which the plugin interface sets.
[[nodiscard]] Isa default_isa() noexcept;

/// Sets the default. A program calls this once, before it makes anything that computes.
/// @throws Error usage if the set is not available; the default is then unchanged
void set_default_isa(Isa isa);
/// Whether set_default_isa was called.
[[nodiscard]] bool default_isa_is_set() noexcept;

/// "x86-64" (elsewhere "generic"), "v3" or "v4".
[[nodiscard]] std::string_view name_of(Isa isa) noexcept;
/// The set of that name.
/// @param where the source of the name, for example an environment variable; prefix of the message
/// @throws Error usage if the name is unknown or the set is not available
[[nodiscard]] Isa isa_from_name(std::string_view name, std::string_view where);

/// @throws Error usage if the set is not available
void require_available(Isa isa);

}  // namespace hamelin
