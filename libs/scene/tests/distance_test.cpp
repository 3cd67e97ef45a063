#include "hamelin/scene/distance.hpp"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <string>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/scene/boxes.hpp"
#include "hamelin/scene/map_file.hpp"
#include "hamelin/test/scene_data.hpp"
#include "hamelin/test/scene_queries.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;
using Eigen::Vector3d;

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
    if (std::all_of(cells.begin(), cells.end(),
                    [&](const Cell& other) { return apart(cell, other); }))
      cells.push_back(cell);
  }
  std::vector<Box> boxes;
  for (const Cell& cell : cells) boxes.push_back(to_metres(cell, 0.02));
  return boxes;
}

// The result of nearest_distinct(), from its definition and all boxes.
std::vector<BoxHit> distinct_by_definition(const std::vector<Box>& boxes, const Vector3d& p,
                                           double limit, double cosine, std::size_t most) {
  std::vector<BoxHit> all, kept;
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    all.push_back(closest_on_box(p, boxes[i]));
    all.back().box = static_cast<std::int32_t>(i);
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const BoxHit& a, const BoxHit& b) { return a.distance < b.distance; });
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

namespace {

void check_closest(const std::filesystem::path& file, double scale, Ball region) {
  CAPTURE(file);
  const MapData map = read_map(file, {scale, 0.5});
  auto cells = crop(map.occupied, map.resolution, region);
  if (cells.size() < 500) {  // put the ball where the map is
    region.center = to_metres(map.occupied[map.occupied.size() / 2], map.resolution).lo;
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
    worst = std::max({worst, std::abs(std::max(cold.distance, 0.0) - truth),
                      std::abs(warm.distance - cold.distance)});
    inside += cold.distance < 0.0 ? 1 : 0;
    // The point lies on a box of the union, at the distance that was returned.
    const double off = test::brute_force_distance(leaves, cold.point);
    wrong_point +=
        off > 1e-9 || std::abs((p - cold.point).norm() - std::abs(cold.distance)) > 1e-9 ? 1 : 0;
  }
  CHECK(missing == 0);
  CHECK(wrong_point == 0);
  CHECK(inside > 0);
  CHECK(worst <= 1e-9);
}

}  // namespace

TEST_CASE("closest points equal brute force over all leaf boxes of our maps", "[scene][unit]") {
  for (const char* name : {"shelf.bt", "clutter.bt"})
    check_closest(test::data / "maps" / name, 1.0, {{0.4, 0.0, 0.5}, 0.8});
}

TEST_CASE("closest points equal brute force over all leaf boxes of three real maps",
          "[scene][unit]") {
  const auto directory = test::shared_data("maps");
  check_closest(directory / "velma_hanas.bt", 1.0, {{0.5, 0.0, 1.0}, 1.35});
  check_closest(directory / "geb079.bt", 1.0, {{-1.0, 2.0, 0.5}, 3.0});
  check_closest(directory / "coal_env.bt", 0.001, {{0.0, 0.0, 0.0}, 1.0});
}

TEST_CASE("nearest respects its limit exactly and a hint does not change the result",
          "[scene][property]") {
  const auto seed = GENERATE(range(std::uint64_t{0}, std::uint64_t{10}));
  CAPTURE(seed);
  Rng rng(seed);
  const BoxField field(random_boxes(rng, 1 + rng.below(300)));
  for (const Vector3d& p : test::points_near(field.boxes(), 200, 0.5, seed)) {
    const double truth = test::brute_force_distance(field.boxes(), p);
    BoxHit hit, hinted;
    REQUIRE(field.nearest(p, infinity, hit));
    CHECK(std::max(0.0, hit.distance) == Approx(truth).margin(1e-12));
    REQUIRE(
        field.nearest(p, 1.0, hinted, static_cast<std::int32_t>(rng.below(field.boxes().size()))));
    CHECK(hinted.box == hit.box);
    CHECK(hinted.distance == hit.distance);
    if (truth > 1e-6) {
      CHECK(field.nearest(p, truth * (1.0 + 1e-12), hit));
      CHECK_FALSE(field.nearest(p, truth * (1.0 - 1e-12), hit));
    }
  }
}

TEST_CASE("nearest_distinct returns what its definition says", "[scene][property]") {
  const auto seed = GENERATE(range(std::uint64_t{0}, std::uint64_t{10}));
  CAPTURE(seed);
  Rng rng(seed);
  const BoxField field(random_boxes(rng, 1 + rng.below(400)));
  BoxField::Scratch scratch(field);
  const double cosine = std::cos(std::acos(-1.0) / 6.0);
  for (const Vector3d& p : test::points_near(field.boxes(), 100, 0.3, seed)) {
    const double limit = rng.uniform(0.0, 0.4);
    std::array<BoxHit, 3> hits;
    const std::size_t count = field.nearest_distinct(p, limit, cosine, scratch, hits);
    const auto expected = distinct_by_definition(field.boxes(), p, limit, cosine, hits.size());
    REQUIRE(count == expected.size());
    for (std::size_t i = 0; i < count; ++i) {
      CHECK(hits[i].box == expected[i].box);
      CHECK(hits[i].distance == expected[i].distance);
      CHECK(hits[i].direction == expected[i].direction);
    }
  }
}

