#include <cmath>

#include "hamelin/scene/motion.hpp"
#include "targets.hpp"

namespace hamelin::fuzz {

void waypoints(std::string_view bytes) {
  const MemoryFile file(bytes);
  std::shared_ptr<const scene::WaypointPath> path;
  if (!accepts(file.path(), [&] {
        path = std::make_shared<scene::WaypointPath>(scene::read_waypoint_path(file.path(), {}));
      }))
    return;
  const auto points = path->waypoints();
  require(points.size() >= 2, "a path has two way-points or more");
  const double bounds = path->speed_max() + path->rate_max() + path->distance_max();
  require(std::isfinite(bounds), "the bounds of a path are finite");
  constexpr int looks = 100;
  const double first = points.front().time_s, last = points.back().time_s;
  for (int k = -1; k <= looks + 1; ++k) {
    const auto at = path->at(first + (last - first) * k / looks);
    require(at.position.allFinite() && at.velocity.allFinite() && at.acceleration.allFinite() &&
                at.rotation.allFinite() && at.angular_velocity.allFinite(),
            "a path has finite poses and velocities");
    require(at.position.norm() <= path->distance_max() * (1.0 + 1e-9) + 1e-9,
            "a path stays within its bound");
    require(at.velocity.norm() <= path->speed_max() * (1.0 + 1e-6) + 1e-6,
            "a path is not faster than its bound");
  }
}

}  // namespace hamelin::fuzz
