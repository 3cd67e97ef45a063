#pragma once
#include <cstdint>
#include <string>
#include <string_view>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/scene/motion.hpp"

namespace hamelin::scene {

/// What carries a depth sensor: the world, the robot's base, which stands in it, the tip, or a
/// frame with a name.
enum class Mount : std::int32_t { world, base, tip, frame };

[[nodiscard]] std::string_view to_string(Mount mount) noexcept;

/// A depth camera that a run simulates. In its frame x points to the right of the image, y down,
/// and z to the front.
struct SensorSpec {
  std::string name;
  Mount mount = Mount::world;
  std::string frame;                               ///< name in Model::frames(), of Mount::frame
  geometry::SE3 pose;                              ///< in the frame of its mount
  Quaternion quaternion_wxyz{1.0, 0.0, 0.0, 0.0};  ///< see Quaternion
  double fov_rad = 1.0;                            ///< horizontal
  int width = 80, height = 60;                     ///< pixels
  double rate_hz = 10.0;
  double range_m = 2.0;   ///< surfaces that are farther are not measured
  double noise_m = 0.0;   ///< standard deviation along the ray
  double delay_s = 0.03;  ///< from when a frame is seen until the controller has it
};

}  // namespace hamelin::scene
