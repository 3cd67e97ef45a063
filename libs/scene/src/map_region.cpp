#include "hamelin/scene/map_region.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "hamelin/core/error.hpp"

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

MapRegion read_region(const MapSpec& map, const geometry::SE3& base, double reach, double influence) {
  if (!(reach >= 0.0 && influence >= 0.0 && std::isfinite(reach) && std::isfinite(influence)))
    throw Error(ErrorCode::usage, fmt::format("{}: reach {} m and influence {} m, expected finite numbers from 0 up",
                                              map.file.string(), reach, influence));
  MapData data = read_map(map.file, {map.scale, map.occupancy_threshold});
  const Eigen::Vector3d center = map.pose.inverse() * base.p();
  MapRegion region;
  region.resolution_m = data.resolution;
  region.ball = {center, reach + influence};
  region.reachable = {center, reach};
  region.occupied = crop(data.occupied, data.resolution, region.ball);

  MapSummary& summary = region.summary;
  summary.has_map = true;
  summary.map_file = data.file;
  summary.map_sha256 = data.sha256;
  summary.resolution_m = data.resolution;
  summary.nodes = data.node_count;
  summary.leaves = data.occupied.size();
  summary.leaves_cropped = region.occupied.size();
  summary.unknown = map.unknown;
  summary.warnings = std::move(data.warnings);
  const double ball_volume = 4.0 / 3.0 * std::numbers::pi * reach * reach * reach;
  if (ball_volume > 0.0)
    summary.unknown_share =
        std::clamp(volume_inside(data.unknown, data.resolution, region.reachable) / ball_volume, 0.0, 1.0);
  if (map.unknown != UnknownPolicy::free) {
    region.unknown = crop(data.unknown, data.resolution, region.ball);
    if (map.keep_out_radius_m > 0.0)
      region.unknown = cut_out(region.unknown, data.resolution, {center, map.keep_out_radius_m});
  }
  if (!data.occupied.empty() && region.occupied.empty())
    summary.warnings.push_back(fmt::format(
        "no occupied leaf within {:.3g} m of the base: are base, map pose and scale right?", region.ball.radius));
  return region;
}

}  // namespace hamelin::scene
