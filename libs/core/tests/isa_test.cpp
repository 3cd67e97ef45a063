#include "hamelin/core/isa.hpp"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <string>

#include "hamelin/core/error.hpp"

using namespace hamelin;

TEST_CASE("an instruction set that is unknown or not there is refused, never ignored", "[core][unit]") {
  ::unsetenv("HAMELIN_ISA");
  const std::string best(instruction_set());
  ::setenv("HAMELIN_ISA", "v9", 1);
  CHECK_THROWS_WITH(selected_isa(), Catch::Contains("HAMELIN_ISA: 'v9' is not known, expected one of"));
  CHECK_THROWS_AS(force_instruction_set("avx"), Error);
  CHECK(std::string(std::getenv("HAMELIN_ISA")) == "v9");
  force_instruction_set(best);
  CHECK(instruction_set() == best);
#if defined(__x86_64__)
  force_instruction_set("x86-64");
  CHECK(selected_isa() == Isa::baseline);
  CHECK(instruction_set() == "x86-64");
#endif
  ::unsetenv("HAMELIN_ISA");
  CHECK(instruction_set() == best);
}
