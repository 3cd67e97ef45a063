#include "hamelin/sensing/occupancy_grid.hpp"

#include <octomap/octomap.h>

#include <algorithm>
#include <bit>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "hamelin/core/isa.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/test/errors.hpp"

using namespace hamelin;
using sensing::OccupancyGrid;
using State = OccupancyGrid::State;

namespace {

const scene::VoxelBox box{{-70, -31, -12}, {90, 40, 33}};

octomap::point3d to_octomap(const Eigen::Vector3f& p) {
  return {p[0], p[1], p[2]};
}

octomap::OcTreeKey key_of(const OccupancyGrid::Voxel& v) {
  return {static_cast<octomap::key_type>(v[0] + 32768),
          static_cast<octomap::key_type>(v[1] + 32768),
          static_cast<octomap::key_type>(v[2] + 32768)};
}

template <class F>
void for_each_voxel(F&& f) {
  for (std::int32_t z = box.lo[2]; z < box.hi[2]; ++z)
    for (std::int32_t y = box.lo[1]; y < box.hi[1]; ++y)
      for (std::int32_t x = box.lo[0]; x < box.hi[0]; ++x) f(OccupancyGrid::Voxel{x, y, z});
}

// Points on a wall with a hole, some behind it, and some anywhere.
Eigen::Matrix3Xf frame(Rng& rng, double resolution, Eigen::Index count) {
  Eigen::Matrix3Xf points(3, count);
  for (Eigen::Index i = 0; i < count; ++i) {
    const double y = rng.uniform(-40.0, 50.0), z = rng.uniform(-20.0, 40.0);
    Eigen::Vector3d p(60.0 + rng.uniform(-1.0, 1.0), y, z);
    if (std::abs(y) < 8.0) p[0] = 140.0;
    if (i % 7 == 0) p = Eigen::Vector3d::NullaryExpr([&] { return rng.uniform(-150.0, 150.0); });
    if (i % 11 == 0) p = p.array().round();  // on the borders of voxels
    points.col(i) = (resolution * p).cast<float>();
  }
  return points;
}

std::size_t index_of(const OccupancyGrid::Voxel& v) {
  const auto at = [&](int i) { return static_cast<std::size_t>(v[i] - box.lo[i]); };
  const auto size = [&](int i) { return static_cast<std::size_t>(box.hi[i] - box.lo[i]); };
  return at(0) + size(0) * (at(1) + size(1) * at(2));
}

// A grid of one instruction set, and what its insertions have told of each voxel.
struct Told {
  Isa isa;
  OccupancyGrid grid;
  std::vector<State> states = std::vector<State>(
      index_of({box.hi[0] - 1, box.hi[1] - 1, box.hi[2] - 1}) + 1, State::unknown);
  std::size_t wrong_news = 0, different = 0;

  Told(Isa of, double resolution, const sensing::SensorModel& model)
      : isa(of), grid(resolution, box, model) {}

  void insert(const Eigen::Matrix3Xf& points, const Eigen::Vector3f& origin, double range_m) {
    const Isa usual = default_isa();
    set_default_isa(isa);
    for (const OccupancyGrid::Row& row : grid.insert(points, origin, range_m))
      for (int i = 0; i < 64; ++i) {
        const bool occupied = (row.occupied >> i & 1U) != 0, freed = (row.freed >> i & 1U) != 0;
        if (!occupied && !freed) continue;
        State& state = states.at(index_of({row.first[0] + i, row.first[1], row.first[2]}));
        wrong_news += (row.learned >> i & 1U) != (state == State::unknown ? 1U : 0U) ? 1 : 0;
        state = occupied ? State::occupied : State::free;
      }
    set_default_isa(usual);
  }

  // @param log_odds not a number for a voxel of which nothing is known
  void compare(const OccupancyGrid::Voxel& voxel, State wanted, float log_odds) {
    const float value = grid.log_odds(voxel);
    if (grid.state(voxel) != wanted || states[index_of(voxel)] != wanted ||
        (std::isnan(log_odds) ? !std::isnan(value) : value != log_odds))
      ++different;
  }
};

}  // namespace

