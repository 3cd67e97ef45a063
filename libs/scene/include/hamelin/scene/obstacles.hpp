#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <variant>

#include "hamelin/geometry/se3.hpp"

namespace hamelin::scene {

enum class Shape : std::int32_t { sphere, box, cylinder };

[[nodiscard]] std::string_view to_string(Shape shape) noexcept;

/// A rotation as a file wrote it. Kept beside the pose made from it, so that writing the pose and reading it back gives
/// the same bits; it counts only as long as it still belongs to the pose.
using Quaternion = std::array<double, 4>;

/// Motion p(t) = p_0 + a sin(2πt/T) along a fixed amplitude a, without turning.
struct SineMotion {
  Eigen::Vector3d amplitude_m = Eigen::Vector3d::Zero();
  double period_s = 1.0;
};

/// Motion p(t) = p_0 + v clamp(t − start, 0, duration) on a line, without turning.
struct LinearMotion {
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  double start_s = 0.0;
  double duration_s = std::numeric_limits<double>::infinity();
};

/// A solid primitive in the world.
struct Obstacle {
  std::string name;
  Shape shape = Shape::sphere;
  double radius_m = 0.0;                             ///< sphere, cylinder
  double length_m = 0.0;                             ///< cylinder, along its local z, centred
  Eigen::Vector3d size_m = Eigen::Vector3d::Zero();  ///< box: full edges
  geometry::SE3 pose;                                ///< centre and axes in the world at rest
  Quaternion quaternion_wxyz{1.0, 0.0, 0.0, 0.0};    ///< see Quaternion
  std::optional<std::variant<SineMotion, LinearMotion>> motion;
  bool known = true;                       ///< whether the planner is told of it from the start
  std::optional<double> visible_within_m;  ///< if not known: seen once the arm is this near; none = never
  double appears_s = 0.0;                  ///< before this time it is not there, for nobody
  bool judge_only = false;                 ///< counts for the verdict only; the planner never sees it
};

/// Nearest point of an obstacle's surface.
struct SurfacePoint {
  double distance = 0.0;                                ///< [m]; inside: minus the depth
  Eigen::Vector3d point = Eigen::Vector3d::Zero();      ///< on the surface, world
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< unit outward, the gradient of the distance, world
};

/// Where its centre is at a time [m, world], and how fast it moves [m/s, world].
[[nodiscard]] Eigen::Vector3d position_at(const Obstacle& obstacle, double time_s);
[[nodiscard]] Eigen::Vector3d velocity_at(const Obstacle& obstacle, double time_s);

/// No point of it is ever faster than this [m/s].
[[nodiscard]] double max_speed(const Obstacle& obstacle);

/// Radius of the ball about the centre that holds the obstacle [m].
[[nodiscard]] double bounding_radius(const Obstacle& obstacle);

/// Exact nearest surface point of the obstacle, its centre put at `center`. Where several are equally near (a centre,
/// an axis) one of them, always the same.
[[nodiscard]] SurfacePoint closest_on(const Obstacle& obstacle, const Eigen::Vector3d& center,
                                      const Eigen::Vector3d& p);

/// The nearest pair of an obstacle's surface and the axis of a capsule.
struct AxisPoint : SurfacePoint {
  Eigen::Vector3d axis_point = Eigen::Vector3d::Zero();  ///< on the axis; `distance` is measured from here, world
};

/// The same for the axis from a to b; where it enters the obstacle, its deepest point. Closed forms for sphere and box;
/// for the cylinder, a convex body, the distance is convex along the axis and its minimum is enclosed between tangents
/// until these leave less than 1e-13 of a metre and of the lengths.
[[nodiscard]] AxisPoint closest_on(const Obstacle& obstacle, const Eigen::Vector3d& center, const Eigen::Vector3d& a,
                                   const Eigen::Vector3d& b);

/// Whether the obstacle is there at all.
[[nodiscard]] inline bool exists(const Obstacle& obstacle, double time_s) {
  return time_s >= obstacle.appears_s;
}

/// Whether a planner is shown the obstacle.
/// @param clearance_m smallest distance between arm and obstacle now
[[nodiscard]] bool visible(const Obstacle& obstacle, double time_s, double clearance_m);

/// @throws Error invalid, "where: what is wrong, what was expected", for sizes and times that make no sense
void check(const Obstacle& obstacle, const std::string& where);

}  // namespace hamelin::scene
