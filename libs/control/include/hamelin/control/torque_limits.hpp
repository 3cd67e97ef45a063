#pragma once
#include <Eigen/Core>
#include <optional>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::control {

/// The gyroscopic terms of a planner's answer, in the form that integrators take. Allocates only beyond `out`'s
/// capacity.
void copy_gyroscopic_terms(const planning::CommandBuffers& command, std::vector<dynamics::GyroscopicTerm>& out);

/// Keeps a planner's answer within the torques that the arm's joints can give.
class TorqueLimits {
 public:
  /// @param effort_max largest torque of each joint [Nm or N]; of size zero where the scene models no limits
  /// @param rate_max largest change of each torque [Nm/s or N/s]; none where the scene models no such limit
  TorqueLimits(const model::Model& model, Eigen::VectorXd effort_max, std::optional<double> rate_max);

  /// Whether there is any limit.
  [[nodiscard]] bool any() const noexcept { return effort_max_.size() > 0 || rate_max_.has_value(); }

  /// Channels that act on an integrator's step: cuts the held torque first, then scales the gyroscopic terms as a
  /// whole, so that they still do no work. gyroscopic_torque() follows.
  /// @return whether anything was cut
  bool limit(dynamics::Workspace& ws, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
             integration::Channels& channels);
  /// Torque of the gyroscopic terms that the last limit(channels) left; zero where no limits are modelled.
  [[nodiscard]] const Eigen::VectorXd& gyroscopic_torque() const noexcept { return gyroscopic_; }
  /// Which share, 0 to 1, of a node's change of velocity M (x − v)/h fits in beside the other channels.
  [[nodiscard]] double share_of_velocity_change(dynamics::Workspace& ws, const Eigen::VectorXd& q,
                                                const Eigen::VectorXd& change, double h,
                                                const Eigen::VectorXd& held_torque);

  /// One torque for all: cuts it at the limits and at the change since the last call.
  /// @return whether anything was cut
  bool limit(Eigen::VectorXd& torque, double period_s);
  /// The torque that acted before the first call of limit(torque).
  void start_from(const Eigen::VectorXd& torque) { last_ = torque; }

 private:
  const model::Model& model_;
  Eigen::VectorXd effort_max_;
  std::optional<double> rate_max_;
  Eigen::VectorXd gyroscopic_, wanted_, rate_, impulse_, last_;
};

/// All channels of a planner's answer as one torque at (q, v), what a sampled controller can do:
///   τ = τ_held − D v − ∂V + Σ J_pᵀ (w × J_p v) + M (x − v)/T.
class ChannelSum {
 public:
  /// @param gyroscopic_terms so many an answer has at most
  ChannelSum(const model::Model& model, std::size_t gyroscopic_terms);

  /// @param q, v the arm's state
  /// @param q_measured where the planner saw the arm: M of the node velocity is taken there
  /// @param period_s T, over which the node's change of velocity is spread
  /// @param mass_scale the planner's masses over the model's
  void sum(dynamics::Workspace& ws, const planning::CommandBuffers& command, const Eigen::VectorXd& q,
           const Eigen::VectorXd& v, const Eigen::VectorXd& q_measured, double period_s, double mass_scale,
           Eigen::VectorXd& torque);

 private:
  const model::Model& model_;
  std::vector<dynamics::GyroscopicTerm> terms_;
  Eigen::VectorXd change_, part_;
};

}  // namespace hamelin::control
