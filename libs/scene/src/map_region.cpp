#include "hamelin/scene/map_region.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "hamelin/core/error.hpp"
#include "hamelin/scene/sensors.hpp"

namespace hamelin::scene {

std::string_view to_string(UnknownPolicy policy) noexcept {
  switch (policy) {
    case UnknownPolicy::free:
      return "free";
    case UnknownPolicy::slow:
      return "slow";
    case UnknownPolicy::block:
      return "block";
  }
  return "unknown";
}

std::string_view to_string(Mount mount) noexcept {
  switch (mount) {
    case Mount::world:
      return "world";
    case Mount::base:
      return "base";
    case Mount::tip:
      return "tip";
    case Mount::frame:
      return "frame";
  }
  return "unknown";
}

namespace {

constexpr std::int32_t tree_half = 1 << 15;  // voxels from the octree's middle to its faces

// Volume in voxels, rounded to an integer so that differences are exact.
double inside(const std::vector<Cell>& cells, const MapData& map, const Ball& ball) {
  return std::round(volume_inside(cells, map.resolution, ball) /
                    (map.resolution * map.resolution * map.resolution));
}

std::vector<Capsule> capsules_of(const Shapes& shapes, const geometry::SE3& map_from_world,
                                 double padding) {
  std::vector<Capsule> capsules;
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    const bool capsule = shapes.is_capsule(i);
    capsules.push_back({map_from_world * (capsule ? shapes.from(i) : shapes.centers[i]),
                        map_from_world * (capsule ? shapes.to(i) : shapes.centers[i]),
                        shapes.radii[i] + padding});
  }
  return capsules;
}

// Removes the robot from the map, or counts the leaves that it touches.
void filter_robot(const MapSpec& map, const RobotAtStart& robot,
                  const geometry::SE3& map_from_world, MapRegion& region) {
  MapSummary& summary = region.summary;
  summary.self_filter_padding_m = map.self_filter_padding_m;
  if (!map.self_filter_padding_m) {
    const auto arm = capsules_of(robot.arm, map_from_world, 0.0);
    summary.leaves_in_arm = count_touched(region.occupied, region.resolution_m, arm);
    if (summary.leaves_in_arm > 0)
      summary.warnings.push_back(
          fmt::format("the map may contain the robot itself: {} occupied leaves touch the arm at "
                      "its start; see the "
                      "scene's map.self_filter",
                      summary.leaves_in_arm));
    return;
  }
  auto shapes = capsules_of(robot.arm, map_from_world, *map.self_filter_padding_m);
  const auto base = capsules_of(robot.base, map_from_world, *map.self_filter_padding_m);
  shapes.insert(shapes.end(), base.begin(), base.end());
  if (shapes.empty())
    throw Error(ErrorCode::invalid,
                "self_filter: the robot has no collision shapes, expected at least one");
  CutOut occupied = cut_out(region.occupied, region.resolution_m, shapes);
  summary.self_filter_voxels = occupied.voxels;
  summary.self_filter_leaves = occupied.leaves;
  region.occupied = std::move(occupied.cells);
  CutOut unknown = cut_out(region.unknown, region.resolution_m, shapes);
  summary.self_filter_unknown_voxels = unknown.voxels;
  region.unknown = std::move(unknown.cells);
  summary.warnings.push_back(
      fmt::format("the self-filter removed {} occupied voxels ({} leaves) and {} unknown voxels "
                  "within {:.3g} m of the robot at "
                  "its start",
                  summary.self_filter_voxels, summary.self_filter_leaves,
                  summary.self_filter_unknown_voxels, *map.self_filter_padding_m));
}

// Cells of moderate size, since later changes of the map cut them.
std::vector<Cell> cells_around(const Ball& ball, double resolution) {
  constexpr std::int32_t edge = 64;
  std::array<std::int32_t, 3> lo{}, hi{};
  for (std::size_t i = 0; i < 3; ++i) {
    const double cell = edge * resolution, center = ball.center[static_cast<Eigen::Index>(i)];
    const auto at = [&](double x) {
      constexpr std::int32_t cells = tree_half / edge;
      constexpr double most = cells;
      return static_cast<std::int32_t>(std::clamp(std::floor(x / cell), -most, most - 1.0));
    };
    lo[i] = at(center - ball.radius);
    hi[i] = at(center + ball.radius) + 1;
  }
  std::vector<Cell> cells;
  for (std::int32_t z = lo[2]; z < hi[2]; ++z)
    for (std::int32_t y = lo[1]; y < hi[1]; ++y)
      for (std::int32_t x = lo[0]; x < hi[0]; ++x)
        cells.push_back({{edge * x, edge * y, edge * z}, edge});
  return crop(cells, resolution, ball);
}

// Refuses or warns where unknown space matters and most of the reachable ball is unknown.
void check_unknown_share(const MapSpec& map, MapSummary& summary) {
  if (map.file.empty() || !summary.within_reach || summary.within_reach->unknown <= 0.5) return;
  const Shares& shares = *summary.within_reach;
  const double percent = 100.0 * shares.unknown;
  if (shares.free > 0.0) {
    summary.warnings.push_back(
        fmt::format("unknown space is {:.0f} % of what is within reach, and its policy is \"{}\"",
                    percent, to_string(map.unknown)));
    return;
  }
  const std::string finding = fmt::format(
      "{} is free within reach, {:.0f} % of it is unknown",
      summary.free_leaves == 0 ? "the map has no free leaf: nothing" : "nothing", percent);
  if (map.unknown == UnknownPolicy::block)
    throw Error(ErrorCode::invalid,
                fmt::format("{}, and \"block\" makes unknown space an obstacle; expected a map "
                            "with free space, or the policy "
                            "\"free\" or \"slow\"",
                            finding));
  summary.warnings.push_back(finding + ": \"slow\" slows all motion down");
}

}  // namespace

