#include "hamelin/scene/distance.hpp"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/scene/boxes.hpp"
#include "hamelin/scene/map_file.hpp"
#include "hamelin/test/scene_data.hpp"
#include "hamelin/test/scene_queries.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;
using Eigen::Vector3d;

constexpr double infinity = std::numeric_limits<double>::infinity();

std::vector<Box> random_boxes(Rng& rng, std::size_t count) {
  std::vector<Cell> cells;
  const auto apart = [](const Cell& a, const Cell& b) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (a.lo[axis] + a.size <= b.lo[axis] || b.lo[axis] + b.size <= a.lo[axis]) return true;
    return false;
  };
  while (cells.size() < count) {
    Cell cell{{}, std::int32_t{1} << rng.below(4)};
    for (auto& lo : cell.lo) lo = static_cast<std::int32_t>(rng.below(120)) - 60;
    if (std::all_of(cells.begin(), cells.end(), [&](const Cell& other) { return apart(cell, other); }))
      cells.push_back(cell);
  }
  std::vector<Box> boxes;
  for (const Cell& cell : cells) boxes.push_back(to_metres(cell, 0.02));
  return boxes;
}

// What several() promises, from its definition and all boxes.
std::vector<BoxHit> several_by_definition(const std::vector<Box>& boxes, const Vector3d& p, double limit, double cosine,
                                          std::size_t most) {
  std::vector<BoxHit> all, kept;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    all.push_back(closest_on_box(p, boxes[i]));
    all.back().box = static_cast<std::int32_t>(i);
  }
  std::stable_sort(all.begin(), all.end(), [](const BoxHit& a, const BoxHit& b) { return a.distance < b.distance; });
  for (const BoxHit& hit : all) {
    if (hit.distance > limit || kept.size() == most) break;
    if (std::none_of(kept.begin(), kept.end(),
                     [&](const BoxHit& k) { return k.direction.dot(hit.direction) > cosine; }))
      kept.push_back(hit);
  }
  return kept;
}

}  // namespace

TEST_CASE("distance, point and direction of one box agree with closed forms", "[scene][unit]") {
  const Box box{{-1.0, -2.0, -3.0}, {1.0, 2.0, 3.0}};
  const BoxHit face = closest_on_box({1.5, 0.3, -0.7}, box);
  CHECK(face.distance == 0.5);
  CHECK(face.point == Vector3d(1.0, 0.3, -0.7));
  CHECK(face.direction == Vector3d::UnitX());
  const BoxHit corner = closest_on_box({2.0, -4.0, 5.0}, box);
  CHECK(corner.distance == Approx(3.0).epsilon(1e-15));
  CHECK((corner.direction - Vector3d(1.0, -2.0, 2.0) / 3.0).norm() < 1e-15);
  const BoxHit inside = closest_on_box({0.2, -1.9, 0.0}, box);
  CHECK(inside.distance == Approx(-0.1).epsilon(1e-14));
  CHECK(inside.point == Vector3d(0.2, -2.0, 0.0));
  CHECK(inside.direction == -Vector3d::UnitY());
  const BoxHit on = closest_on_box({0.5, 0.5, 3.0}, box);
  CHECK(on.distance == 0.0);
  CHECK(on.direction == Vector3d::UnitZ());
}

TEST_CASE("closest points equal brute force over all leaf boxes of three real maps", "[scene][unit]") {
  const auto directory = test::shared_data("maps");
  if (!directory) return;
  struct Case {
    std::string name;
    double scale;
    Ball region;
  };
  const std::vector<Case> cases{{"velma_hanas.bt", 1.0, {{0.5, 0.0, 1.0}, 1.35}},
                                {"geb079.bt", 1.0, {{-1.0, 2.0, 0.5}, 3.0}},
                                {"coal_env.bt", 0.001, {{0.0, 0.0, 0.0}, 1.0}}};
  for (const Case& c : cases) {
    CAPTURE(c.name);
    const MapData map = read_map(*directory / c.name, {c.scale, 0.5});
    auto cells = crop(map.occupied, map.resolution, c.region);
    Ball region = c.region;
    if (cells.size() < 500) {  // put the ball where the map is
      const Box first = to_metres(map.occupied[map.occupied.size() / 2], map.resolution);
      region.center = first.lo;
      cells = crop(map.occupied, map.resolution, region);
    }
    REQUIRE(cells.size() >= 500);
    std::vector<Box> leaves, merged;
    for (const Cell& cell : cells) leaves.push_back(to_metres(cell, map.resolution));
    for (const VoxelBox& box : merge(cells)) merged.push_back(to_metres(box, map.resolution));
    const BoxField field(merged, region.center);
    double worst = 0.0;
    std::int32_t hint = -1;
    std::size_t missing = 0, inside = 0, wrong_point = 0;
    for (const Vector3d& p : test::points_near(leaves, 10000, 0.5, 11)) {
      const double truth = test::brute_force_distance(leaves, p);
      BoxHit cold, warm;
      if (!field.nearest(p, infinity, cold) || !field.nearest(p, infinity, warm, hint)) {
        ++missing;
        continue;
      }
      hint = warm.box;
      worst =
          std::max({worst, std::abs(std::max(cold.distance, 0.0) - truth), std::abs(warm.distance - cold.distance)});
      inside += cold.distance < 0.0 ? 1 : 0;
      // The point is on the union's boxes, and as far away as it says.
      const double off = test::brute_force_distance(leaves, cold.point);
      wrong_point += off > 1e-9 || std::abs((p - cold.point).norm() - std::abs(cold.distance)) > 1e-9 ? 1 : 0;
    }
    CHECK(missing == 0);
    CHECK(wrong_point == 0);
    CHECK(inside > 0);
    CHECK(worst <= 1e-9);
  }
}