TEST_CASE(
    "a segment's nearest point of a box minimises a convex function, its deepest point maximises a "
    "concave one",
    "[scene][property]") {
  Rng rng(21);
  int entered = 0, clear = 0;
  for (int i = 0; i < 3000; ++i) {
    Box box;
    for (int axis = 0; axis < 3; ++axis) {
      box.lo[axis] = rng.uniform(-0.5, 0.4);
      box.hi[axis] = box.lo[axis] + rng.uniform(0.01, 0.5);
    }
    Vector3d a, b;
    for (int axis = 0; axis < 3; ++axis) {
      a[axis] = rng.uniform(-1.0, 1.0);
      b[axis] = rng.below(5) == 0
                    ? a[axis]
                    : rng.uniform(-1.0, 1.0);          // often parallel to faces, sometimes a point
      if (rng.below(10) == 0) a[axis] = box.lo[axis];  // and often in their planes
    }
    if (i % 3 == 0) b = box.lo + rng.uniform() * (box.hi - box.lo);
    const SegmentHit hit = closest_on_box(a, b, box);
    CHECK((hit.axis_point - (a + hit.along * (b - a))).norm() <= 1e-15);
    CHECK(hit.along >= 0.0);
    CHECK(hit.along <= 1.0);
    const BoxHit from_there = closest_on_box(hit.axis_point, box);
    CHECK(hit.distance == from_there.distance);
    CHECK(hit.point == from_there.point);
    // golden section on the distance outside, and on the depth where the distance is zero
    const auto least = [&](const auto& f) {
      double left = 0.0, right = 1.0;
      for (int k = 0; k < 100; ++k) {
        const double x = left + 0.382 * (right - left), y = left + 0.618 * (right - left);
        if (f(x) < f(y))
          right = y;
        else
          left = x;
      }
      return std::min({f(left), f(0.0), f(1.0)});
    };
    const auto outside = [&](double t) {
      const Vector3d p = a + t * (b - a);
      return (box.lo - p).cwiseMax(p - box.hi).cwiseMax(0.0).norm();
    };
    const auto shallow = [&](double t) {
      const Vector3d p = a + t * (b - a);
      return -(p - box.lo).cwiseMin(box.hi - p).minCoeff();
    };
    const double distance = least(outside);
    if (distance > 1e-7) {
      ++clear;
      CHECK(hit.distance == Approx(distance).margin(1e-12));
    } else if (least(shallow) < -1e-7) {
      ++entered;
      CHECK(hit.distance == Approx(least(shallow)).margin(1e-12));
    }
  }
  CHECK(clear > 500);
  CHECK(entered > 500);
}

TEST_CASE("nearest_distinct of a rugged floor is what its definition says, from near and far",
          "[scene][property]") {
  // many small boxes around a point: nodes are large and near, and most of their boxes are in one
  // cone
  const auto seed = GENERATE(range(std::uint64_t{0}, std::uint64_t{6}));
  CAPTURE(seed);
  Rng rng(seed);
  std::vector<Box> boxes;
  for (int x = 0; x < 30; ++x)
    for (int y = 0; y < 30; ++y) {
      const double z = 0.02 * static_cast<double>(rng.below(5));
      boxes.push_back({{0.02 * x, 0.02 * y, z}, {0.02 * x + 0.02, 0.02 * y + 0.02, z + 0.02}});
    }
  const BoxField field(boxes, {5.0, -3.0, 2.0});
  BoxField::Scratch scratch(field);
  for (int i = 0; i < 150; ++i) {
    const Vector3d p(rng.uniform(-0.1, 0.7), rng.uniform(-0.1, 0.7), rng.uniform(-0.05, 0.4));
    const double cosine =
        rng.below(4) == 0 ? rng.uniform(-0.5, 0.99) : std::cos(std::acos(-1.0) / 6.0);
    std::array<BoxHit, 5> hits;
    const std::size_t count = field.nearest_distinct(p, 0.3, cosine, scratch, hits);
    const auto expected = distinct_by_definition(field.boxes(), p, 0.3, cosine, hits.size());
    REQUIRE(count == expected.size());
    for (std::size_t k = 0; k < count; ++k) {
      CHECK(hits[k].distance == expected[k].distance);
      CHECK(hits[k].direction == expected[k].direction);
    }
  }
}

