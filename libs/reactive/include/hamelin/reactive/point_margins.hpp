#pragma once
#include <vector>

#include "hamelin/reactive/obstacles.hpp"
#include "hamelin/reactive/surroundings.hpp"

namespace hamelin::reactive {

struct MarginParams {
  double full_m = 0.01;   ///< from obstacles, far from the goal
  double goal_m = 0.003;  ///< from obstacles, at a goal of the tip
  double slack_m =
      0.003;  ///< by how much the margin at a joint goal is less than the clearance there
  double self_m = 0.005;  ///< between parts of the arm
};

/// Margins for a scene: at least a voxel of its map, near a goal of the tip 0.4 of one, and between
/// parts of the arm more than its shield keeps.
[[nodiscard]] MarginParams margins_in_scene(const planning::Setup& setup, MarginParams wanted);

/// Margins that shrink near the goal, docs/theory.md (10.2), because goals are often closer to
/// something than the arm should come elsewhere. At a joint goal the margin of a shape is its
/// clearance there less `slack_m`, at least 1 mm (3 mm if actuation is sampled) and at most the
/// full margin. At a goal of the tip it is `goal_m`.
class PointMargins {
 public:
  PointMargins(const planning::Setup& setup, const MarginParams& params);
  /// To be followed by set_goal().
  void set_params(const MarginParams& params) noexcept { params_ = params; }
  /// Measures the clearances at the goal. @param radius clearances up to this one are measured [m]
  void set_goal(Surroundings& surroundings, const hamelin_goal& goal, double radius);
  /// Sets the margin of each point. @param weight Law::margin_weight: 0 at the goal, 1 far from it
  void set(std::span<NearPoint> points, double weight) const;
  /// The least margins, for a motion that was planned to be clear.
  void set_least(std::span<NearPoint> points) const;
  /// Whether the clearance of this point's shape at a joint goal is less than the full margin.
  [[nodiscard]] bool tight_at_goal(const NearPoint& point) const;
  [[nodiscard]] const MarginParams& params() const noexcept { return params_; }

 private:
  [[nodiscard]] double at_goal(const NearPoint& point) const;

  MarginParams params_;
  double smallest_m_;  ///< of a margin at a joint goal
  double least_m_, least_self_m_;
  Eigen::VectorXd goal_q_;  ///< of a joint goal; sized once, since a tick does not allocate
  bool joint_goal_ = false;
  double self_at_goal_ = 0.0;
  std::vector<double> clearance_at_goal_;
};

}  // namespace hamelin::reactive
