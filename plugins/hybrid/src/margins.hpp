#pragma once
#include <vector>

#include "obstacles.hpp"
#include "surroundings.hpp"

namespace hamelin::hybrid {

struct MarginParams {
  double away_m;   ///< from obstacles, away from the goal
  double goal_m;   ///< near a goal of the tip
  double slack_m;  ///< how much less than its own clearance a joint goal leaves
  double self_m;   ///< within the arm
};

/// Margins that shrink near the goal. A joint goal often stands nearer to something than one wants to be elsewhere: by
/// its side each sphere's margin is what the goal's own pose leaves of clearance, less `slack_m`, but at least 1 mm.
/// For a tip goal it is `goal_m`.
class Margins {
 public:
  Margins(const planning::Setup& setup, const MarginParams& params);
  /// @param radius how far clearances matter [m]
  void take_goal(Surroundings& surroundings, const hamelin_goal& goal, double radius);
  /// Sets each point's margin. @param away as Law::away: 0 at the goal, 1 far from it
  void set(std::span<NearPoint> points, double away) const;
  /// Whether the goal's own pose leaves this sphere less than the whole margin.
  [[nodiscard]] bool tight_at_goal(const NearPoint& point) const;
  [[nodiscard]] const MarginParams& params() const noexcept { return params_; }

 private:
  [[nodiscard]] double at_goal(const NearPoint& point) const;

  MarginParams params_;
  int dof_;
  bool joint_goal_ = false;
  double self_at_goal_ = 0.0;
  std::vector<double> clearance_at_goal_;
};

}  // namespace hamelin::hybrid