TEST_CASE("a grid knows the same of each voxel as OctoMap, to the bit", "[sensing][reference]") {
  const double resolution = GENERATE(0.01, 0.025, 0.3);
  const double range_m = GENERATE(std::numeric_limits<double>::infinity(), 100.0) * resolution;
  // with the second, one ray makes a voxel as free as it can be, and most of them soon are
  const sensing::SensorModel model =
      GENERATE(sensing::SensorModel{}, sensing::SensorModel{0.7, 0.4, 0.4, 0.75});
  const Eigen::Index count = model.least == 0.4 ? 12000 : 1500;
  std::vector<Told> grids;  // one for each instruction set
  for (const Isa isa : {Isa::baseline, Isa::v3, Isa::v4})
    if (is_available(isa)) grids.emplace_back(isa, resolution, model);
  octomap::OcTree tree(resolution);
  tree.setProbHit(model.hit);
  tree.setProbMiss(model.miss);
  tree.setClampingThresMin(model.least);
  tree.setClampingThresMax(model.most);
  Rng rng(5);
  for (int k = 0; k < 8; ++k) {
    const Eigen::Matrix3Xf points = frame(rng, resolution, count);
    // within the box, on a border of voxels, and outside
    Eigen::Vector3f origin =
        (resolution * Eigen::Vector3d(rng.uniform(-60.0, 20.0), rng.uniform(-20.0, 20.0), 3.3))
            .cast<float>();
    if (k == 3) origin = (resolution * Eigen::Vector3d(-20.0, 5.0, 4.0)).cast<float>();
    if (k == 5) origin = (resolution * Eigen::Vector3d(-120.0, 60.0, 50.0)).cast<float>();
    octomap::Pointcloud cloud;
    for (Eigen::Index i = 0; i < points.cols(); ++i) cloud.push_back(to_octomap(points.col(i)));
    tree.insertPointCloud(cloud, to_octomap(origin), std::isinf(range_m) ? -1.0 : range_m, false,
                          true);
    for (Told& told : grids) told.insert(points, origin, range_m);
  }
  std::size_t occupied = 0, free = 0;
  for_each_voxel([&](const OccupancyGrid::Voxel& voxel) {
    const octomap::OcTreeNode* const node = tree.search(key_of(voxel));
    const State wanted = node == nullptr             ? State::unknown
                         : tree.isNodeOccupied(node) ? State::occupied
                                                     : State::free;
    occupied += wanted == State::occupied ? 1 : 0;
    free += wanted == State::free ? 1 : 0;
    for (Told& told : grids)
      told.compare(voxel, wanted, node == nullptr ? std::nanf("") : node->getLogOdds());
  });
  CHECK(occupied > 1500);
  CHECK(free > 20000);
  for (const Told& told : grids) {
    CAPTURE(resolution, range_m, name_of(told.isa), count);
    CHECK(told.wrong_news == 0);
    CHECK(told.different == 0);
  }
}

TEST_CASE("what disappears is freed after as many frames as OctoMap needs", "[sensing][unit]") {
  OccupancyGrid grid(0.01, box);
  const Eigen::Vector3f origin(0.005F, 0.005F, 0.005F);
  Eigen::Matrix3Xf near(3, 1), far(3, 1);
  near << 0.305F, 0.005F, 0.005F;
  far << 0.605F, 0.005F, 0.005F;
  const OccupancyGrid::Voxel voxel{30, 0, 0};
  for (int i = 0; i < 20; ++i) (void)grid.insert(near, origin);
  REQUIRE(grid.state(voxel) == State::occupied);
  int frames = 0;
  for (; grid.state(voxel) == State::occupied; ++frames) (void)grid.insert(far, origin);
  CHECK(frames == 9);  // log-odds of 3.5 by 0.405 each
  CHECK(grid.insert(far, origin).empty());
  CHECK(grid.state({90, 0, 0}) == State::unknown);
}