TEST_CASE("nearest obeys its limit exactly and a hint changes nothing", "[scene][property]") {
  const auto seed = GENERATE(range(std::uint64_t{0}, std::uint64_t{10}));
  CAPTURE(seed);
  Rng rng(seed);
  const BoxField field(random_boxes(rng, 1 + rng.below(300)));
  for (const Vector3d& p : test::points_near(field.boxes(), 200, 0.5, seed)) {
    const double truth = test::brute_force_distance(field.boxes(), p);
    BoxHit hit, hinted;
    REQUIRE(field.nearest(p, infinity, hit));
    CHECK(std::max(0.0, hit.distance) == Approx(truth).margin(1e-12));
    REQUIRE(field.nearest(p, 1.0, hinted, static_cast<std::int32_t>(rng.below(field.boxes().size()))));
    CHECK(hinted.box == hit.box);
    CHECK(hinted.distance == hit.distance);
    if (truth > 1e-6) {
      CHECK(field.nearest(p, truth * (1.0 + 1e-12), hit));
      CHECK_FALSE(field.nearest(p, truth * (1.0 - 1e-12), hit));
    }
  }
}

TEST_CASE("several returns what its definition says", "[scene][property]") {
  const auto seed = GENERATE(range(std::uint64_t{0}, std::uint64_t{10}));
  CAPTURE(seed);
  Rng rng(seed);
  const BoxField field(random_boxes(rng, 1 + rng.below(400)));
  BoxField::Scratch scratch(field);
  const double cosine = std::cos(std::acos(-1.0) / 6.0);
  for (const Vector3d& p : test::points_near(field.boxes(), 100, 0.3, seed)) {
    const double limit = rng.uniform(0.0, 0.4);
    std::array<BoxHit, 3> hits;
    const std::size_t count = field.several(p, limit, cosine, scratch, hits);
    const auto expected = several_by_definition(field.boxes(), p, limit, cosine, hits.size());
    REQUIRE(count == expected.size());
    for (std::size_t i = 0; i < count; ++i) {
      CHECK(hits[i].box == expected[i].box);
      CHECK(hits[i].distance == expected[i].distance);
      CHECK(hits[i].direction == expected[i].direction);
    }
  }
}

TEST_CASE("a far table never says far of what is near, and says it of most that is far", "[scene][property]") {
  const auto seed = GENERATE(range(std::uint64_t{0}, std::uint64_t{5}));
  CAPTURE(seed);
  Rng rng(seed);
  const BoxField field(random_boxes(rng, 1 + rng.below(200)));
  const Ball region{rng.uniform(0.0, 0.5) * test::random_direction(rng), 1.0};
  const FarTable table(field, region, 0.05, 0.3);
  int far = 0, said = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vector3d p = region.center + 1.2 * rng.uniform() * test::random_direction(rng);
    const double limit = rng.uniform(0.0, 0.3), truth = test::brute_force_distance(field.boxes(), p);
    if (table.beyond(p, limit)) {
      CHECK(truth > limit);
      ++said;
    }
    far += truth > limit + 0.0867 && (p - region.center).norm() < 1.0 ? 1 : 0;  // a cell's diagonal
  }
  CHECK(said >= far);
  CHECK(far > 100);
  CHECK_FALSE(FarTable().beyond(region.center, 0.0));
  CHECK_FALSE(FarTable(BoxField(), region, 0.05, 0.3).beyond(region.center, 0.0));
}

TEST_CASE("queries far from the origin, on wide boxes and on none stay exact", "[scene][unit]") {
  const BoxField none;
  BoxHit hit;
  CHECK_FALSE(none.nearest({0.0, 0.0, 0.0}, infinity, hit));
  const std::vector<Box> boxes{{{0.0, 0.0, 0.0}, {1638.4, 1638.4, 1638.4}}, {{-0.05, 0.0, 0.0}, {0.0, 0.05, 0.05}}};
  const BoxField field(boxes, {-1.0, 0.0, 0.0});
  REQUIRE(field.nearest({-0.3, 0.01, 0.01}, 1.0, hit));
  CHECK(hit.distance == Approx(0.25).epsilon(1e-15));
  REQUIRE(field.nearest({-0.3, 700.01, 0.01}, 1.0, hit));
  CHECK(hit.distance == Approx(0.3).epsilon(1e-12));
  REQUIRE(field.nearest({800.0, 700.0, 10.0}, 1.0, hit));
  CHECK(hit.distance == Approx(-10.0));
}
