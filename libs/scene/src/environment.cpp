#include "hamelin/scene/environment.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "hamelin/core/error.hpp"

namespace hamelin::scene {

Environment::Environment(const std::optional<MapSpec>& map, std::vector<Obstacle> obstacles, const geometry::SE3& base,
                         double reach, double influence)
    : obstacles_(std::move(obstacles)) {
  for (const Obstacle& obstacle : obstacles_) check(obstacle, fmt::format("obstacle '{}'", obstacle.name));
  summary_.obstacles = obstacles_.size();
  if (!map) return;
  const MapRegion region = read_region(*map, base, reach, influence);
  static_cast<MapSummary&>(summary_) = region.summary;
  map_pose_ = map->pose;
  map_pose_inverse_ = map->pose.inverse();
  map_ = MapField(region.occupied, region.resolution_m, region.reachable, influence);
  unknown_ = MapField(region.unknown, region.resolution_m, region.reachable, influence);
  summary_.boxes = map_.boxes().boxes().size();
  summary_.unknown_boxes = unknown_.boxes().boxes().size();
}

Environment::Scratch::Scratch(const Environment& environment, std::size_t spheres)
    : map_(environment.map_), unknown_(environment.unknown_) {
  const std::size_t room = spheres * (2 * points_per_sphere + environment.obstacles_.size());
  found_.reserve(room);
  order_.reserve(room);
}

std::string Environment::words(int obstacle) const {
  if (obstacle == Contact::map) return "the map";
  if (obstacle == Contact::unknown) return "unknown space";
  return fmt::format("obstacle '{}'", obstacles_[static_cast<std::size_t>(obstacle)].name);
}

bool Environment::has_obstacles() const noexcept {
  return !map_.empty() || !obstacles_.empty() || (!unknown_.empty() && summary_.unknown == UnknownPolicy::block);
}

double Environment::clearance_to(const Obstacle& obstacle, std::span<const Eigen::Vector3d> centers,
                                 std::span<const double> radii, double time_s, double limit) const {
  const Eigen::Vector3d at = position_at(obstacle, time_s);
  const double ball = bounding_radius(obstacle);
  double smallest = limit;
  for (std::size_t i = 0; i < centers.size(); ++i) {
    const double near = smallest + radii[i] + ball;
    if (near <= 0.0 || (centers[i] - at).squaredNorm() >= near * near) continue;
    smallest = std::min(smallest, closest_on(obstacle, at, centers[i]).distance - radii[i]);
  }
  return smallest;
}

bool Environment::shown(std::size_t obstacle, double time_s, View view, std::span<const std::uint8_t> seen) const {
  const Obstacle& o = obstacles_[obstacle];
  if (!exists(o, time_s)) return false;
  const bool told = !o.judge_only && (o.known || (obstacle < seen.size() && seen[obstacle] != 0));
  return view == View::judge || told == (view == View::planner);
}

int Environment::see(std::span<const Eigen::Vector3d> centers, std::span<const double> radii, double time_s,
                     std::span<std::uint8_t> seen) const {
  for (std::size_t k = 0; k < obstacles_.size(); ++k) {
    const Obstacle& o = obstacles_[k];
    if (o.known || o.judge_only || !o.visible_within_m || seen[k] != 0 || !exists(o, time_s)) continue;
    // any limit above visible_within_m will do
    if (!visible(o, time_s, clearance_to(o, centers, radii, time_s, 2.0 * *o.visible_within_m + 1.0))) continue;
    seen[k] = 1;
    return static_cast<int>(k);
  }
  return -1;
}

std::size_t Environment::closest(std::span<const Eigen::Vector3d> centers, std::span<const double> radii,
                                 double influence, double time_s, Scratch& scratch, std::span<Contact> out, View view,
                                 std::span<const std::uint8_t> seen) const {
  auto& found = scratch.found_;
  found.clear();
  std::array<BoxHit, points_per_sphere> hits;
  const auto add = [&](std::size_t sphere, int obstacle, double center_distance, const Eigen::Vector3d& point,
                       const Eigen::Vector3d& direction, const Eigen::Vector3d& velocity) {
    found.push_back({static_cast<int>(sphere), obstacle, center_distance - radii[sphere],
                     centers[sphere] - radii[sphere] * direction, point, direction, velocity});
  };
  const auto add_boxes = [&](const MapField& field, MapField::Scratch& room, int id, std::size_t sphere) {
    if (field.empty()) return;
    const std::size_t count = field.several(map_pose_inverse_ * centers[sphere], influence + radii[sphere], room, hits);
    for (std::size_t i = 0; i < count; ++i)
      add(sphere, id, hits[i].distance, map_pose_ * hits[i].point, map_pose_.R() * hits[i].direction,
          Eigen::Vector3d::Zero());
  };
  for (std::size_t sphere = 0; view != View::hidden && sphere < centers.size(); ++sphere) {
    add_boxes(map_, scratch.map_, Contact::map, sphere);
    if (summary_.unknown == UnknownPolicy::block) add_boxes(unknown_, scratch.unknown_, Contact::unknown, sphere);
  }
  for (std::size_t k = 0; k < obstacles_.size(); ++k) {
    if (!shown(k, time_s, view, seen)) continue;
    const Obstacle& obstacle = obstacles_[k];
    const Eigen::Vector3d at = position_at(obstacle, time_s), velocity = velocity_at(obstacle, time_s);
    const double ball = bounding_radius(obstacle);
    for (std::size_t sphere = 0; sphere < centers.size(); ++sphere) {
      const double limit = influence + radii[sphere], near = limit + ball;
      if ((centers[sphere] - at).squaredNorm() > near * near) continue;
      const SurfacePoint hit = closest_on(obstacle, at, centers[sphere]);
      if (hit.distance <= limit) add(sphere, static_cast<int>(k), hit.distance, hit.point, hit.direction, velocity);
    }
  }

  auto& order = scratch.order_;
  order.resize(found.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  if (out.size() < found.size()) {
    std::nth_element(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(out.size()), order.end(),
                     [&](std::size_t a, std::size_t b) {
                       return found[a].distance != found[b].distance ? found[a].distance < found[b].distance : a < b;
                     });
    order.resize(out.size());
  }
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    if (found[a].sphere != found[b].sphere) return found[a].sphere < found[b].sphere;
    return found[a].distance != found[b].distance ? found[a].distance < found[b].distance : a < b;
  });
  for (std::size_t i = 0; i < order.size(); ++i) out[i] = found[order[i]];
  return found.size();
}

