#include "hamelin/scene/distance_field.hpp"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <thread>
#include <vector>

#include "hamelin/core/isa.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/scene.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;
using Eigen::Vector3d;

VoxelBox random_box(Rng& rng, std::int32_t extent, std::int32_t size) {
  VoxelBox box;
  for (std::size_t i = 0; i < 3; ++i) {
    box.lo[i] =
        static_cast<std::int32_t>(rng.below(static_cast<std::uint64_t>(extent))) - extent / 2;
    box.hi[i] =
        box.lo[i] + 1 + static_cast<std::int32_t>(rng.below(static_cast<std::uint64_t>(size)));
  }
  return box;
}

std::vector<VoxelBox> random_boxes(Rng& rng, int count, std::int32_t extent, std::int32_t size) {
  std::vector<VoxelBox> boxes;
  for (int i = 0; i < count; ++i) boxes.push_back(random_box(rng, extent, size));
  return boxes;
}

double exact_distance(const std::vector<VoxelBox>& boxes, const Vector3d& p, double resolution) {
  double least = 1e9;
  for (const VoxelBox& voxels : boxes) {
    const Box box = to_metres(voxels, resolution);
    least = std::min(least, (box.lo - p).cwiseMax(p - box.hi).cwiseMax(0.0).norm());
  }
  return least;
}

// Boxes without the voxels of a hole, and with those of another box.
void apply(std::vector<VoxelBox>& boxes, const std::vector<VoxelBox>& free,
           const std::vector<VoxelBox>& occupied) {
  for (const VoxelBox& hole : free) subtract(boxes, hole);
  boxes.insert(boxes.end(), occupied.begin(), occupied.end());
}

void check_equal(const DistanceField& a, const DistanceField& b) {
  const DistanceField::View x = a.view(), y = b.view();
  REQUIRE(x.lo == y.lo);
  REQUIRE(x.count == y.count);
  const std::size_t count = static_cast<std::size_t>(x.count[0]) *
                            static_cast<std::size_t>(x.count[1]) *
                            static_cast<std::size_t>(x.count[2]);
  CHECK(std::equal(x.values, x.values + count, y.values));
}

}  // namespace

TEST_CASE("the distance field's nodes have the exact distances, rounded down to its unit",
          "[scene][field]") {
  Rng rng(3);
  for (int map = 0; map < 6; ++map) {
    const auto boxes = random_boxes(rng, 1 + 4 * map, 40 + 20 * map, 1 + 2 * map);
    const auto field = DistanceField::make(boxes, 0.05);
    REQUIRE(field);
    const DistanceField::View view = field->view();
    for (int i = 0; i < 3000; ++i) {
      std::array<std::int32_t, 3> node{};
      Vector3d p;
      for (std::size_t k = 0; k < 3; ++k) {
        node[k] = static_cast<std::int32_t>(rng.below(static_cast<std::uint64_t>(view.count[k])));
        p[static_cast<Eigen::Index>(k)] = 0.05 * (view.lo[k] + node[k]);
      }
      const double exact = std::min(field->cap_m(), exact_distance(boxes, p, 0.05));
      const double stored =
          view.unit_m * view.values[(node[2] * view.count[1] + node[1]) * view.count[0] + node[0]];
      CHECK(stored <= exact + 1e-12);
      CHECK(stored > exact - 1.0001 * view.unit_m);
    }
  }
}

TEST_CASE("the distance field's bounds are never above the exact distance, and near it",
          "[scene][field]") {
  Rng rng(4);
  for (int map = 0; map < 8; ++map) {
    const double resolution = map % 2 == 0 ? 0.01 : 0.1;
    const auto boxes = random_boxes(rng, 2 + 6 * map, 60, 12);
    const auto field = DistanceField::make(boxes, resolution);
    REQUIRE(field);
    double lost = 0.0;
    int near = 0;
    for (int i = 0; i < 20000; ++i) {
      Vector3d p;
      for (int k = 0; k < 3; ++k) p[k] = resolution * rng.uniform(-70.0, 70.0);
      const double exact = exact_distance(boxes, p, resolution), bound = field->lower_bound(p);
      CHECK(bound <= exact);
      if (exact > 3.0 * resolution && exact < 8.0 * resolution) {
        ++near;
        lost += (exact - bound) / resolution;
      }
    }
    if (near > 100) CHECK(lost / near < 0.15);
  }
}

