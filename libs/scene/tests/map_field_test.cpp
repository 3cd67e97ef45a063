#include "hamelin/scene/map_field.hpp"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "hamelin/core/numbers.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/test/scene_queries.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;
using Eigen::Vector3d;

constexpr double voxel_m = 0.05;

// Voxels [0, n)³ with a rim of free ones, and the exact signed distance by a loop over all of them.
class Grid {
 public:
  static constexpr std::int32_t n = 14, rim = 2;

  void set(const std::array<std::int32_t, 3>& voxel, bool occupied) {
    cells_[index(voxel)] = occupied;
  }
  void flip_block(Rng& rng, bool occupied, std::vector<Cell>& into) {
    std::array<std::int32_t, 3> lo{}, hi{};
    for (std::size_t i = 0; i < 3; ++i) {
      lo[i] = static_cast<std::int32_t>(rng.below(n));
      hi[i] = std::min(n, lo[i] + 1 + static_cast<std::int32_t>(rng.below(5)));
    }
    for (std::int32_t x = lo[0]; x < hi[0]; ++x)
      for (std::int32_t y = lo[1]; y < hi[1]; ++y)
        for (std::int32_t z = lo[2]; z < hi[2]; ++z) {
          set({x, y, z}, occupied);
          into.push_back({{x, y, z}, 1});
        }
  }
  [[nodiscard]] std::vector<Cell> occupied() const {
    std::vector<Cell> cells;
    each([&](const std::array<std::int32_t, 3>& voxel, bool is) {
      if (is) cells.push_back({voxel, 1});
    });
    return cells;
  }
  [[nodiscard]] std::size_t count() const { return occupied().size(); }

  [[nodiscard]] double signed_distance(const Vector3d& p) const {
    double to_occupied = infinity, to_free = infinity;
    each([&](const std::array<std::int32_t, 3>& voxel, bool is) {
      const Box box = to_metres(Cell{voxel, 1}, voxel_m);
      const double distance = (box.lo - p).cwiseMax(p - box.hi).cwiseMax(0.0).norm();
      (is ? to_occupied : to_free) = std::min(is ? to_occupied : to_free, distance);
    });
    return to_occupied > 0.0 ? to_occupied : -to_free;
  }

 private:
  template <class F>
  void each(const F& f) const {
    for (std::int32_t x = -rim; x < n + rim; ++x)
      for (std::int32_t y = -rim; y < n + rim; ++y)
        for (std::int32_t z = -rim; z < n + rim; ++z)
          f(std::array<std::int32_t, 3>{x, y, z}, cells_[index({x, y, z})]);
  }
  static std::size_t index(const std::array<std::int32_t, 3>& v) {
    constexpr std::int32_t side = n + 2 * rim;
    return static_cast<std::size_t>(((v[0] + rim) * side + v[1] + rim) * side + v[2] + rim);
  }
  std::vector<bool> cells_ =
      std::vector<bool>(static_cast<std::size_t>((n + 2 * rim) * (n + 2 * rim) * (n + 2 * rim)));
};

const Ball reachable{Vector3d::Constant(0.35), 0.8};

Vector3d random_point(Rng& rng) {
  return {rng.uniform(-0.1, 0.8), rng.uniform(-0.1, 0.8), rng.uniform(-0.1, 0.8)};
}

// A random point; every other one in an occupied voxel.
Vector3d random_point(Rng& rng, const Grid& grid) {
  const std::vector<Cell> cells = grid.occupied();
  if (cells.empty() || rng.below(2) == 0) return random_point(rng);
  const Box box = to_metres(cells[rng.below(cells.size())], voxel_m);
  return box.lo + rng.uniform() * (box.hi - box.lo);
}

Grid random_grid(Rng& rng) {
  Grid grid;
  std::vector<Cell> unused;
  for (int i = 0; i < 12; ++i) grid.flip_block(rng, rng.below(4) != 0, unused);
  return grid;
}

void check_point(const MapField& field, const Grid& grid, const Vector3d& p) {
  const double truth = grid.signed_distance(p);
  BoxHit hit;
  REQUIRE(field.nearest(p, infinity, hit));
  CHECK(hit.distance == Approx(truth).margin(1e-12));
  // The nearest point lies on the surface, along the direction, which points away from what is
  // occupied.
  CHECK((hit.point + hit.distance * hit.direction - p).norm() <= 1e-12);
  CHECK(hit.direction.norm() == Approx(1.0));
  CHECK(std::abs(grid.signed_distance(hit.point)) <= 1e-12);
}

}  // namespace

