#pragma once
#include <Eigen/Core>

#include "hamelin/dynamics/damped_inverse.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"
#include "hamelin/reactive/obstacles.hpp"

namespace hamelin::reactive {

/// The target of the law: the goal, or a way-point in joint space.
struct Target {
  const hamelin_goal* goal = nullptr;
  const Eigen::VectorXd* via = nullptr;  ///< a joint vector that replaces the goal, or null
  bool passing = false;                  ///< whether the via is passed at full speed
};

/// Whether a goal of the tip prescribes its orientation.
[[nodiscard]] inline bool rotates(const hamelin_goal& goal) noexcept {
  return goal.type == HAMELIN_GOAL_POSE ||
         (goal.type == HAMELIN_GOAL_FOLLOW && goal.follows_rotation != 0);
}

/// Error of the tip in the world: from its position to that of the goal [m], and the rotation that
/// leads to the goal's orientation, axis times angle [rad]; zero if the goal prescribes none.
struct TipError {
  Eigen::Vector3d position, rotation;
};
[[nodiscard]] TipError tip_error(const model::Model& model, const dynamics::Workspace& ws,
                                 const hamelin_goal& goal);

struct LawParams {
  double joint_gain = 4.0, tip_gain = 3.0;  ///< near a target of the joints and of the tip [1/s]
  double cruise_speed = 2.0;                ///< of the fastest joint [rad/s or m/s]
  double tip_speed = 0.5, tip_turn = 1.5;   ///< towards a goal of the tip [m/s], [rad/s]
  double repulsion_range = 0.0;             ///< from the margins [m]; 0: none
  double repulsion_speed = 0.0;             ///< at the margins [m/s]
};

/// The desired joint velocity without regard to limits: attraction and short repulsion.
class Law {
 public:
  Law(const planning::Setup& setup, const model::Model& model, const LawParams& params);
  void set_params(const LawParams& params) noexcept { params_ = params; }

  /// The distance of q from the target: |q* − q| for a joint vector q*, for the tip
  /// 2 |position error| + ½ |rotation angle|. docs/theory.md (10.24)
  [[nodiscard]] double distance(const model::Model& model, const dynamics::Workspace& ws,
                                const Eigen::VectorXd& q, const Target& target);
  /// Whether q is at the goal, within this share of its tolerances. For a joint goal the largest
  /// |error| counts.
  [[nodiscard]] bool within(const model::Model& model, const dynamics::Workspace& ws,
                            const Eigen::VectorXd& q, const hamelin_goal& goal, double share) const;
  /// The weight w of the full margins: 0 at the goal, 1 far from it. docs/theory.md (10.2)
  [[nodiscard]] double margin_weight(const model::Model& model, const dynamics::Workspace& ws,
                                     const Eigen::VectorXd& q, const hamelin_goal& goal) const;
  /// Sets u to the attraction to the target, docs/theory.md (10.3), (10.4), (10.5). ws must
  /// contain the forward kinematics at q.
  /// @return the speed at which the attraction shortens distance()
  double attract(const model::Model& model, const dynamics::Workspace& ws, const Eigen::VectorXd& q,
                 const Target& target, Eigen::VectorXd& u);
  /// Adds the short repulsion, docs/theory.md (10.6): for each point within the range of its margin
  /// u += strength · speed (1 − h/range)/max(0.05, |a|²) · a, with the row a and
  /// h = max(distance − margin, 0).
  void repel(std::span<const NearPoint> points, double strength, Eigen::VectorXd& u) const;

 private:
  LawParams params_;
  Eigen::VectorXd middle_;  ///< of the joint limits; empty where they are not modelled
  dynamics::Matrix6Xd J_;
  dynamics::DampedInverse inverse_;
  Eigen::VectorXd centring_, scratch_;
};

}  // namespace hamelin::reactive
