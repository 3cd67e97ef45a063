#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/damped_inverse.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/joint_box.hpp"
#include "hamelin/scene/goal.hpp"
#include "hamelin/search/query.hpp"
#include "hamelin/search/tip_constraints.hpp"
#include "hamelin/search/tip_curve.hpp"

namespace hamelin::search {

/// How far a tip came along a curve.
struct FollowedWay {
  Eigen::MatrixXd points;  ///< dof × way-points; every line between two of them is proved
  double share = 0.0;      ///< of the curve, 0 to 1
  std::string cause;       ///< one line: why not farther
};

/// Finds joint paths on which the tip keeps to a curve, docs/theory.md (21.4): in steps as long as
/// they are proved, which become short where the arm is near a singular posture. Arms with more
/// joints than needed try several ways. One thread.
class WayFollower {
 public:
  /// Both must outlive this.
  WayFollower(const model::Model& model, const dynamics::JointBox& box);

  /// @param start where the tip is on the curve @param query proves the motions
  [[nodiscard]] FollowedWay follow(const TipCurve& curve, const scene::WayTolerance& tolerance,
                                   const Eigen::VectorXd& start, Query& query, Rng& rng);
  /// Steps of inverse kinematics and proofs of the curve since the start.
  [[nodiscard]] long checks() const noexcept { return checks_; }

 private:
  enum class Failure { none, reach, jump, contact };
  [[nodiscard]] FollowedWay follow(const TipCurve& curve, const Eigen::VectorXd& start,
                                   TipConstraints& tube, Query& query);
  [[nodiscard]] Failure step(const geometry::SE3& target, double share, TipConstraints& tube,
                             Query& query);
  [[nodiscard]] bool reach(const geometry::SE3& target);
  /// Moves q_ towards the bias without moving the tip.
  void lean(double share);
  void set_jacobian();  ///< and J Jᵀ, damped
  [[nodiscard]] std::string describe(Failure failure) const;

  const model::Model& model_;
  const dynamics::JointBox& box_;
  dynamics::Workspace ws_;
  scene::WayTolerance tolerance_;
  bool leans_ = false;
  Eigen::VectorXd from_, q_, bias_, step_, held_;  ///< held_: what of a step moves the tip
  dynamics::Matrix6Xd J_;
  dynamics::DampedInverse inverse_;
  long checks_ = 0;
};

}  // namespace hamelin::search
