#pragma once
#include <Eigen/Core>
#include <optional>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::control {

/// Converts the gyroscopic terms of a planner's answer to those of integrators. Allocates only
/// beyond the capacity of `out`.
void copy_gyroscopic_terms(const planning::CommandBuffers& command,
                           std::vector<dynamics::GyroscopicTerm>& out);

/// Limits a planner's answer to the torques that the joints of the arm can produce.
class TorqueLimits {
 public:
  /// @param effort_max largest torque of each joint [Nm or N]; of size zero if the scene models no
  ///        limits
  /// @param rate_max largest rate of change of each torque [Nm/s or N/s]; none if the scene models
  ///        no such limit
  TorqueLimits(const model::Model& model, Eigen::VectorXd effort_max,
               std::optional<double> rate_max);

  /// Whether there is any limit.
  [[nodiscard]] bool any() const noexcept {
    return effort_max_.size() > 0 || rate_max_.has_value();
  }

  /// Limits the channels of an integrator's step: cuts the held torque first, then scales all
  /// gyroscopic terms by one factor, so that they still do no work: docs/theory.md (8.8), (8.9).
  /// Updates gyroscopic_torque().
  /// @return whether anything was reduced
  bool limit(dynamics::Workspace& ws, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
             integration::Channels& channels);
  /// Torque of the gyroscopic terms after the last limit(channels); zero if no limits are modelled.
  [[nodiscard]] const Eigen::VectorXd& gyroscopic_torque() const noexcept { return gyroscopic_; }
  /// The largest share, 0 to 1, of the change of velocity at a node whose torque M (x − v)/h, added
  /// to the held torque and the gyroscopic torque, stays within the limits, docs/theory.md (8.10).
  /// `change` is x − v.
  [[nodiscard]] double share_of_velocity_change(dynamics::Workspace& ws, const Eigen::VectorXd& q,
                                                const Eigen::VectorXd& change, double h,
                                                const Eigen::VectorXd& held_torque);

  /// Limits the sum of all channels: cuts it at the torque limits and at the rate limit.
  /// @param last the torque that was sent a period before
  /// @return whether anything was reduced
  bool limit(Eigen::VectorXd& torque, const Eigen::VectorXd& last, double period_s);

 private:
  const model::Model& model_;
  Eigen::VectorXd effort_max_;
  std::optional<double> rate_max_;
  Eigen::VectorXd gyroscopic_, requested_, rate_, impulse_;
};

/// All channels of a planner's answer as one torque at (q, v), which is what a sampled controller
/// can apply, docs/theory.md (8.7): τ = τ_held − D v − ∂V + Σ J_pᵀ (w × J_p v) + M (x − v)/T.
class ChannelSum {
 public:
  /// @param gyroscopic_terms the largest number of them in an answer
  ChannelSum(const model::Model& model, std::size_t gyroscopic_terms);

  /// @param q, v the arm's state
  /// @param q_measured configuration as measured by the planner, at which M is evaluated for the
  ///        node velocity
  /// @param period_s T, during which the change to the node velocity is made
  /// @param mass_scale ratio of the planner's masses to those of the model
  void sum(dynamics::Workspace& ws, const planning::CommandBuffers& command,
           const Eigen::VectorXd& q, const Eigen::VectorXd& v, const Eigen::VectorXd& q_measured,
           double period_s, double mass_scale, Eigen::VectorXd& torque);

 private:
  const model::Model& model_;
  std::vector<dynamics::GyroscopicTerm> terms_;
  Eigen::VectorXd change_, part_;
};

}  // namespace hamelin::control
