#include "hamelin/core/isa.hpp"

#include <fmt/format.h>

#include <cstdlib>

#include "hamelin/core/error.hpp"

namespace hamelin {

std::string_view instruction_set() noexcept {
#if defined(__AVX512F__) && defined(__AVX512VL__)
  return "v4";
#elif defined(__AVX2__) && defined(__FMA__)
  return "v3";
#elif defined(__SSE4_2__)
  return "v2";
#elif defined(__x86_64__)
  return "x86-64";
#elif defined(__aarch64__)
  return "aarch64";
#else
  return "other";
#endif
}

void check_instruction_set() {
  const char* asked = std::getenv("HAMELIN_ISA");
  if (asked != nullptr && *asked != '\0' && asked != instruction_set())
    throw Error(ErrorCode::usage,
                fmt::format("HAMELIN_ISA: '{}' is asked for, but this build runs '{}' only", asked, instruction_set()));
}

}  // namespace hamelin
