#include "hamelin/scene/map_region.hpp"

#include <octomap/OcTree.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <functional>
#include <sstream>
#include <string>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/make.hpp"
#include "hamelin/test/damaged_maps.hpp"
#include "hamelin/test/temporary.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;
using Eigen::Vector3d;

constexpr double resolution = 0.02;

// A map of the cube ±1.28 m. `kind` of the centre of each voxel is 'o' (occupied), 'f' (free) or
// 'u' (unknown).
class PaintedMap {
 public:
  explicit PaintedMap(const std::function<char(const Vector3d&)>& kind) {
    file = test::temporary("hamelin_scene_painted.bt");
    octomap::OcTree tree(resolution);
    for (int x = -64; x < 64; ++x)
      for (int y = -64; y < 64; ++y)
        for (int z = -64; z < 64; ++z) {
          const char k = kind(resolution * Vector3d(x + 0.5, y + 0.5, z + 0.5));
          if (k == 'u') continue;
          const auto key = [](int i) { return static_cast<octomap::key_type>(i + 32768); };
          tree.setNodeValue(octomap::OcTreeKey(key(x), key(y), key(z)), k == 'o' ? 3.0F : -2.0F,
                            true);
        }
    tree.updateInnerOccupancy();
    std::ostringstream out;
    tree.writeBinary(out);
    write_file_atomically(file, out.str());
    spec.file = file;
  }
  ~PaintedMap() { std::filesystem::remove(file); }
  PaintedMap(const PaintedMap&) = delete;
  PaintedMap& operator=(const PaintedMap&) = delete;

  std::filesystem::path file;
  MapSpec spec;
};

double distance_to_segment(const Vector3d& p, const Vector3d& a, const Vector3d& b) {
  const Vector3d along = b - a;
  const double t = along.squaredNorm() > 0.0
                       ? std::clamp((p - a).dot(along) / along.squaredNorm(), 0.0, 1.0)
                       : 0.0;
  return (p - a - t * along).norm();
}

// The robot of the tests: an arm of a sphere and a slanted capsule on a base that is a sphere.
struct SmallRobot {
  std::vector<Vector3d> centers{{0.3, 0.0, 0.2}, {0.0, 0.25, 0.3}},
      half_axes{Vector3d::Zero(), {0.1, 0.05, 0.2}};
  std::vector<double> radii{0.08, 0.05};
  std::vector<Vector3d> base_center{{0.0, 0.0, -0.1}};
  std::vector<double> base_radius{0.1};

  [[nodiscard]] RobotAtStart at_start() const {
    return {{centers, radii, half_axes}, {base_center, base_radius}};
  }
  // Distance of a point from the moving shapes, or from all shapes.
  [[nodiscard]] double distance(const Vector3d& p, bool with_base) const {
    double least = with_base ? (p - base_center[0]).norm() - base_radius[0] : 1.0;
    for (std::size_t i = 0; i < centers.size(); ++i)
      least = std::min(
          least,
          distance_to_segment(p, centers[i] - half_axes[i], centers[i] + half_axes[i]) - radii[i]);
    return least;
  }
  // How many voxels are within `padding` of the robot, by a fine grid of points of each voxel:
  // those that surely are, and those that may be.
  [[nodiscard]] std::pair<std::size_t, std::size_t> touched(
      const std::function<bool(const Vector3d&)>& counts, double padding, bool with_base) const {
    constexpr int n = 4;
    const double slack = 0.5 * std::sqrt(3.0) * resolution / n;
    std::size_t surely = 0, perhaps = 0;
    for (int x = -40; x < 40; ++x)
      for (int y = -40; y < 40; ++y)
        for (int z = -40; z < 40; ++z) {
          const Vector3d lo = resolution * Vector3d(x, y, z);
          const Vector3d middle = lo.array() + 0.5 * resolution;
          if (!counts(middle) || distance(middle, with_base) > padding + resolution) continue;
          double least = 1.0;
          for (int i = 0; i <= n; ++i)
            for (int j = 0; j <= n; ++j)
              for (int k = 0; k <= n; ++k)
                least =
                    std::min(least, distance(lo + resolution / n * Vector3d(i, j, k), with_base));
          surely += least <= padding ? 1 : 0;
          perhaps += least <= padding + slack ? 1 : 0;
        }
    return {surely, perhaps};
  }
};

