#include "hamelin/core/shared_library.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/core/error.hpp"

namespace hamelin {

using Catch::Contains;

TEST_CASE("a library is loaded when it is needed, and one that is missing is named",
          "[core][unit]") {
  const SharedLibrary math("libm.so.6", "this test");
  CHECK(math.find<double(double)>("rint")(2.75) == 3.0);
  CHECK_THROWS_WITH((void)math.find<double(double)>("no_such_function"),
                    Contains("libm.so.6") && Contains("no_such_function"));
  CHECK_THROWS_WITH(SharedLibrary("libno_such.so.1", "this test"),
                    Contains("libno_such.so.1: cannot be loaded, but this test needs it"));
}

}  // namespace hamelin