// docs/theory.md (11.38)
Shares shares_within(const MapData& map, const Ball& ball) {
  const double analytic = 4.0 / 3.0 * std::numbers::pi * ball.radius * ball.radius * ball.radius;
  if (!(analytic > 0.0)) return {};
  const std::vector<Cell> tree{{{-tree_half, -tree_half, -tree_half}, 2 * tree_half}};
  const double in_tree = inside(tree, map, ball), edge = tree_half * map.resolution;
  const bool reaches_out = (ball.center.array().abs() + ball.radius > edge).any();
  // The same voxels are counted in each volume, so a ball without unknown cells has no unknown
  // share at all.
  const double voxel = map.resolution * map.resolution * map.resolution;
  const double all = reaches_out ? std::max(in_tree, analytic / voxel) : in_tree;
  if (!(all > 0.0)) return {};
  const double occupied = inside(map.occupied, map, ball), unknown = inside(map.unknown, map, ball);
  const double free = std::max(0.0, in_tree - occupied - unknown);
  return {occupied / all, free / all, (all - in_tree + unknown) / all};
}

Shares shares_within_reach(const MapSpec& map, const geometry::SE3& base, double reach) {
  const Ball ball{map.pose.inverse() * base.p(), reach};
  return shares_within(read_map(map, ball), ball);
}

MapData read_map(const MapSpec& map, const Ball& ball) {
  if (!map.file.empty()) return read_map(map.file, {map.scale, map.occupancy_threshold});
  if (!(map.resolution_m > 0.0) || !std::isfinite(map.resolution_m))
    throw Error(
        ErrorCode::invalid,
        fmt::format("map: resolution_m: {} m given, expected a number above 0", map.resolution_m));
  MapData data;
  data.file = "map without a file";
  data.resolution = map.resolution_m;
  data.unknown = cells_around(ball, map.resolution_m);
  return data;
}

MapRegion read_region(const MapSpec& map, const geometry::SE3& base, double reach, double influence,
                      const RobotAtStart& robot) {
  if (!(reach >= 0.0 && influence >= 0.0 && std::isfinite(reach) && std::isfinite(influence)))
    throw Error(ErrorCode::usage,
                fmt::format("{}: reach {} m and influence {} m, expected finite numbers from 0 up",
                            map.file.string(), reach, influence));
  const geometry::SE3 map_from_world = map.pose.inverse();
  const Eigen::Vector3d center = map_from_world * base.p();
  MapData data = read_map(map, {center, reach + influence});
  MapRegion region;
  region.resolution_m = data.resolution;
  region.ball = {center, reach + influence};
  region.reachable = {center, reach};

  MapSummary& summary = region.summary;
  summary.has_map = true;
  summary.map_file = data.file;
  summary.map_sha256 = data.sha256;
  summary.resolution_m = data.resolution;
  summary.nodes = data.node_count;
  summary.leaves = data.occupied.size();
  summary.free_leaves = data.free_leaves;
  summary.unknown = map.unknown;
  summary.warnings = std::move(data.warnings);
  if (map.unknown != UnknownPolicy::free)
    summary.within_reach = shares_within(data, region.reachable);
  region.occupied = crop(data.occupied, data.resolution, region.ball);
  summary.leaves_cropped = region.occupied.size();
  if (!data.occupied.empty() && region.occupied.empty())
    summary.warnings.push_back(
        fmt::format("no occupied leaf within {:.3g} m of the base: check the base, the map's pose "
                    "and its scale",
                    region.ball.radius));
  if (map.unknown != UnknownPolicy::free)
    region.unknown = crop(data.unknown, data.resolution, region.ball);
  try {
    check_unknown_share(map, summary);
    filter_robot(map, robot, map_from_world, region);
    if (map.keep_out_radius_m > 0.0) {
      const std::array<Capsule, 1> keep_out{{{center, center, map.keep_out_radius_m}}};
      region.unknown = cut_out(region.unknown, data.resolution, keep_out).cells;
    }
  } catch (const Error& e) {
    throw Error(e.code(), fmt::format("{}: {}", data.file, e.what()));
  }
  return region;
}

}  // namespace hamelin::scene
