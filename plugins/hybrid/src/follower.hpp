#pragma once
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/Eigenvalues>
#include <span>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"
#include "parts.hpp"

namespace hamelin::hybrid {

struct FollowParams {
  double gain;             ///< of the tip's error [1/s]
  double tip_speed;        ///< largest correction of its position [m/s]
  double tip_turn;         ///< and of its orientation [rad/s]
  double joint_speed;      ///< largest |u| [rad/s or m/s]
  double repulsion_range;  ///< of near points from their margins [m]
  double repulsion_speed;  ///< at the margin [m/s]
};

/// The desired joint velocity towards a target that moves, docs/theory.md (16.4)–(16.10): its twist
/// and a correction of the tip's error, resolved with a damping that acts in nearly singular
/// directions only; motion in the null space towards a comfortable posture and away from obstacles,
/// by which an arm leaves singular postures; and other joints in place of those that are at a
/// limit.
class Follower {
 public:
  Follower(const planning::Setup& setup, const model::Model& model);
  void set_params(const FollowParams& params) noexcept { params_ = params; }
  /// Starts to follow from a posture, which counts as comfortable where joints have no limits.
  void start(const Eigen::VectorXd& q) noexcept;
  /// Forgets what held the arm back.
  void restart() noexcept {
    progress_ = 1.0;
    desired_.setZero();
  }
  /// Compares the tip's velocity with what was desired last, docs/theory.md (16.5). To be called
  /// before velocity(). ws must contain the forward kinematics at q.
  void observe(const dynamics::Workspace& ws, const Eigen::VectorXd& v, double period_s);
  /// The share of the desired motion of the tip that took place lately, from 0 to 1.
  [[nodiscard]] double progress() const noexcept { return progress_; }

  /// Sets u to the joint velocity that is desired a time `lag_s` after this tick, which the arm's
  /// velocity needs to follow it. ws must contain the forward kinematics at q.
  /// @param lower, upper bounds of u
  void velocity(const dynamics::Workspace& ws, const Eigen::VectorXd& q, const hamelin_goal& goal,
                std::span<const NearPoint> points, double lag_s, const Eigen::VectorXd& lower,
                const Eigen::VectorXd& upper, Eigen::VectorXd& u);
  /// Changes u as little as possible in terms of the tip's motion, so that it keeps rows of near
  /// points and the bounds, docs/theory.md (16.11): a hand that is held by a wall slides along it
  /// and keeps its orientation, and an elbow goes aside. To be called after velocity().
  void keep_clear(std::span<const NearPoint> points, double brake, double rate,
                  const Eigen::VectorXd& lower, const Eigen::VectorXd& upper, Eigen::VectorXd& u);
  /// The smallest singular value of the last tick's Jacobian, among those of the task.
  [[nodiscard]] double smallest_singular_value() const noexcept { return smallest_; }

 private:
  /// Sets J_ to that of the tip, rotations scaled to lengths.
  void place_jacobian(const dynamics::Workspace& ws, bool rotates);
  void desire(const dynamics::Workspace& ws, const hamelin_goal& goal, double lag_s);
  /// Sets `inverse_` for the joints that are free.
  void decompose(bool rotates);
  /// The joint velocity of least norm that causes a motion of the tip, or nearly so.
  void resolve(const Eigen::Matrix<double, 6, 1>& tip_motion, Eigen::VectorXd& u) const;
  void prefer(const Eigen::VectorXd& q, std::span<const NearPoint> points);
  /// Fixes the joint that is farthest beyond a bound there. @return false if there is none
  [[nodiscard]] bool fix_worst(const Eigen::VectorXd& lower, const Eigen::VectorXd& upper,
                               const Eigen::VectorXd& u);

  using Vector6d = geometry::Vector6d;
  using Matrix6d = Eigen::Matrix<double, 6, 6>;
  const model::Model& model_;
  FollowParams params_{};
  Eigen::VectorXd comfortable_;  ///< posture
  bool limited_ = false;         ///< whether that is the middle of the limits
  dynamics::Matrix6Xd J_;
  Vector6d desired_ = Vector6d::Zero();  ///< velocity of the tip, rotations scaled to lengths
  Vector6d remaining_;                   ///< of it, without what fixed joints do
  bool rotates_ = true;
  double progress_ = 1.0;
  Eigen::SelfAdjointEigenSolver<Matrix6d> modes_;  ///< of J Jᵀ
  Vector6d inverse_;                               ///< damped, of its eigenvalues
  double smallest_ = 0.0;
  Eigen::VectorXd preferred_;  ///< velocity in the null space
  Eigen::VectorXd fixed_;      ///< velocities of the joints that are fixed, else zero
  std::vector<bool> is_fixed_;
  SafetyFilter filter_;
  Eigen::MatrixXd metric_, inverse_metric_, identity_;
  Eigen::LLT<Eigen::MatrixXd> llt_;
};

/// Notices that the arm cannot follow a target that hardly moves, for which a search is worth
/// while: docs/theory.md, chapter 16.
class TargetAnchor {
 public:
  /// Takes the place of the target as a goal at rest.
  void set(const hamelin_goal& target) noexcept;
  /// Whether the target has left the place.
  [[nodiscard]] bool left_by(const hamelin_goal& target) const noexcept;
  /// The target as a goal at rest.
  [[nodiscard]] const hamelin_goal& goal() const noexcept { return goal_; }

  int searches = 0;  ///< for this place

 private:
  hamelin_goal goal_{};
};

}  // namespace hamelin::hybrid