std::string refusal(const MapSpec& spec, double reach) {
  try {
    const auto region = read_region(spec, {}, reach, 0.1);
    return {};
  } catch (const Error& e) {
    return e.what();
  }
}

}  // namespace

TEST_CASE("shares within reach are those of the ball's voxels and add up to one", "[scene][unit]") {
  // Known up to z = 0.3 m, with a floor up to −0.2 m.
  const PaintedMap painted([](const Vector3d& p) {
    return p.z() < -0.2 ? 'o' : p.z() < 0.3 ? 'f' : 'u';
  });
  const auto region = read_region(painted.spec, {}, 0.8, 0.1);
  const Shares shares = shares_within_reach(painted.spec, {}, 0.8);
  // Caps of height h: π h² (3r − h)/3.
  const auto cap = [](double h) { return h * h * (3.0 * 0.8 - h) / (4.0 * 0.8 * 0.8 * 0.8); };
  CHECK(shares.occupied == Approx(cap(0.6)).epsilon(0.01));
  CHECK(shares.unknown == Approx(cap(0.5)).epsilon(0.01));
  CHECK(shares.occupied + shares.free + shares.unknown == Approx(1.0).epsilon(1e-14));
  CHECK(region.summary.free_leaves > 0);
  // Outside of the tree everything is unknown; a ball in known space has no unknown share.
  const MapData map = read_map(painted.file);
  CHECK(shares_within(map, {{900.0, 0.0, 0.0}, 0.5}).unknown == 1.0);
  CHECK(shares_within(map, {{0.0, 0.0, -0.1}, 0.3}).unknown == 0.0);
  CHECK(shares_within(map, {{0.0, 0.0, 0.0}, 0.0}).unknown == 0.0);
  // A ball whose centre is on a face of the tree: half of it is outside.
  MapData all;
  all.resolution = 1e-4;
  all.occupied = {{{-32768, -32768, -32768}, 65536}};
  CHECK(shares_within(all, {{3.2768, 0.0, 0.0}, 0.5}).unknown == Approx(0.5).epsilon(1e-3));
}

TEST_CASE("a map without free space is refused if unknown space blocks", "[scene][unit]") {
  const PaintedMap painted(
      [](const Vector3d& p) { return p.norm() > 0.7 && p.norm() < 0.75 ? 'o' : 'u'; });
  MapSpec spec = painted.spec;
  CHECK(refusal(spec, 0.8).empty());
  spec.unknown = UnknownPolicy::slow;
  const auto slow = read_region(spec, {}, 0.8, 0.1);
  CHECK_THAT(slow.summary.warnings.back(), Catch::Contains("slows all motion down"));
  spec.unknown = UnknownPolicy::block;
  const std::string message = refusal(spec, 0.8);
  CHECK_THAT(message, Catch::StartsWith(painted.file.string() + ": the map has no free leaf"));
  CHECK_THAT(message, Catch::Contains("\"free\" or \"slow\""));
  // Everything within reach is occupied: no unknown space becomes an obstacle.
  const PaintedMap solid([](const Vector3d& p) { return p.norm() < 1.0 ? 'o' : 'u'; });
  spec = solid.spec;
  spec.unknown = UnknownPolicy::block;
  CHECK(refusal(spec, 0.8).empty());
}

TEST_CASE("a warning gives the unknown share if most of the reachable space is unknown",
          "[scene][unit]") {
  const PaintedMap painted([](const Vector3d& p) {
    return p.norm() < 0.5 ? 'f' : p.norm() < 0.55 ? 'o' : 'u';
  });
  MapSpec spec = painted.spec;
  CHECK(read_region(spec, {}, 0.8, 0.1).summary.warnings.empty());
  spec.unknown = UnknownPolicy::block;
  CHECK_THAT(read_region(spec, {}, 0.8, 0.1).summary.warnings.back(),
             Catch::Contains("68 % of what is within reach"));
}

