#include "hamelin/scene/boxes.hpp"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/scene/map_file.hpp"
#include "hamelin/test/scene_data.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;

double volume(const std::vector<Cell>& cells) {
  double sum = 0.0;
  for (const Cell& cell : cells) sum += std::pow(static_cast<double>(cell.size), 3);
  return sum;
}

double volume(const std::vector<VoxelBox>& boxes) {
  double sum = 0.0;
  for (const VoxelBox& box : boxes)
    sum += static_cast<double>(box.hi[0] - box.lo[0]) * (box.hi[1] - box.lo[1]) *
           (box.hi[2] - box.lo[2]);
  return sum;
}

bool share_volume(const VoxelBox& a, const VoxelBox& b) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (a.hi[axis] <= b.lo[axis] || b.hi[axis] <= a.lo[axis]) return false;
  return true;
}

VoxelBox box_of(const Cell& cell) {
  return {cell.lo, {cell.lo[0] + cell.size, cell.lo[1] + cell.size, cell.lo[2] + cell.size}};
}

// Volumes are integers: if they are equal, boxes are disjoint and all their voxels are in cells,
// the unions are equal.
void check_same_union(const std::vector<Cell>& cells, const std::vector<VoxelBox>& boxes) {
  REQUIRE(volume(boxes) == volume(cells));
  std::size_t overlaps = 0;
  for (std::size_t i = 0; i < boxes.size(); ++i)
    for (std::size_t j = i + 1; j < boxes.size(); ++j)
      overlaps += share_volume(boxes[i], boxes[j]) ? 1 : 0;
  CHECK(overlaps == 0);
  double inside = 0.0;
  for (const VoxelBox& box : boxes) {
    for (const Cell& cell : cells) {
      const VoxelBox other = box_of(cell);
      if (!share_volume(box, other)) continue;
      double common = 1.0;
      for (std::size_t axis = 0; axis < 3; ++axis)
        common *= std::min(box.hi[axis], other.hi[axis]) - std::max(box.lo[axis], other.lo[axis]);
      inside += common;
    }
  }
  CHECK(inside == volume(cells));
}

}  // namespace

TEST_CASE("merged boxes are disjoint and have exactly the cells' union", "[scene][property]") {
  const auto seed = GENERATE(range(std::uint64_t{0}, std::uint64_t{20}));
  CAPTURE(seed);
  Rng rng(seed);
  std::vector<Cell> cells;
  const auto aligned = [&](std::int32_t size) {
    Cell cell{{}, size};
    for (auto& lo : cell.lo) lo = (static_cast<std::int32_t>(rng.below(600)) - 300) / size * size;
    return cell;
  };
  for (int i = 0; i < 300; ++i) {
    Cell cell = aligned(std::int32_t{1} << rng.below(7));
    bool free = true;
    for (const Cell& other : cells) free = free && !share_volume(box_of(other), box_of(cell));
    if (free) cells.push_back(cell);
  }
  check_same_union(cells, merge(cells));
}

namespace {

void check_merged(const std::filesystem::path& file, const Ball& region) {
  CAPTURE(file);
  const MapData map = read_map(file);
  const auto cells = crop(map.occupied, map.resolution, region);
  REQUIRE(cells.size() > 1000);
  const auto boxes = merge(cells);
  CHECK(boxes.size() * 4 < cells.size());
  check_same_union(cells, boxes);
}

}  // namespace

TEST_CASE("merged boxes of our maps have the leaves' union", "[scene][unit]") {
  for (const char* name : {"shelf.bt", "clutter.bt"})
    check_merged(test::data / "maps" / name, {{0.4, 0.0, 0.5}, 0.8});
}

TEST_CASE("merged boxes of real maps have the leaves' union", "[scene][unit]") {
  const auto directory = test::shared_data("maps");
  for (const char* name : {"velma_hanas.bt", "velma_world1.bt"})
    check_merged(directory / name, {{0.5, 0.0, 1.0}, 1.2});
}

TEST_CASE("a block of voxels across tiles becomes one box", "[scene][unit]") {
  std::vector<Cell> cells;
  for (std::int32_t x = -3; x < 4; ++x)
    for (std::int32_t y = 254; y < 259; ++y)
      for (std::int32_t z = -2; z < 2; ++z) cells.push_back({{x, y, z}, 1});
  const auto boxes = merge(cells);
  REQUIRE(boxes.size() == 1);
  CHECK(boxes[0].lo == std::array<std::int32_t, 3>{-3, 254, -2});
  CHECK(boxes[0].hi == std::array<std::int32_t, 3>{4, 259, 2});
}

