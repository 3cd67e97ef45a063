#pragma once
#include <mujoco/mujoco.h>

#include <Eigen/Core>
#include <vector>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/scene/distance.hpp"

namespace hamelin::mujoco {

/// Chooses those boxes of a map that are near the arm and makes them the shapes of one body. A map
/// has more boxes than MuJoCo can test against the arm in each step. Distances are those from the
/// ball around each shape, at the poses that MuJoCo computed.
class NearBoxes {
 public:
  /// A shape of the arm may move this far before the choice is invalid [m].
  static constexpr double slack_m = 0.05;

  /// @param arm_shapes their ids in a model
  void set_arm(std::vector<int> arm_shapes);
  /// Chooses boxes at the poses in `data`. @return how many
  int choose(const scene::BoxField& field, const geometry::SE3& map_pose, const mjModel& model,
             const mjData& data);
  /// How far any shape has moved since the last choice [m].
  [[nodiscard]] double moved_m(const mjData& data) const;
  /// Makes the chosen boxes the shapes of the map's body, which must have as many or more.
  void place(const scene::BoxField& field, mjModel& model, int map_body) const;

 private:
  std::vector<int> arm_shapes_;
  std::vector<Eigen::Vector3d> reference_;  ///< centres of the arm's shapes at the last choice
  std::vector<int> chosen_;
};

}  // namespace hamelin::mujoco
