#pragma once
#include <cstdint>
#include <string_view>

namespace hamelin {

/// The instruction sets that the numerical kernels are compiled for. `baseline` is what the whole program needs;
/// v3 adds AVX2 and FMA, v4 AVX-512 (F, VL, DQ): names after the levels of the x86-64 psABI. The same results to the
/// bit are promised on one set only.
enum class Isa : std::int32_t { baseline, v3, v4 };

/// Whether this machine and this build have it.
[[nodiscard]] bool is_available(Isa isa) noexcept;

/// The set of kernels that are made without naming one: the best there is, until set_default_isa names another. A
/// library that is linked into a plugin has a default of its own, which the plugin interface hands over.
[[nodiscard]] Isa default_isa() noexcept;

/// A program calls it once, before it makes anything that computes.
/// @throws Error usage if the set is not available; the default is then as before
void set_default_isa(Isa isa);
/// Whether set_default_isa was called.
[[nodiscard]] bool default_isa_is_set() noexcept;

/// "x86-64" (elsewhere "generic"), "v3" or "v4".
[[nodiscard]] std::string_view name_of(Isa isa) noexcept;
/// The set of that name.
/// @param where what names it, with which an error message begins
/// @throws Error usage if the name is unknown or the set is not available
[[nodiscard]] Isa isa_from_name(std::string_view name, std::string_view where);

/// @throws Error usage if the set is not available
void require_available(Isa isa);

}  // namespace hamelin