TEST_CASE(
    "a map's distance is signed: inside it is minus that to the nearest free voxel, in the exit "
    "direction",
    "[scene][property]") {
  const auto seed = GENERATE(range(std::uint64_t{0}, std::uint64_t{8}));
  CAPTURE(seed);
  Rng rng(seed);
  const Grid grid = random_grid(rng);
  const MapField field(grid.occupied(), voxel_m, reachable.center);
  MapField::Scratch scratch(field);
  int inside = 0;
  for (int i = 0; i < 60; ++i) {
    const Vector3d p = random_point(rng, grid);
    check_point(field, grid, p);
    std::array<BoxHit, MapField::points_max> hits;
    const std::size_t count = field.nearest_distinct(p, 0.3, scratch, hits);
    const double truth = grid.signed_distance(p);
    CHECK((count > 0) == (truth <= 0.3));
    if (count > 0) CHECK(hits[0].distance == Approx(truth).margin(1e-12));
    if (truth < 0.0) CHECK(count == 1);
    inside += truth < 0.0 ? 1 : 0;
  }
  CHECK(inside > 0);
}

TEST_CASE("the surface of a large map is found from inside, also where its nearest part is far",
          "[scene][unit]") {
  // A block of 900 × 40 × 40 voxels with a shaft, and a lone voxel far from it.
  const VoxelBox block_voxels{{-10, 0, 0}, {890, 40, 40}},
      shaft_voxels{{400, 19, 3}, {401, 20, 40}};
  const Box block = to_metres(block_voxels, voxel_m), shaft = to_metres(shaft_voxels, voxel_m);
  MapField field({{{0, 0, 2000}, 1}}, voxel_m, Vector3d::Zero());
  field.change({block_voxels}, {});
  field.change({}, {shaft_voxels});
  Rng rng(3);
  for (int i = 0; i < 300; ++i) {
    const Vector3d share{rng.uniform(), rng.uniform(), rng.uniform()};
    const Vector3d p = block.lo + share.cwiseProduct(block.hi - block.lo);
    const double to_shaft = (shaft.lo - p).cwiseMax(p - shaft.hi).cwiseMax(0.0).norm();
    if (to_shaft == 0.0) continue;
    const double depth = std::min({to_shaft, (p - block.lo).minCoeff(), (block.hi - p).minCoeff()});
    BoxHit hit;
    REQUIRE(field.nearest(p, infinity, hit));
    CHECK(hit.distance == Approx(-depth).margin(1e-12));
  }
}

TEST_CASE("on the surface the direction is the normal that leads out", "[scene][unit]") {
  // two boxes that cannot be one: an L
  const std::vector<Cell> cells{{{0, 0, 0}, 2}, {{2, 0, 0}, 1}};
  const MapField field(cells, 1.0, {0.0, 0.0, 0.0});
  BoxHit hit;
  const auto direction = [&](const Vector3d& p) {
    REQUIRE(field.nearest(p, 0.0, hit));
    CHECK(std::abs(hit.distance) <= 1e-12);
    return hit.direction;
  };
  CHECK(direction({1.5, 1.0, 2.0}) == Vector3d::UnitZ());
  CHECK(direction({0.0, 1.0, 1.5}) == -Vector3d::UnitX());
  CHECK(direction({2.5, 0.5, 1.0}) == Vector3d::UnitZ());
  // there is no surface where the boxes touch
  REQUIRE(field.nearest({2.0, 0.5, 0.5}, 0.0, hit));
  CHECK(hit.distance == Approx(-0.5));
  CHECK(std::abs(hit.direction.x()) <= 1e-12);
}