// What nearest_distinct() finds with and without a vicinity along a walk with small and large
// steps. Returns how many of the queries found anything.
std::size_t compare_along_walk(const BoxField& field, BoxField::Vicinity& near, Rng& rng) {
  BoxField::Scratch scratch(field);
  std::size_t found = 0;
  const std::vector<Vector3d> places = test::points_near(field.boxes(), 12, 0.3, rng.below(1000));
  Vector3d a = places.front();
  Vector3d axis = 0.3 * test::random_direction(rng);
  const double cosine = rng.below(3) == 0 ? rng.uniform(-0.5, 0.99) : 0.86602540378443865;
  for (int i = 0; i < 120; ++i) {
    a += 0.004 * test::random_direction(rng);
    if (i % 10 == 0) a = places[static_cast<std::size_t>(i) / 10];
    axis += 0.002 * test::random_direction(rng);
    const Vector3d b = a + axis;
    const double limit = rng.below(20) == 0 ? 0.3 : 0.2;
    std::array<BoxHit, 3> hits, same;
    const std::size_t count = field.nearest_distinct(a, limit, cosine, scratch, hits);
    REQUIRE(field.nearest_distinct(a, limit, cosine, scratch, same, &near) == count);
    for (std::size_t k = 0; k < count; ++k) {
      CHECK(same[k].box == hits[k].box);
      CHECK(same[k].distance == hits[k].distance);
    }
    std::array<SegmentHit, 3> axis_hits, same_axis;
    const std::size_t on_axis = field.nearest_distinct(a, b, limit, cosine, scratch, axis_hits);
    REQUIRE(field.nearest_distinct(a, b, limit, cosine, scratch, same_axis, &near) == on_axis);
    for (std::size_t k = 0; k < on_axis; ++k) {
      CHECK(same_axis[k].box == axis_hits[k].box);
      CHECK(same_axis[k].distance == axis_hits[k].distance);
    }
    found += count > 0 ? 1 : 0;
  }
  return found;
}

TEST_CASE("with a vicinity nearest_distinct finds the same, also after changes of the field",
          "[scene][property]") {
  const auto seed = GENERATE(range(std::uint64_t{0}, std::uint64_t{12}));
  CAPTURE(seed);
  Rng rng(seed);
  BoxField field(random_boxes(rng, 20 + rng.below(600)), {0.4, -0.1, 0.2});
  BoxField::Vicinity near;
  std::size_t found = 0;
  for (int round = 0; round < 4; ++round) {
    found += compare_along_walk(field, near, rng);
    const auto removed = static_cast<std::int32_t>(rng.below(field.first_added()));
    if (!field.alive(static_cast<std::size_t>(removed))) continue;
    const Vector3d lo(1.5, 0.1 * round, 0.0);
    field.change(std::array{removed}, std::array{Box{lo, lo + Vector3d::Constant(0.05)}});
  }
  CHECK(found > 100);
  // another field, with more boxes near than a vicinity holds
  std::vector<Box> fine;
  for (int x = 0; x < 40; ++x)
    for (int y = 0; y < 40; ++y)
      fine.push_back({{0.01 * x, 0.01 * y, 0.0}, {0.01 * x + 0.01, 0.01 * y + 0.01, 0.01}});
  CHECK(compare_along_walk(BoxField(fine), near, rng) > 50);
}

TEST_CASE("nearest and nearest_distinct of a segment are those of all boxes", "[scene][property]") {
  const auto seed = GENERATE(range(std::uint64_t{0}, std::uint64_t{10}));
  CAPTURE(seed);
  Rng rng(seed);
  const BoxField field(random_boxes(rng, 1 + rng.below(400)));
  BoxField::Scratch scratch(field);
  const double cosine = std::cos(std::acos(-1.0) / 6.0);
  for (const Vector3d& a : test::points_near(field.boxes(), 100, 0.4, seed)) {
    const Vector3d b = a + rng.uniform(0.0, 0.5) * test::random_direction(rng);
    std::vector<SegmentHit> all;
    for (const Box& box : field.boxes()) all.push_back(closest_on_box(a, b, box));
    const auto nearer = [](const SegmentHit& x, const SegmentHit& y) {
      return x.distance < y.distance;
    };
    const SegmentHit least = *std::min_element(all.begin(), all.end(), nearer);
    SegmentHit hit;
    REQUIRE(field.nearest(a, b, infinity, hit));
    CHECK(std::max(hit.distance, 0.0) == Approx(std::max(least.distance, 0.0)).margin(1e-12));
    if (least.distance <= 0.0) continue;  // which of the entered boxes is returned is not defined
    CHECK_FALSE(field.nearest(a, b, least.distance * (1.0 - 1e-9), hit));
    SegmentHit hinted;
    REQUIRE(
        field.nearest(a, b, infinity, hinted, static_cast<std::int32_t>(rng.below(all.size()))));
    CHECK(hinted.box == hit.box);
    std::stable_sort(all.begin(), all.end(), nearer);
    std::vector<SegmentHit> expected;
    for (const SegmentHit& other : all) {
      if (other.distance > 0.25 || expected.size() == 3) break;
      if (std::none_of(expected.begin(), expected.end(), [&](const SegmentHit& kept) {
            return kept.direction.dot(other.direction) > cosine &&
                   std::abs(kept.along - other.along) < 1.0 / 3.0;
          }))
        expected.push_back(other);
    }
    std::array<SegmentHit, 3> hits;
    REQUIRE(field.nearest_distinct(a, b, 0.25, cosine, scratch, hits) == expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      CHECK(hits[i].distance == Approx(expected[i].distance).margin(1e-12));
      CHECK((hits[i].point - expected[i].point).norm() <= 1e-9);
    }
  }
}

