#include "hamelin/core/isa.hpp"

#include <array>
#include <atomic>

#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"

namespace hamelin {

namespace {

#if defined(__x86_64__)
constexpr std::array<std::string_view, 3> names{"x86-64", "v3", "v4"};
#else
constexpr std::array<std::string_view, 1> names{"generic"};
#endif

constexpr std::int32_t none = -1;
std::atomic<std::int32_t> chosen{none};

// What a build lacks is chosen by HAMELIN_INSTRUCTION_SETS.
#ifdef HAMELIN_WITHOUT_BASELINE
constexpr bool has_baseline = false;
#else
constexpr bool has_baseline = true;
#endif
#if defined(__x86_64__)
#ifdef HAMELIN_WITHOUT_V3
constexpr bool has_v3 = false;
#else
constexpr bool has_v3 = true;
#endif
#ifdef HAMELIN_WITHOUT_V4
constexpr bool has_v4 = false;
#else
constexpr bool has_v4 = true;
#endif
#endif

Isa best_isa() noexcept {
  Isa isa = Isa::baseline;
  for (std::size_t i = 0; i < names.size(); ++i)
    if (is_available(Isa{static_cast<std::int32_t>(i)})) isa = Isa{static_cast<std::int32_t>(i)};
  return isa;
}

}  // namespace

bool is_available([[maybe_unused]] Isa isa) noexcept {
#if defined(__x86_64__)
  __builtin_cpu_init();
  const bool v3 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  if (isa == Isa::v3) return has_v3 && v3;
  if (isa == Isa::v4)
    return has_v4 && v3 && __builtin_cpu_supports("avx512f") &&
           __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512dq");
#endif
  return has_baseline && isa == Isa::baseline;
}

Isa default_isa() noexcept {
  const std::int32_t isa = chosen.load(std::memory_order_relaxed);
  if (isa != none) return Isa{isa};
  static const Isa best = best_isa();
  return best;
}

void set_default_isa(Isa isa) {
  require_available(isa);
  chosen.store(static_cast<std::int32_t>(isa), std::memory_order_relaxed);
}

bool default_isa_is_set() noexcept {
  return chosen.load(std::memory_order_relaxed) != none;
}

std::string_view name_of(Isa isa) noexcept {
  const auto i = static_cast<std::size_t>(isa);
  return i < names.size() ? names[i] : "unknown";
}

Isa isa_from_name(std::string_view name, std::string_view where) {
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (names[i] != name) continue;
    const Isa isa{static_cast<std::int32_t>(i)};
    if (is_available(isa)) return isa;
    throw Error(ErrorCode::usage,
                formatted("{}: this machine or this build does not have the instruction set '{}', "
                          "expected {}",
                          where, name, name_of(best_isa())));
  }
  throw Error(ErrorCode::usage,
              formatted("{}: instruction set '{}' is not known, expected one of {}", where, name,
                        joined(names, ", ")));
}

void require_available(Isa isa) {
  if (!is_available(isa))
    throw Error(ErrorCode::usage,
                formatted("instruction set: this machine or this build does not have '{}', "
                          "expected '{}'",
                          name_of(isa), name_of(best_isa())));
}

}  // namespace hamelin