TEST_CASE("a capsule's axis is as deep as its deepest point, and as near as its nearest",
          "[scene][property]") {
  const auto seed = GENERATE(range(std::uint64_t{0}, std::uint64_t{8}));
  CAPTURE(seed);
  Rng rng(seed);
  const Grid grid = random_grid(rng);
  const MapField field(grid.occupied(), voxel_m, reachable.center);
  MapField::Scratch scratch(field);
  int inside = 0;
  for (int i = 0; i < 25; ++i) {
    const Vector3d a = random_point(rng, grid),
                   b = i % 5 == 0 ? a : a + rng.uniform(0.05, 0.4) * test::random_direction(rng);
    SegmentHit hit;
    REQUIRE(field.nearest(a, b, infinity, hit));
    CHECK(hit.distance == Approx(grid.signed_distance(hit.axis_point)).margin(1e-12));
    // Samples bound the least signed distance from above, and with their spacing from below.
    constexpr int samples = 400;
    double least = infinity;
    for (int k = 0; k <= samples; ++k)
      least =
          std::min(least, grid.signed_distance(a + (static_cast<double>(k) / samples) * (b - a)));
    CHECK(hit.distance <= least + 1e-9);
    CHECK(hit.distance >= least - (b - a).norm() / samples);
    inside += hit.distance < 0.0 ? 1 : 0;
    std::array<SegmentHit, MapField::points_max> hits;
    if (field.nearest_distinct(a, b, 1.0, scratch, hits) > 0)
      CHECK(hits[0].distance == hit.distance);
  }
  CHECK(inside > 0);
}

TEST_CASE("a map that changed gives the distances of a map built in that state",
          "[scene][property]") {
  const auto seed = GENERATE(range(std::uint64_t{0}, std::uint64_t{8}));
  CAPTURE(seed);
  Rng rng(seed);
  Grid grid = seed == 0 ? Grid() : random_grid(rng);
  MapField field(grid.occupied(), voxel_m, reachable.center);
  for (int round = 0; round < 12; ++round) {
    CAPTURE(round);
    // queried before the change, so that the table contains the old state
    for (int i = 0; i < 20; ++i) {
      BoxHit hit;
      (void)field.nearest(random_point(rng), infinity, hit,
                          static_cast<std::int32_t>(rng.below(50)));
    }
    const Grid before = grid;
    std::vector<Cell> add, remove;
    if (round % 3 != 1) grid.flip_block(rng, false, remove);
    if (round % 3 != 2) grid.flip_block(rng, true, add);
    const MapField::Changed changed = field.change(merge(add), merge(remove));
    // voxels that are occupied now and were not before; those removed and added again count for
    // both
    Grid without = before;
    for (const Cell& cell : remove) without.set(cell.lo, false);
    CHECK(changed.removed == before.count() - without.count());
    CHECK(changed.added == grid.count() - without.count());
    const MapField rebuilt(grid.occupied(), voxel_m, reachable.center);
    MapField::Scratch scratch(field), scratch_rebuilt(rebuilt);
    for (int i = 0; i < 15; ++i) {
      const Vector3d p = random_point(rng, grid), q = random_point(rng);
      if (grid.count() == 0) continue;
      check_point(field, grid, p);
      SegmentHit hit, hit_rebuilt;
      REQUIRE(field.nearest(p, q, infinity, hit));
      REQUIRE(rebuilt.nearest(p, q, infinity, hit_rebuilt));
      CHECK(hit.distance == Approx(hit_rebuilt.distance).margin(1e-9));
      std::array<BoxHit, MapField::points_max> hits, hits_rebuilt;
      const std::size_t count = field.nearest_distinct(p, 0.3, scratch, hits);
      REQUIRE((count > 0) == (rebuilt.nearest_distinct(p, 0.3, scratch_rebuilt, hits_rebuilt) > 0));
      if (count > 0) CHECK(hits[0].distance == Approx(hits_rebuilt[0].distance).margin(1e-12));
    }
  }
}

TEST_CASE("a field whose boxes are all removed is empty, and many additions rebuild the tree",
          "[scene][unit]") {
  MapField field({{{0, 0, 0}, 8}}, 0.1, {0.0, 0.0, 0.0});
  BoxHit hit;
  CHECK(field.change({}, {{{0, 0, 0}, {8, 8, 8}}}).removed == 512);
  CHECK_FALSE(field.nearest({0.4, 0.4, 0.4}, infinity, hit));
  CHECK(field.change({}, {{{0, 0, 0}, {8, 8, 8}}}).removed == 0);
  std::vector<Cell> dust;
  for (std::int32_t i = 0; i < 40; ++i)
    for (std::int32_t j = 0; j < 40; ++j) dust.push_back({{2 * i, 2 * j, (i + j) % 7 * 2}, 1});
  CHECK(field.change(merge(dust), {}).added == dust.size());
  for (const Cell& cell : dust) {
    REQUIRE(field.nearest(0.1 * Vector3d(cell.lo[0] + 0.5, cell.lo[1] + 0.5, cell.lo[2] + 1.2),
                          infinity, hit));
    CHECK(hit.distance == Approx(0.02));
  }
}