TEST_CASE("all instruction sets give the same bits", "[scene][unit]") {
  const Isa before = default_isa();
  Rng rng(12);
  const std::vector<Box> boxes = random_boxes(rng, 1000);
  std::vector<Vector3d> points, ends;
  for (int i = 0; i < 500; ++i) {
    points.push_back(1.5 * rng.uniform() * test::random_direction(rng));
    ends.push_back(points.back() + 0.4 * rng.uniform() * test::random_direction(rng));
  }
  std::vector<double> first;
  std::string missing;
  for (const Isa isa : {Isa::baseline, Isa::v3, Isa::v4}) {
    if (!is_available(isa)) {
      missing += " " + std::string(name_of(isa));
      continue;
    }
    set_default_isa(isa);
    const BoxField field(boxes);
    BoxField::Scratch scratch(field);
    std::vector<double> all;
    std::array<BoxHit, 3> hits;
    std::array<SegmentHit, 3> segment_hits;
    BoxField::Vicinity vicinity;
    for (std::size_t i = 0; i < points.size(); ++i) {
      BoxHit hit;
      if (field.nearest(points[i], 1.0, hit))
        all.insert(all.end(), {hit.distance, hit.point.x(), static_cast<double>(hit.box)});
      SegmentHit segment;
      if (field.nearest(points[i], ends[i], 1.0, segment))
        all.insert(all.end(), {segment.distance, segment.along, static_cast<double>(segment.box)});
      const std::size_t n = field.nearest_distinct(points[i], 0.5, 0.8, scratch, hits);
      for (std::size_t k = 0; k < n; ++k)
        all.insert(all.end(), {hits[k].distance, static_cast<double>(hits[k].box)});
      const std::size_t n_near =
          field.nearest_distinct(points[i], 0.2, 0.8, scratch, hits, &vicinity);
      for (std::size_t k = 0; k < n_near; ++k)
        all.insert(all.end(), {hits[k].distance, static_cast<double>(hits[k].box)});
      const std::size_t m =
          field.nearest_distinct(points[i], ends[i], 0.5, 0.8, scratch, segment_hits);
      for (std::size_t k = 0; k < m; ++k)
        all.insert(all.end(), {segment_hits[k].distance, static_cast<double>(segment_hits[k].box)});
    }
    if (first.empty()) first = all;
    CHECK(all == first);
  }
  set_default_isa(before);
  CHECK(first.size() > 1000);
  test::skip_unless(missing.empty(), "this machine is without" + missing);
}

TEST_CASE("queries far from the origin, on wide boxes and on an empty field are exact",
          "[scene][unit]") {
  const BoxField none;
  BoxHit hit;
  CHECK_FALSE(none.nearest({0.0, 0.0, 0.0}, infinity, hit));
  const std::vector<Box> boxes{{{0.0, 0.0, 0.0}, {1638.4, 1638.4, 1638.4}},
                               {{-0.05, 0.0, 0.0}, {0.0, 0.05, 0.05}}};
  const BoxField field(boxes, {-1.0, 0.0, 0.0});
  REQUIRE(field.nearest({-0.3, 0.01, 0.01}, 1.0, hit));
  CHECK(hit.distance == Approx(0.25).epsilon(1e-15));
  REQUIRE(field.nearest({-0.3, 700.01, 0.01}, 1.0, hit));
  CHECK(hit.distance == Approx(0.3).epsilon(1e-12));
  REQUIRE(field.nearest({800.0, 700.0, 10.0}, 1.0, hit));
  CHECK(hit.distance == Approx(-10.0));
}
