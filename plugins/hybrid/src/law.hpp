#pragma once
#include <Eigen/Core>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"
#include "obstacles.hpp"

namespace hamelin::hybrid {

/// What the law aims at: the goal, or an escape's way-point in joint space.
struct Target {
  const hamelin_goal* goal = nullptr;
  const Eigen::VectorXd* via = nullptr;  ///< set: a joint vector to go to instead
  bool passing = false;                  ///< the via is on the way: it is passed at full speed
};

struct LawParams {
  double joint_gain, tip_gain;  ///< near a target of the joints, of the tip [1/s]
  double cruise_speed, tip_speed, tip_turn;
  double repulsion_range, repulsion_speed;
  double steering_gain, steering_range;
};

/// The desired joint velocity without regard to limits: attraction, short repulsion, and gyroscopic terms that steer
/// around what is approached without doing work.
class Law {
 public:
  Law(const planning::Setup& setup, const model::Model& model, const LawParams& params);

  /// How far off the target is: joint distance, or 2 |position error| + ½ |rotation angle|.
  [[nodiscard]] double distance(const model::Model& model, const dynamics::Workspace& ws, const Eigen::VectorXd& q,
                                const Target& target);
  /// Whether q is at the goal, by this share of its tolerances. A joint goal: its largest |error|.
  [[nodiscard]] bool within(const model::Model& model, const dynamics::Workspace& ws, const Eigen::VectorXd& q,
                            const hamelin_goal& goal, double share) const;
  /// How far from the goal, as margins see it: 0 at it, 1 away from it.
  [[nodiscard]] double away(const model::Model& model, const dynamics::Workspace& ws, const Eigen::VectorXd& q,
                            const hamelin_goal& goal) const;
  /// u = attraction to the target. Poses at q must stand in ws.
  /// @return how fast it means to shorten distance()
  double attract(const model::Model& model, const dynamics::Workspace& ws, const Eigen::VectorXd& q,
                 const Target& target, Eigen::VectorXd& u);
  /// u += a (1 − h/range) speed / max(1, |a|²) per point within the range of its margin, h = distance − margin,
  /// weighted by `strength`.
  void repel(std::span<const NearPoint> points, double strength, Eigen::VectorXd& u) const;
  /// Gyroscopic terms w = m k (v̂ × n)^ for approached points, k = gain α (1/max(h, 1 cm) − 1/range), α = −v̂·n,
  /// m = 1/tr(J M⁻¹ Jᵀ): the force w × v turns the velocity away from the obstacle. All weighted by `strength`.
  void steer(const model::Model& model, const dynamics::Workspace& ws, std::span<const NearPoint> points,
             const Eigen::MatrixXd& W, const Eigen::VectorXd& v, double strength, planning::Command& command);

 private:
  void task_error(const model::Model& model, const dynamics::Workspace& ws, const hamelin_goal& goal,
                  Eigen::Vector3d& position, Eigen::Vector3d& rotation) const;

  LawParams params_;
  Eigen::VectorXd middle_;  ///< of the joint limits; empty where they are not modelled
  dynamics::Matrix6Xd J_;
  dynamics::Matrix3Xd Jp_, JpW_;
  Eigen::VectorXd null_, scratch_;
};

}  // namespace hamelin::hybrid
