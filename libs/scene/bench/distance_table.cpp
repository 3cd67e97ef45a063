// Prints, for one map and one crop, the cost of a distance query and the largest error against brute force over all
// leaf boxes: ours cold, warm and several, beside FCL's octree and dynamicEDT3D where they are installed. Same points,
// same run.
#include <fmt/format.h>
#include <octomap/OcTree.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <string>
#include <vector>
#ifdef HAMELIN_WITH_FCL
#include <fcl/geometry/octree/octree.h>
#include <fcl/narrowphase/distance.h>
#endif
#ifdef HAMELIN_WITH_EDT
#include <dynamicEDT3D/dynamicEDTOctomap.h>
#endif

#include "hamelin/core/error.hpp"
#include "hamelin/scene/distance.hpp"
#include "hamelin/scene/map_file.hpp"
#include "hamelin/test/scene_queries.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;
using Eigen::Vector3d;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

struct Row {
  std::string method;
  double build_ms = 0.0;
  double query_ns = 0.0;
  double over_mm = 0.0, under_mm = 0.0;  // largest errors to the unsafe and to the safe side
};

// The best of several passes over all points; the answers of the last.
template <typename Query>
Row measure(const std::string& method, double build_s, const std::vector<Vector3d>& points,
            const std::vector<double>& truth, int passes, const Query& query) {
  Row row{method, 1e3 * build_s, std::numeric_limits<double>::infinity(), 0.0, 0.0};
  std::vector<double> answers(points.size());
  for (int pass = 0; pass < passes; ++pass) {
    const auto start = Clock::now();
    for (std::size_t i = 0; i < points.size(); ++i) answers[i] = query(points[i]);
    row.query_ns = std::min(row.query_ns, 1e9 * seconds_since(start) / static_cast<double>(points.size()));
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    row.over_mm = std::max(row.over_mm, 1e3 * (std::max(answers[i], 0.0) - truth[i]));
    row.under_mm = std::max(row.under_mm, 1e3 * (truth[i] - std::max(answers[i], 0.0)));
  }
  return row;
}

void print(const Row& row) {
  fmt::print("{:<34} {:>10.2f} {:>12.0f} {:>12.2g} {:>12.2g}\n", row.method, row.build_ms, row.query_ns, row.over_mm,
             row.under_mm);
}

