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

/// A rotation as a file gives it, kept beside the pose that was made from it. If it still belongs
/// to the pose, it is written instead of the pose's rotation, and reading it back gives the same
/// bits.
using Quaternion = std::array<double, 4>;

/// Motion p(t) = p_0 + a sin(2πt/T) with the amplitude a, without rotation: docs/theory.md (11.30).
struct SineMotion {
  Eigen::Vector3d amplitude_m = Eigen::Vector3d::Zero();
  double period_s = 1.0;
};

/// Motion p(t) = p_0 + v clamp(t − start, 0, duration) on a line, without rotation:
/// docs/theory.md (11.31).
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
  bool known = true;                       ///< whether the planner is shown it from the start
  std::optional<double> visible_within_m;  ///< if not known: seen from this clearance; none: never
  double appears_s = 0.0;                  ///< before this time it does not exist
  bool judge_only = false;                 ///< for collision checks only, not for the planner
};

/// Nearest point of an obstacle's surface.
struct SurfacePoint {
  double distance = 0.0;                            ///< [m]; inside: minus the depth
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< on the surface, world
  /// Unit outward, the gradient of the distance, world.
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
};

/// Position of its centre [m, world] and its velocity [m/s, world] at a time.
[[nodiscard]] Eigen::Vector3d position_at(const Obstacle& obstacle, double time_s);
[[nodiscard]] Eigen::Vector3d velocity_at(const Obstacle& obstacle, double time_s);

/// Upper bound of the speed of any of its points at any time [m/s].
[[nodiscard]] double max_speed(const Obstacle& obstacle);

/// Radius of the ball about its centre that contains the obstacle [m].
[[nodiscard]] double bounding_radius(const Obstacle& obstacle);

/// Exact nearest surface point of the obstacle with its centre at `center`. If several points are
/// equally near (at a centre, on an axis), the result is one of them, always the same.
[[nodiscard]] SurfacePoint closest_on(const Obstacle& obstacle, const Eigen::Vector3d& center,
                                      const Eigen::Vector3d& p);

/// The nearest pair of an obstacle's surface and the axis of a capsule.
struct AxisPoint : SurfacePoint {
  /// On the axis; `distance` is measured from here, world.
  Eigen::Vector3d axis_point = Eigen::Vector3d::Zero();
};

/// The same for the axis from a to b. If it enters the obstacle, the result is its deepest point.
/// Closed forms for sphere and box, docs/theory.md (11.27), (11.9)–(11.11). For the cylinder the
/// minimum is enclosed between tangents, docs/theory.md (11.29), to within 1e-13 of a metre and of
/// the lengths.
[[nodiscard]] AxisPoint closest_on(const Obstacle& obstacle, const Eigen::Vector3d& center,
                                   const Eigen::Vector3d& a, const Eigen::Vector3d& b);

/// Whether the obstacle exists at that time.
[[nodiscard]] inline bool exists(const Obstacle& obstacle, double time_s) {
  return time_s >= obstacle.appears_s;
}

/// Whether a planner is shown the obstacle at that time.
/// @param clearance_m smallest distance between arm and obstacle now
[[nodiscard]] bool visible(const Obstacle& obstacle, double time_s, double clearance_m);

/// @throws Error invalid, "where: what is wrong, what was expected", for sizes and times that are
///        out of range
void check(const Obstacle& obstacle, const std::string& where);

}  // namespace hamelin::scene
