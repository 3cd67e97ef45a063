#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/scene/motion.hpp"

namespace hamelin::scene {

/// frame: no solid, but a frame to which other obstacles are attached.
enum class Shape : std::int32_t { sphere, box, cylinder, capsule, frame };

[[nodiscard]] std::string_view to_string(Shape shape) noexcept;

/// What controllers know of an obstacle's future besides its present pose and velocity. path: all
/// of it; constant_acceleration, constant_velocity: nothing, and they go on with the present one;
/// speed_bound: no point of it is faster than `speed_max_m_s`.
enum class Prediction : std::int32_t {
  path,
  constant_acceleration,
  constant_velocity,
  speed_bound
};

[[nodiscard]] std::string_view to_string(Prediction prediction) noexcept;

/// A solid primitive. Pose and motion are those of its centre and axes, in the world or in the
/// frame of the obstacle that it is attached to.
struct Obstacle : Frame {
  std::string name;
  Shape shape = Shape::sphere;
  double radius_m = 0.0;  ///< sphere, cylinder, capsule
  /// Cylinder, and a capsule without its caps: along its local z, centred.
  double length_m = 0.0;
  Eigen::Vector3d size_m = Eigen::Vector3d::Zero();  ///< box: full edges
  Quaternion quaternion_wxyz{1.0, 0.0, 0.0, 0.0};    ///< see Quaternion
  std::string attached_to;  ///< name of an obstacle, see attach(); empty: none
  Prediction prediction = Prediction::constant_acceleration;
  /// Of any point of it, needed with Prediction::speed_bound. With others it only bounds streams of
  /// observed poses; 0: not stated.
  double speed_max_m_s = 0.0;
  bool known = true;                       ///< whether the planner is shown it from the start
  std::optional<double> visible_within_m;  ///< if not known: seen from this clearance; none: never
  double appears_s = 0.0;                  ///< before this time it does not exist
  bool judge_only = false;                 ///< for collision checks only, not for the planner
};

/// The file that its way-points were read from; empty: none.
[[nodiscard]] std::filesystem::path waypoint_file(const Obstacle& obstacle);

/// Sets the parents of all obstacles by their `attached_to`.
/// @throws Error invalid, "where/index: obstacle 'NAME' …", if there is none of this name or more
///        than one, or obstacles are attached to each other in a circle or in a chain of more than
///        32
void attach(std::span<Obstacle> obstacles, const std::string& where);

/// A time as a controller sees it: now, or so long ahead of now, where obstacles are predicted.
struct Moment {
  double now_s = 0.0, ahead_s = 0.0;
  Moment(double now) : now_s(now) {}  // NOLINT(google-explicit-constructor)
  Moment(double now, double ahead) : now_s(now), ahead_s(ahead) {}
};

/// Where an obstacle is, or is predicted to be.
struct Placed : MotionState {
  /// By how much it may have come nearer than its pose says, where only its speed is bounded [m].
  double nearer_m = 0.0;
};
[[nodiscard]] Placed placed_at(const Obstacle& obstacle, const Moment& moment);

/// Nearest point of an obstacle's surface.
struct SurfacePoint {
  double distance = 0.0;                            ///< [m]; inside: minus the depth
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  ///< on the surface, world
  /// Unit outward, the gradient of the distance, world.
  Eigen::Vector3d direction = Eigen::Vector3d::Zero();
};

/// Upper bound of the speed of any of its points at any time [m/s].
[[nodiscard]] double max_speed(const Obstacle& obstacle);

/// The same for what is predicted from a moment on.
[[nodiscard]] double max_speed(const Obstacle& obstacle, const Moment& moment);

/// Whether it may ever move.
[[nodiscard]] bool moves(const Obstacle& obstacle);

/// Radius of the ball about its centre that contains the obstacle [m].
[[nodiscard]] double bounding_radius(const Obstacle& obstacle);

/// Exact nearest surface point of the obstacle at a pose. If several points are equally near (at a
/// centre, on an axis), the result is one of them, always the same. Not for frames.
[[nodiscard]] SurfacePoint closest_on(const Obstacle& obstacle, const geometry::SE3& pose,
                                      const Eigen::Vector3d& p);

/// The nearest pair of an obstacle's surface and the axis of a capsule.
struct AxisPoint : SurfacePoint {
  /// On the axis; `distance` is measured from here, world.
  Eigen::Vector3d axis_point = Eigen::Vector3d::Zero();
};

/// The same for the axis from a to b. If it enters the obstacle, the result is its deepest point.
/// Closed forms for sphere, box and capsule, docs/theory.md (11.27), (11.9)–(11.11). For the
/// cylinder the minimum is enclosed between tangents, docs/theory.md (11.29), to within 1e-13 of a
/// metre and of the lengths.
[[nodiscard]] AxisPoint closest_on(const Obstacle& obstacle, const geometry::SE3& pose,
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
