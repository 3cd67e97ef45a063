#pragma once
#include <Eigen/Core>

#include "hamelin/core/rng.hpp"
#include "hamelin/geometry/se3.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/sensing/occupancy_grid.hpp"

namespace hamelin::sensing {

/// A pinhole camera that measures depth. In its frame x points to the right of the image, y down,
/// and z to the front.
struct DepthCamera {
  int width = 320, height = 240;  ///< pixels
  double fov_rad = 1.0;           ///< horizontal field of view
  double range_m = 3.0;           ///< surfaces that are farther are not measured
  double noise_m = 0.0;           ///< standard deviation along the ray
};

/// @throws Error invalid, "camera: …", for numbers out of range
void check(const DepthCamera& camera);

/// What a depth camera sees of an environment, for simulations: docs/theory.md (20.4). One thread.
class DepthRenderer {
 public:
  /// @throws Error invalid as check()
  explicit DepthRenderer(const DepthCamera& camera);
  ~DepthRenderer();
  DepthRenderer(DepthRenderer&&) noexcept;
  DepthRenderer& operator=(DepthRenderer&&) noexcept;

  /// The map that is seen from then on.
  void set_map(const scene::Environment& environment);

  /// The points of an image, row by row, 3 × N in the camera's frame [m]. Where nothing is within
  /// the range the point is just beyond it.
  /// @param camera pose of the camera in the world
  /// @param solids what is seen besides the map, at their poses in the world
  /// @return valid until the next call
  struct Solid {
    scene::Obstacle shape;
    geometry::SE3 pose;
  };
  const Eigen::Matrix3Xf& render(const geometry::SE3& camera, const std::vector<Solid>& solids,
                                 Rng& noise);

 private:
  [[nodiscard]] double distance_in_map(const Eigen::Vector3d& from,
                                       const Eigen::Vector3d& to) const;

  DepthCamera camera_;
  Eigen::Matrix3Xd rays_;  ///< of the pixels in the camera's frame, unit
  Eigen::Matrix3Xf points_;
  struct Map;
  std::unique_ptr<Map> map_;
};

/// Adds the collision shapes of an arm to what a camera sees.
void add_solids(const scene::Shapes& arm, std::vector<DepthRenderer::Solid>& solids);

}  // namespace hamelin::sensing
