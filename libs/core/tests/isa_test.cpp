#include "hamelin/core/isa.hpp"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <string>

#include "hamelin/core/error.hpp"

using namespace hamelin;

TEST_CASE("an unknown instruction set is refused and the default is kept", "[core][unit]") {
  const Isa before = default_isa();
  CHECK(is_available(before));
  CHECK_THROWS_WITH(
      isa_from_name("v9", "HAMELIN_ISA"),
      Catch::StartsWith("HAMELIN_ISA: instruction set 'v9' is not known, expected one of "));
  CHECK_THROWS_AS(set_default_isa(Isa{9}), Error);
  CHECK(default_isa() == before);
  CHECK(isa_from_name(name_of(before), "test") == before);
}

TEST_CASE("set_default_isa changes the default, the environment does not", "[core][unit]") {
  const Isa before = default_isa();
  ::setenv("HAMELIN_ISA", "v9", 1);
  CHECK(default_isa() == before);
  ::unsetenv("HAMELIN_ISA");
  set_default_isa(Isa::baseline);
  CHECK(default_isa() == Isa::baseline);
  CHECK(default_isa_is_set());
#if defined(__x86_64__)
  CHECK(name_of(default_isa()) == "x86-64");
#endif
  set_default_isa(before);
  CHECK(default_isa() == before);
}
