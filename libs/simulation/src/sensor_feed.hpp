#pragma once
#include <array>
#include <cstdint>
#include <deque>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "hamelin/control/controller.hpp"
#include "hamelin/control/world_view.hpp"
#include "hamelin/log/result.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/sensing/depth_camera.hpp"

namespace hamelin::simulation {

/// Plays the depth cameras of a scene: what each sees of the world as it is, the arm included, the
/// controller gets a delay later.
class SensorFeed {
 public:
  /// @param model the arm as it is, kept by reference
  SensorFeed(const scene::Scene& scene, const model::Model& model);

  /// Passes on the frames that are due, and takes those that are seen now.
  /// @param truth the world as it is, with the arm where it is
  /// @param refused receives one line of text for each frame that is refused
  /// @param seen receives the name of a camera and, as runs along x, the voxels that it was the
  ///        first to find occupied
  void advance(
      double time_s, control::WorldView& truth, control::Controller& controller,
      const std::function<void(const std::string&)>& refused,
      const std::function<void(const std::string&, const std::vector<scene::VoxelBox>&)>& seen);
  /// The map that is seen has changed.
  void change_map() noexcept { map_is_read_ = false; }

  void fill(log::Result& result) const { result.sensors = figures_; }

 private:
  struct Camera {
    scene::SensorSpec spec;
    int frame = 0;  ///< index in Model::frames() of Mount::frame
    sensing::DepthRenderer renderer;
    long frames = 0;
  };
  struct Pending {
    double due_s;
    std::string camera;
    control::PointFrame frame;
  };
  /// Runs of those voxels that were not in a change before.
  [[nodiscard]] std::vector<scene::VoxelBox> first_seen(const scene::MapChange& change);
  [[nodiscard]] control::PointFrame look(Camera& camera, double time_s, control::WorldView& truth);
  void see_solids(double time_s, control::WorldView& truth);

  const model::Model& model_;
  Rng noise_;
  bool sees_map_;  ///< else exact primitives take its place
  bool map_is_read_ = false;
  std::vector<Camera> cameras_;
  std::vector<sensing::DepthRenderer::Solid> solids_;
  std::deque<Pending> pending_;                 ///< by the time when they are due
  std::set<std::array<std::int32_t, 3>> seen_;  ///< voxels, z first
  log::Result::Sensors figures_;
};

}  // namespace hamelin::simulation
