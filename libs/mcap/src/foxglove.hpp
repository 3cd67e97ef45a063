#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/io/json.hpp"

/// Messages as Foxglove defines them, see foxglove_schemas.hpp.
namespace hamelin::mcap {

struct Color {
  double r, g, b, a = 1.0;  ///< 0 to 1
};

/// Names of frames. Those of the arm's links are not the names of the links, because the link
/// frames of a robot file may lie elsewhere, and a viewer may show that file as well.
inline constexpr const char *world_frame = "world", *base_frame = "base", *map_frame = "map",
                            *tip_frame = "tip", *target_frame = "target";
[[nodiscard]] std::string com_frame(const std::string& link);
[[nodiscard]] std::string obstacle_frame(const std::string& obstacle);

/// Whole seconds and the remaining nanoseconds.
[[nodiscard]] Json time_json(std::uint64_t time_ns);

[[nodiscard]] Json frame_transform(std::uint64_t time_ns, const std::string& parent,
                                   const std::string& child, const geometry::SE3& pose);

/// What a viewer draws at one frame: a foxglove.SceneEntity that moves with the frame.
class Entity {
 public:
  Entity(std::uint64_t time_ns, const std::string& frame, const std::string& id);

  // Coordinates are in the frame [m].
  void add_sphere(const Eigen::Vector3d& center, double radius, const Color& color);
  /// @param size full edges
  void add_box(const geometry::SE3& pose, const Eigen::Vector3d& size, const Color& color);
  /// @param length along the z axis of `pose`, which is that of its centre
  void add_cylinder(const geometry::SE3& pose, double radius, double length, const Color& color);
  /// All points within `radius` of the segment from a to b.
  void add_capsule(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double radius,
                   const Color& color);
  /// The axes of a pose as three lines: x red, y green, z blue.
  void add_axes(const geometry::SE3& pose, double length);
  void add_path(const std::vector<Eigen::Vector3d>& points, const Color& color);

  [[nodiscard]] const Json& json() const noexcept { return json_; }

 private:
  Json json_;
};

/// A foxglove.SceneUpdate that replaces all entities of its topic, so that a viewer that reads only
/// the last message before a time shows all of them.
[[nodiscard]] Json scene_update(std::uint64_t time_ns, const std::vector<Entity>& entities);

}  // namespace hamelin::mcap
