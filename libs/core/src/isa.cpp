#include "hamelin/core/isa.hpp"

#include <fmt/format.h>

#include <array>
#include <cstdlib>
#include <string>

#include "hamelin/core/error.hpp"

namespace hamelin {

namespace {

#if defined(__x86_64__)
constexpr std::array<std::string_view, 3> names{"x86-64", "v3", "v4"};
#else
constexpr std::array<std::string_view, 1> names{"generic"};
#endif

bool machine_has([[maybe_unused]] Isa isa) {
#if defined(__x86_64__)
  __builtin_cpu_init();
  const bool v3 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (isa == Isa::v3) return v3;
  if (isa == Isa::v4)
    return v3 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
           __builtin_cpu_supports("avx512dq");
#endif
  return isa == Isa::baseline;
}

Isa find(std::string_view name) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] != name) continue;
    const Isa isa{static_cast<std::int32_t>(i)};
    if (machine_has(isa)) return isa;
    throw Error(ErrorCode::usage,
                fmt::format("HAMELIN_ISA: '{}' is asked for, but this machine does not have it", name));
  }
  throw Error(ErrorCode::usage,
              fmt::format("HAMELIN_ISA: '{}' is not known, expected one of {}", name, fmt::join(names, ", ")));
}

}  // namespace

Isa selected_isa() {
  const char* asked = std::getenv("HAMELIN_ISA");
  if (asked != nullptr && *asked != '\0') return find(asked);
  static const Isa best = [] {
    Isa isa = Isa::baseline;
    for (std::size_t i = 0; i < names.size(); ++i)
      if (machine_has(Isa{static_cast<std::int32_t>(i)})) isa = Isa{static_cast<std::int32_t>(i)};
    return isa;
  }();
  return best;
}

std::string_view instruction_set() {
  return names[static_cast<std::size_t>(selected_isa())];
}

void force_instruction_set(std::string_view name) {
  (void)find(name);
  ::setenv("HAMELIN_ISA", std::string(name).c_str(), 1);
}

}  // namespace hamelin
