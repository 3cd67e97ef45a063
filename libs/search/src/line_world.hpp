#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/scene/environment.hpp"
#include "kernel/line_lanes.hpp"
#include "line_arm.hpp"

namespace hamelin::search {

/// Map and obstacles for the kernels of LineCheck, with bounds of their rounding: docs/theory.md
/// (17.15), (17.16). They are in a frame with the axes of the map, with its origin at a corner of a
/// voxel near the base, so that coordinates are small whatever those of the map are.
class LineWorld {
 public:
  LineWorld(const model::Model& model, LineArm& arm);

  /// @param environment must stay until the next call @return whether the kernels have room for it
  [[nodiscard]] bool set(const scene::Environment& environment, double time_s, bool movers);
  [[nodiscard]] const kernel::World& view() const noexcept { return world_; }
  /// A point's distance from the map, or `limit` if that is less [m].
  [[nodiscard]] double distance(int sphere, const float* p, double limit);

 private:
  struct Hint {
    std::int32_t map, unknown;
  };
  [[nodiscard]] bool place_frame();
  [[nodiscard]] bool add_primitives(double time_s, bool movers);

  const model::Model& model_;
  LineArm& arm_;
  const scene::Environment* environment_ = nullptr;
  std::shared_ptr<const scene::DistanceField> field_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();  ///< of the frame, in that of the map
  geometry::SE3 frame_;
  kernel::World world_{};
  std::vector<kernel::Primitive> primitives_;
  std::vector<Hint> hints_;  ///< of each shape
};

}  // namespace hamelin::search