TEST_CASE("a distance field after many changes is that of the voxels it has now, to the bit",
          "[scene][field]") {
  Rng rng(5);
  for (int map = 0; map < 2; ++map) {
    std::vector<VoxelBox> boxes = random_boxes(rng, 30, 110, 8);
    auto field = DistanceField::make(boxes, 0.02);
    REQUIRE(field);
    for (int step = 0; step < 20; ++step) {
      // small changes far from each other, none, large ones, and some beyond the box
      const int kind = step % 5;
      const auto free = random_boxes(rng, kind, 120, kind == 4 ? 60 : 10);
      const auto occupied = random_boxes(rng, kind % 3, kind == 2 ? 150 : 90, 6);
      apply(boxes, free, occupied);
      REQUIRE(field->change(free, occupied));
      check_equal(*field, *DistanceField::make(boxes, 0.02));
    }
    const std::vector<VoxelBox> all{{{-400, -400, -400}, {400, 400, 400}}};
    REQUIRE(field->change(all, {}));
    CHECK(field->empty());
    CHECK(field->lower_bound(Vector3d::Zero()) == field->cap_m());
    REQUIRE(field->change({}, boxes));
    check_equal(*field, *DistanceField::make(boxes, 0.02));
  }
}

TEST_CASE("a distance field has the same bits on all instruction sets", "[scene][field]") {
  Rng rng(6);
  const auto boxes = random_boxes(rng, 40, 120, 10);
  const Isa usual = default_isa();
  const auto field = DistanceField::make(boxes, 0.02);
  for (const Isa isa : {Isa::baseline, Isa::v3, Isa::v4}) {
    if (!is_available(isa)) continue;
    set_default_isa(isa);
    check_equal(*field, *DistanceField::make(boxes, 0.02));
  }
  set_default_isa(usual);
}

TEST_CASE("there is no distance field of more than 64 MB", "[scene][field]") {
  const std::vector<VoxelBox> one{{{0, 0, 0}, {1, 1, 1}}},
      far{{{4000, 4000, 4000}, {4001, 4001, 4001}}};
  auto field = DistanceField::make(one, 0.01);
  REQUIRE(field);
  CHECK(field->bytes() < 20000);
  CHECK_FALSE(field->change({}, far));
  std::vector<VoxelBox> both = one;
  both.push_back(far[0]);
  CHECK_FALSE(DistanceField::make(both, 0.01));
  CHECK(DistanceField::make({}, 0.01)->empty());
}

TEST_CASE("an environment carries its distance field over changes of the map", "[scene][field]") {
  const Scene scene =
      read_scene(std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/scenes/clutter.json");
  REQUIRE(scene.map);
  const auto make = [&] { return Environment(scene.map, {}, scene.base, 1.0, 0.3); };
  const Environment environment = make();
  std::vector<std::thread> threads;
  std::array<std::shared_ptr<const DistanceField>, 3> made;
  for (auto& field : made) threads.emplace_back([&] { field = environment.distance_field(); });
  for (auto& thread : threads) thread.join();
  REQUIRE(made[0]);
  CHECK(made[0] == made[1]);
  CHECK(made[0] == made[2]);
  CHECK(environment.with_obstacles({}).distance_field() == made[0]);

  MapChangeSpec change;
  change.free_m = {{{0.1, -0.3, 0.0}, {0.5, 0.2, 0.6}}};
  change.occupied_m = {{{0.3, 0.3, 0.3}, {0.4, 0.4, 0.5}}};
  const Environment changed = environment.with_change(change);
  const Environment other = make().with_change(change);  // has no field yet
  check_equal(*changed.distance_field(), *other.distance_field());
  CHECK(changed.distance_field() != made[0]);
  check_equal(*environment.distance_field(), *make().distance_field());

  // The exact distances of the environment are those that the field bounds.
  Rng rng(7);
  for (int i = 0; i < 2000; ++i) {
    const Vector3d p(rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0), rng.uniform(-0.2, 1.2));
    std::int32_t hint = -1;
    const double exact = changed.map_field().distance(p, p, 10.0, hint);
    CHECK(changed.distance_field()->lower_bound(p) <= exact);
  }
}
