#include "hamelin/core/isa.hpp"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <string>

#include "hamelin/core/error.hpp"

using namespace hamelin;

TEST_CASE("an instruction set that this build does not have is refused, never ignored", "[core][unit]") {
  ::unsetenv("HAMELIN_ISA");
  CHECK_NOTHROW(check_instruction_set());
  ::setenv("HAMELIN_ISA", std::string(instruction_set()).c_str(), 1);
  CHECK_NOTHROW(check_instruction_set());
  ::setenv("HAMELIN_ISA", "v9", 1);
  CHECK_THROWS_WITH(check_instruction_set(), Catch::Contains("HAMELIN_ISA: 'v9'"));
  ::unsetenv("HAMELIN_ISA");
}
