#include <bit>
#include <catch2/catch.hpp>

#include "hamelin/sensing/occupancy_grid.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;

TEST_CASE("the README's example takes a frame", "[sensing][unit]") {
  const Eigen::Matrix3Xf points = Eigen::Vector3f(0.4F, 0.005F, 0.505F);
  const Eigen::Vector3f camera(0.0F, 0.0F, 0.5F);
  int changed = 0;
  // clang-format off
  // [example]
sensing::OccupancyGrid grid(0.01, {{-100, -100, 0}, {100, 100, 150}});  // 1 cm; 2 m × 2 m × 1.5 m
for (const auto& row : grid.insert(points, camera)) {                   // 3 × N, in the map's frame
  changed += std::popcount(row.occupied | row.freed);
}
bool blocked = grid.state({40, 0, 50}) != sensing::OccupancyGrid::State::free;
  // [example]
  // clang-format on
  CHECK(changed == 41);
  CHECK(blocked);
  test::check_readme_example("libs/sensing");
}