int run(int argc, char** argv) {
  if (argc < 6) {
    fmt::print(stderr,
               "usage: {} MAP X Y Z RADIUS [SCALE]   (crop in the map's frame, m)\n"
               "example: {} map.bt 0.5 0 1 1.35\n",
               argv[0], argv[0]);
    return 2;
  }
  const std::string file = argv[1];
  const Ball region{{std::atof(argv[2]), std::atof(argv[3]), std::atof(argv[4])}, std::atof(argv[5])};
  const double scale = argc > 6 ? std::atof(argv[6]) : 1.0;

  auto start = Clock::now();
  const MapData map = read_map(file, {scale, 0.5});
  const double read_s = seconds_since(start);
  start = Clock::now();
  const auto cells = crop(map.occupied, map.resolution, region);
  std::vector<Box> merged;
  for (const VoxelBox& box : merge(cells)) merged.push_back(to_metres(box, map.resolution));
  const double merge_s = seconds_since(start);
  const BoxField field(merged, region.center);
  const double build_s = seconds_since(start);
  if (field.empty()) throw Error(ErrorCode::invalid, fmt::format("{}: no occupied leaf in that ball", file));
  std::vector<Box> leaves;
  for (const Cell& cell : cells) leaves.push_back(to_metres(cell, map.resolution));
  fmt::print("{}: resolution {} m, {} leaves, {} in the ball, {} boxes; read {:.1f} ms, crop and merge {:.1f} ms\n",
             file, map.resolution, map.occupied.size(), leaves.size(), field.boxes().size(), 1e3 * read_s,
             1e3 * merge_s);

  const auto points = test::points_near(leaves, 4000, 0.5, 1);
  std::vector<double> truth;
  for (const Vector3d& p : points) truth.push_back(test::brute_force_distance(leaves, p));
  std::vector<Vector3d> moved;  // each point again, 2 mm on
  Rng rng(2);
  for (const Vector3d& p : points) moved.push_back(p + 0.002 * test::random_direction(rng));
  std::vector<double> truth_moved;
  for (const Vector3d& p : moved) truth_moved.push_back(test::brute_force_distance(leaves, p));

  fmt::print("{:<34} {:>10} {:>12} {:>12} {:>12}\n", "method", "build ms", "ns a query", "over mm", "under mm");
  constexpr double infinity = std::numeric_limits<double>::infinity();
  const int passes = 15;
  print(measure("hamelin, cold", build_s, points, truth, passes, [&](const Vector3d& p) {
    BoxHit hit;
    return field.nearest(p, infinity, hit) ? hit.distance : infinity;
  }));
  std::vector<std::int32_t> hints;
  for (const Vector3d& p : points) {
    BoxHit hit;
    hints.push_back(field.nearest(p, infinity, hit) ? hit.box : -1);
  }
  std::size_t at = 0;
  print(measure("hamelin, warm (2 mm on)", build_s, moved, truth_moved, passes, [&](const Vector3d& p) {
    BoxHit hit;
    const std::int32_t hint = hints[at];
    at = at + 1 == hints.size() ? 0 : at + 1;
    return field.nearest(p, infinity, hit, hint) ? hit.distance : infinity;
  }));
  BoxField::Scratch scratch(field);
  std::array<BoxHit, 3> hits;
  print(measure("hamelin, 3 points within 0.25 m", build_s, points, truth, passes, [&](const Vector3d& p) {
    const std::size_t count = field.several(p, 0.25, std::cos(std::acos(-1.0) / 6.0), scratch, hits);
    return count > 0 ? hits[0].distance : -1.0;  // beyond the limit; shown as an error to the safe side
  }));

  if (scale != 1.0) return 0;
  const auto tree = std::make_shared<octomap::OcTree>(map.resolution);
  for (const Cell& cell : cells) {
    // The crop as a tree of its own, at the finest depth.
    for (std::int32_t x = 0; x < cell.size; ++x)
      for (std::int32_t y = 0; y < cell.size; ++y)
        for (std::int32_t z = 0; z < cell.size; ++z) {
          const auto key = [](std::int32_t i) { return static_cast<octomap::key_type>(i + (1 << 15)); };
          tree->setNodeValue(octomap::OcTreeKey(key(cell.lo[0] + x), key(cell.lo[1] + y), key(cell.lo[2] + z)), 3.5F,
                             true);
        }
  }
  tree->updateInnerOccupancy();
  tree->prune();
#ifdef HAMELIN_WITH_FCL
  const fcl::OcTreed octree(tree);
  const double radius = 1e-3;
  const fcl::Sphered sphere(radius);
  const std::vector<Vector3d> few(points.begin(), points.begin() + 400);
  print(measure("FCL octree and sphere", 0.0, few, truth, 1, [&](const Vector3d& p) {
    fcl::Transform3d pose = fcl::Transform3d::Identity();
    pose.translation() = p;
    const fcl::DistanceRequestd request;
    fcl::DistanceResultd result;
    fcl::distance(&octree, fcl::Transform3d::Identity(), &sphere, pose, request, result);
    return result.min_distance > 0.0 ? result.min_distance + radius : 0.0;
  }));
#else
  fmt::print("FCL was not found when this was built\n");
#endif
#ifdef HAMELIN_WITH_EDT
  start = Clock::now();
  const Vector3d lo = region.center.array() - region.radius - 0.5, hi = region.center.array() + region.radius + 0.5;
  const auto point = [](const Vector3d& p) {
    return octomap::point3d(static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()));
  };
  DynamicEDTOctomap edt(1.0F, tree.get(), point(lo), point(hi), false);
  edt.update();
  const double edt_s = seconds_since(start);
  // Beyond its largest distance it answers that distance; a metre covers the points.
  print(measure("dynamicEDT3D", edt_s, points, truth, passes,
                [&](const Vector3d& p) { return static_cast<double>(edt.getDistance(point(p))); }));
#else
  fmt::print("dynamicEDT3D was not found when this was built\n");
#endif
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 2;
  }
}