TEST_CASE("voxels between those that rays pass are free", "[sensing][unit]") {
  OccupancyGrid grid(0.01, box);
  // along x, through the voxels with these y and z
  const auto look = [&](float y, float z) {
    const Eigen::Vector3f origin(-0.695F, y, z), point(0.755F, y, z);
    (void)grid.insert(Eigen::Matrix3Xf(point), origin);
    return grid.gaps();
  };
  // the voxel amid four lines, and one beside two of them
  const OccupancyGrid::Voxel amid{62, 5, 5}, beside{62, 6, 6};
  grid.set({{50, 4, 5}, {75, 5, 6}}, State::free);
  grid.set({{50, 6, 5}, {75, 7, 6}}, State::free);
  grid.set({{50, 5, 4}, {75, 6, 5}}, State::free);
  grid.set({{50, 5, 6}, {75, 6, 7}}, State::free);
  CHECK(grid.state(amid) == State::unknown);
  CHECK(look(0.005F, 0.005F).empty());  // nothing next to it was learned
  grid.set({{62, 6, 5}, {63, 7, 6}}, State::unknown);
  const auto rows = look(0.065F, 0.055F);
  std::vector<OccupancyGrid::Voxel> found;
  for (const OccupancyGrid::Row& row : rows) {
    CHECK(row.occupied == 0);
    for (std::uint64_t left = row.freed; left != 0; left &= left - 1)
      found.push_back({row.first[0] + std::countr_zero(left), row.first[1], row.first[2]});
  }
  const auto has = [&](const OccupancyGrid::Voxel& voxel) {
    return std::find(found.begin(), found.end(), voxel) != found.end();
  };
  CHECK(has(amid));
  CHECK_FALSE(has(beside));
  CHECK(grid.state(amid) == State::unknown);
}

TEST_CASE("what rays leave unknown behind a wall stays so", "[sensing][unit]") {
  OccupancyGrid grid(0.01, box);
  const Eigen::Vector3f origin(-0.695F, 0.005F, 0.005F);
  Eigen::Matrix3Xf wall(3, 41 * 41);
  for (int i = 0; i < 41 * 41; ++i)
    wall.col(i) << 0.305F, -0.2F + 0.01F * static_cast<float>(i % 41),
        -0.1F + 0.005F * static_cast<float>(i / 41);
  std::size_t behind = 0;
  for (int k = 0; k < 5; ++k) {
    (void)grid.insert(wall, origin);
    for (const OccupancyGrid::Row& row : grid.gaps())
      for (int i = 0; i < 64; ++i)
        behind += (row.freed >> i & 1U) != 0 && row.first[0] + i >= 30 ? 1 : 0;
  }
  CHECK(behind == 0);
  CHECK(grid.state({35, 0, 0}) == State::unknown);
}

TEST_CASE("grids and frames that make no sense are refused", "[sensing][unit]") {
  const auto refused = [](auto&& f) { return test::error_of(f); };
  using Catch::Contains;
  CHECK_THAT(refused([] { OccupancyGrid(0.0, box); }), Contains("a resolution of 0 m given"));
  CHECK_THAT(refused([] {
               OccupancyGrid(0.01, {{0, 0, 0}, {0, 9, 9}});
             }),
             Contains("voxels 0 to 0"));
  CHECK_THAT(refused([] {
               OccupancyGrid(0.01, {{0, 0, 0}, {4, 4, 32769}});
             }),
             Contains("voxels 0 to 32769"));
  CHECK_THAT(refused([] {
               OccupancyGrid(0.01, {{-32768, -32768, -32768}, {32768, 32768, 32768}});
             }),
             Contains("expected at most 4294967296"));
  CHECK_THAT(refused([] { OccupancyGrid(0.01, box, {1.2}); }),
             Contains("a probability `hit` of 1.2 given"));
  CHECK_THAT(refused([] { OccupancyGrid(0.01, box, {0.4, 0.4}); }), Contains("miss ≤ 0.5 ≤ hit"));
  OccupancyGrid grid(0.01, box);
  Eigen::Matrix3Xf point = Eigen::Matrix3Xf::Constant(3, 1, 0.3F);
  const Eigen::Vector3f zero = Eigen::Vector3f::Zero();
  CHECK_THAT(refused([&] {
               (void)grid.insert(point, {std::nanf(""), 0, 0});
             }),
             Contains("points seen from (nan, 0, 0)"));
  CHECK_THAT(refused([&] { (void)grid.insert(point, {1e9F, 0, 0}); }), Contains("within 32768"));
  CHECK_THAT(refused([&] { (void)grid.insert(point, zero, 0.0); }), Contains("a range of 0 m"));
  point(1, 0) = std::nanf("");
  CHECK_THAT(refused([&] { (void)grid.insert(point, zero); }), Contains("a point is not finite"));
  for_each_voxel([&](const OccupancyGrid::Voxel& v) {
    if (grid.state(v) != State::unknown) FAIL("a refused frame has changed the grid");
  });
  // points without a key, far outside, and in the voxel of the sensor
  point.setConstant(1e9F);
  CHECK(grid.insert(point, zero).empty());
  point.setZero();
  CHECK(grid.insert(point, zero).size() == 1);
  CHECK(grid.insert(Eigen::Matrix3Xf(3, 0), zero).empty());
}