TEST_CASE("a cell of a kilometre is never expanded", "[scene][unit]") {
  const std::vector<Cell> cells{{{0, 0, 0}, 32768}, {{-1, 0, 0}, 1}};
  CHECK(merge(cells).size() == 2);
  CHECK(crop(cells, 0.05, {{-3.0, 0.0, 0.0}, 1.0}).empty());
  CHECK(crop(cells, 0.05, {{-1.0, 0.5, 0.5}, 1.1}).size() == 1);
  CHECK(crop(cells, 0.05, {{-1.0, 0.02, 0.02}, 1.1}).size() == 2);
}

TEST_CASE("the volume inside a ball is that of the ball, to the voxels at its surface",
          "[scene][unit]") {
  const std::vector<Cell> all{{{-32768, -32768, -32768}, 65536}};
  const double radius = 0.85, resolution = 0.02;
  const double ball = 4.0 / 3.0 * std::numbers::pi * radius * radius * radius;
  CHECK(volume_inside(all, resolution, {{0.013, 0.004, -0.3}, radius}) ==
        Approx(ball).epsilon(0.002));
  const std::vector<Cell> half{{{-32768, -32768, -32768}, 32768}};
  CHECK(volume_inside(half, resolution, {{0.0, 0.0, 0.0}, radius}) ==
        Approx(ball / 8.0).epsilon(0.01));
}

TEST_CASE("volumes inside a ball add up to the voxel", "[scene][unit]") {
  // A grain is one voxel, and 2³ voxels.
  const double resolution = GENERATE(0.02, 0.003);
  const Ball ball{{0.0123, -0.3, 0.171}, 0.83};
  const double voxel = resolution * resolution * resolution;
  const auto voxels = [&](std::int32_t x, std::int32_t y, std::int32_t z, std::int32_t size) {
    return std::round(volume_inside({{{x, y, z}, size}}, resolution, ball) / voxel);
  };
  // Each of these cells is the sum of the smaller ones in it, down to voxels.
  const auto check_parts = [&](std::int32_t x, std::int32_t y, std::int32_t z, std::int32_t size,
                               std::int32_t part) {
    double sum = 0.0;
    for (std::int32_t i = 0; i < size; i += part)
      for (std::int32_t j = 0; j < size; j += part)
        for (std::int32_t k = 0; k < size; k += part) sum += voxels(x + i, y + j, z + k, part);
    CHECK(sum == voxels(x, y, z, size));
    return sum;
  };
  CHECK(check_parts(-512, -512, -512, 1024, 128) > 2.9e5);
  for (const std::int32_t x : {-128, 0}) (void)check_parts(x, -128, 0, 128, 32);
  const std::int32_t at_surface = static_cast<std::int32_t>(ball.radius / resolution) & ~31;
  CHECK(check_parts(at_surface, -32, 0, 32, 1) > 0.0);
}

TEST_CASE("cutting out a ball removes every voxel that touches it and no other", "[scene][unit]") {
  const std::vector<Cell> cells{{{-32, -32, -32}, 64}};
  const Ball ball{{0.02, -0.03, 0.01}, 0.13};
  const double resolution = 0.02;
  const std::vector<Capsule> capsules{{ball.center, ball.center, ball.radius}};
  const auto [kept, voxels, leaves] = cut_out(cells, resolution, capsules);
  const auto distance = [&](const VoxelBox& voxel) {
    const Box box = to_metres(voxel, resolution);
    return (box.lo - ball.center).cwiseMax(ball.center - box.hi).cwiseMax(0.0).norm();
  };
  double expected = 0.0;
  for (std::int32_t x = -32; x < 32; ++x)
    for (std::int32_t y = -32; y < 32; ++y)
      for (std::int32_t z = -32; z < 32; ++z)
        expected += distance(VoxelBox{{x, y, z}, {x + 1, y + 1, z + 1}}) > ball.radius ? 1.0 : 0.0;
  CHECK(volume(kept) == expected);
  CHECK(static_cast<double>(voxels) == volume(cells) - expected);
  CHECK(leaves == 1);
  for (const Cell& cell : kept) CHECK(distance(box_of(cell)) > ball.radius);
}