TEST_CASE("the self-filter removes the voxels that the robot touches, and no other",
          "[scene][property]") {
  const SmallRobot robot;
  // The robot as a sensor saw it, 1 cm too thick, a wall that the padding touches, and unknown
  // space.
  const auto kind = [&](const Vector3d& p) {
    if (robot.distance(p, true) < 0.01 || (p.x() > 0.38 && p.x() < 0.5)) return 'o';
    return p.y() > 0.35 ? 'u' : 'f';
  };
  const PaintedMap painted(kind);
  MapSpec spec = painted.spec;
  const bool turned = GENERATE(false, true);
  geometry::SE3 world;
  if (turned)
    world = geometry::SE3::exp((geometry::Vector6d() << 0.3, -0.2, 0.5, 0.1, 0.7, -0.4).finished());
  spec.pose = world;
  SmallRobot placed = robot;
  for (auto* list : {&placed.centers, &placed.base_center})
    for (auto& c : *list) c = world * c;
  for (auto& axis : placed.half_axes) axis = world.R() * axis;
  const RobotAtStart at_start = placed.at_start();

  const auto seen = read_region(spec, world, 1.0, 0.1, at_start);
  const auto occupied = [&](const Vector3d& p) { return kind(p) == 'o'; };
  std::size_t touching = 0;
  for (const Cell& cell : seen.occupied) {
    const Box box = to_metres(cell, resolution);
    bool touches = false;
    for (std::size_t i = 0; i < robot.centers.size(); ++i)
      touches = touches || closest_on_box(robot.centers[i] - robot.half_axes[i],
                                          robot.centers[i] + robot.half_axes[i], box)
                                   .distance <= robot.radii[i];
    touching += touches ? 1 : 0;
  }
  CHECK(touching > 10);
  CHECK(seen.summary.leaves_in_arm == touching);
  REQUIRE_FALSE(seen.summary.warnings.empty());
  CHECK_THAT(seen.summary.warnings.back(), Catch::Contains("may contain the robot itself"));
  CHECK_FALSE(seen.summary.self_filter_padding_m);

  spec.self_filter_padding_m = 0.03;
  spec.unknown = UnknownPolicy::slow;
  const auto filtered = read_region(spec, world, 1.0, 0.1, at_start);
  const auto [surely, perhaps] = robot.touched(occupied, 0.03, true);
  CHECK(filtered.summary.self_filter_voxels >= surely);
  CHECK(filtered.summary.self_filter_voxels <= perhaps);
  CHECK(perhaps < surely + surely / 10);
  const auto unknown = robot.touched([&](const Vector3d& p) { return kind(p) == 'u'; }, 0.03, true);
  CHECK(unknown.first > 0);
  CHECK(filtered.summary.self_filter_unknown_voxels >= unknown.first);
  CHECK(filtered.summary.self_filter_unknown_voxels <= unknown.second);
  CHECK(filtered.summary.self_filter_leaves > 0);
  CHECK(filtered.summary.leaves_cropped == seen.summary.leaves_cropped);
  const auto count = [](const std::vector<Cell>& cells) {
    double voxels = 0.0;
    for (const Cell& cell : cells) voxels += std::pow(static_cast<double>(cell.size), 3);
    return voxels;
  };
  CHECK(count(seen.occupied) - count(filtered.occupied) ==
        static_cast<double>(filtered.summary.self_filter_voxels));
  CHECK(count(filtered.occupied) > 1000.0);  // the wall remains
  REQUIRE_FALSE(filtered.summary.warnings.empty());
  CHECK_THAT(filtered.summary.warnings.back(), Catch::Contains("the self-filter removed"));

  // After filtering, the arm at its start is clear by the padding.
  const Environment environment(spec, {}, world, 1.0, 0.1, at_start);
  CHECK(environment.clearance(at_start.arm, 0.0, 1.0) > 0.03 - 1e-9);
  spec.self_filter_padding_m.reset();
  CHECK(Environment(spec, {}, world, 1.0, 0.1, at_start).clearance(at_start.arm, 0.0, 1.0) < 0.0);
}

TEST_CASE("a self-filter without shapes, or with voxels far too fine, is refused",
          "[scene][unit]") {
  const PaintedMap painted([](const Vector3d& p) { return p.norm() < 0.2 ? 'o' : 'f'; });
  MapSpec spec = painted.spec;
  spec.self_filter_padding_m = 0.02;
  CHECK_THAT(refusal(spec, 0.8), Catch::Contains("no collision shapes"));
  spec.file = test::temporary("hamelin_scene_region_root.ot");
  write_file_atomically(spec.file, test::occupied_root());
  spec.scale = 1e-3;
  const SmallRobot robot;
  CHECK_THROWS_WITH(read_region(spec, {}, 0.8, 0.1, robot.at_start()), Catch::Contains("too fine"));
  std::filesystem::remove(spec.file);
}
