#include "hamelin/sensing/map_maker.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/sensing/occupancy_grid.hpp"
#include "hamelin/test/errors.hpp"

using namespace hamelin;

TEST_CASE("a map of frames has the voxels of a grid of them", "[sensing][unit]") {
  const double resolution = 0.05;
  sensing::OccupancyGrid grid(resolution, {{-60, -60, -60}, {60, 60, 60}});
  sensing::MapMaker maker(resolution);
  for (int k = 0; k < 3; ++k) {
    Eigen::Matrix3Xf points(3, 400);
    for (int i = 0; i < 400; ++i)
      points.col(i) = Eigen::Vector3f(1.5F, -1.0F + 0.1F * static_cast<float>(i % 20),
                                      -1.0F + 0.1F * static_cast<float>(i / 20));
    const Eigen::Vector3f origin(-1.0F, 0.3F * static_cast<float>(k), 0.1F);
    (void)grid.insert(points, origin);
    maker.insert(points, origin);
  }
  std::size_t occupied = 0, free = 0;
  for (std::int32_t z = -60; z < 60; ++z)
    for (std::int32_t y = -60; y < 60; ++y)
      for (std::int32_t x = -60; x < 60; ++x) {
        const auto state = grid.state({x, y, z});
        occupied += state == sensing::OccupancyGrid::State::occupied ? 1 : 0;
        free += state == sensing::OccupancyGrid::State::free ? 1 : 0;
      }
  CHECK(occupied == 400);
  CHECK(maker.occupied() == occupied);
  CHECK(maker.free() == free);
  for (const auto format : {scene::MapFormat::bt, scene::MapFormat::ot}) {
    const std::string name = format == scene::MapFormat::bt ? "m.bt" : "m.ot";
    const scene::MapData map = scene::map_from_bytes(maker.bytes(format), name);
    CHECK(map.resolution == resolution);
    std::size_t read = 0;
    for (const auto& cell : map.occupied)
      read += static_cast<std::size_t>(cell.size) * static_cast<std::size_t>(cell.size) *
              static_cast<std::size_t>(cell.size);
    CHECK(read == occupied);
    CHECK(map.free_leaves > 0);
  }
}

TEST_CASE("maps of what is out of reach of their voxels are refused", "[sensing][unit]") {
  using Catch::Contains;
  CHECK_THAT(test::error_of([] { sensing::MapMaker(-1.0); }), Contains("a resolution of -1 m"));
  sensing::MapMaker maker(0.01);
  const Eigen::Matrix3Xf point = Eigen::Vector3f(400.0F, 0.0F, 0.0F);
  const Eigen::Vector3f zero = Eigen::Vector3f::Zero();
  CHECK_THAT(test::error_of([&] { maker.insert(point, zero); }),
             Contains("a point at (400, 0, 0) m, expected one within 32768 voxels"));
  CHECK_THAT(test::error_of([&] {
               maker.insert(point, {0.0F, std::nanf(""), 0.0F});
             }),
             Contains("a sensor at (0, nan, 0) m"));
  CHECK(maker.occupied() == 0);
}
