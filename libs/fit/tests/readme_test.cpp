#include <catch2/catch.hpp>

#include "hamelin/fit/cover.hpp"
#include "hamelin/fit/coverage.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;

TEST_CASE("the README's example runs", "[fit][docs]") {
  // clang-format off
  // [example]
// A rod of 50 cm, covered by capsules and by balls that stick out at most 3 cm.
const fit::Solid rod(fit::cylinder_mesh(0.05, 0.5));
fit::CoverOptions options;
options.excess_m = 0.03;
const fit::Cover balls = fit::cover(rod, {}, options);
options.capsules = true;
const fit::Cover capsules = fit::cover(rod, {}, options);
REQUIRE(balls.shapes.size() > capsules.shapes.size());
REQUIRE(fit::coverage_gap(rod.mesh(), balls.shapes, 1e-4).bound_m == 0.0);  // proven
REQUIRE(fit::excess(&rod, {}, balls.shapes).max_m < 0.031);
  // [example]
  // clang-format on
  test::check_readme_example("libs/fit");
}
