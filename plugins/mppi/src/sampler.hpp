#pragma once
#include <Eigen/Core>

#include "task.hpp"

namespace hamelin::mppi {

/// Makes the control points of rollouts. All of them keep the limits of Task::limits, start with
/// the mean's first three control points, and end at rest.
class Sampler {
 public:
  /// The lanes of the first block, which are not random.
  enum Proposal : Eigen::Index { proposal_mean, proposal_best, proposal_brake, proposal_follow };

  Sampler(Eigen::Index dof, Eigen::Index point_count);

  /// The mean, the best rollout of the plan before, braking, and motions that follow the path at
  /// several speeds: docs/theory.md (15.5).
  void propose(const Task& task, Rollouts& out);
  /// Random rollouts around the mean and along the path, docs/theory.md (15.4). The numbers depend
  /// on seed, plan and block only.
  void sample(const Task& task, std::size_t block, Rollouts& out);
  /// The rollout from the first three control points that stays nearest to desired ones.
  static void approach(const StepLimits& limits, const Eigen::MatrixXd& desired,
                       Eigen::MatrixXd& points);
  /// The hardest braking from the first three control points of a plan.
  static void brake(const StepLimits& limits, Eigen::MatrixXd& points);
  /// The weights of the noise's coefficients at a control point, which add up to 1.
  [[nodiscard]] auto basis(Eigen::Index point) const { return basis_.row(point); }

  static constexpr Eigen::Index coefficient_count = 6;

 private:
  /// The longest step from which the arm can still slow down for the turns and the end of the path.
  [[nodiscard]] static double length_before_turns(const planning::JointPath& path, double s,
                                                  double distance, double ahead, double brake);
  void follow(const Task& task, double speed_share, double ahead);

  Eigen::Matrix<double, Eigen::Dynamic, coefficient_count> basis_;
  Eigen::Array<double, lane_count, Eigen::Dynamic> noise_;  ///< coefficients, joint by joint
  Eigen::MatrixXd points_;
  Eigen::VectorXd carrot_, step_;
};

}  // namespace hamelin::mppi