double Environment::clearance(std::span<const Eigen::Vector3d> centers, std::span<const double> radii, double time_s,
                              double limit, View view, std::span<const std::uint8_t> seen) const {
  double smallest = limit;
  BoxHit hit;
  const auto consider = [&](const MapField& field) {
    if (field.empty() || view == View::hidden) return;
    std::int32_t hint = -1;
    for (std::size_t i = 0; i < centers.size(); ++i) {
      // Beyond contact the search must not end at a sphere's radius: a deeper one may follow.
      const Eigen::Vector3d local = map_pose_inverse_ * centers[i];
      const double near = std::max(0.0, smallest + radii[i]);
      if (!field.nearest(local, near, hit, hint)) continue;
      hint = hit.box;
      smallest = std::min(smallest, hit.distance - radii[i]);
    }
  };
  consider(map_);
  if (summary_.unknown == UnknownPolicy::block) consider(unknown_);
  for (std::size_t k = 0; k < obstacles_.size(); ++k)
    if (shown(k, time_s, view, seen)) smallest = clearance_to(obstacles_[k], centers, radii, time_s, smallest);
  return smallest;
}

bool Environment::in_slow_space(std::span<const Eigen::Vector3d> centers, std::span<const double> radii) const {
  if (summary_.unknown != UnknownPolicy::slow || unknown_.empty()) return false;
  BoxHit hit;
  for (std::size_t i = 0; i < centers.size(); ++i)
    if (unknown_.nearest(map_pose_inverse_ * centers[i], radii[i], hit)) return true;
  return false;
}

}  // namespace hamelin::scene
