#pragma once
#include <Eigen/Core>
#include <utility>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/scene.hpp"
#include "shield/braking_rate.hpp"
#include "shield/fail_safe.hpp"

namespace hamelin::control {

/// What bounds the changes of an arm's motion.
struct ChangeBounds {
  /// Largest rate of change of each torque [Nm/s or N/s]; zero: unbounded.
  double torque_rate = 0.0;
  /// Of each joint, where positions are sent [rad/s² or m/s²] and [rad/s³ or m/s³]; of size zero:
  /// unbounded.
  Eigen::VectorXd acceleration_max = {}, jerk_max = {};
};

/// Finds a stop within an arm's limits: how fast it can brake, and how long the drives need to
/// begin and to end that, docs/theory.md (14.13). No allocation after construction.
class StopFinder {
 public:
  /// @param model kept by reference @param period_s time between two steps
  StopFinder(const scene::Scene& scene, const model::Model& model, double period_s,
             const ChangeBounds& bounds);

  /// Where a stop begins, and what acts there.
  struct Start {
    const Eigen::VectorXd &q, &v;
    /// With which the arm goes on, where these change at a bounded rate only; else not used.
    const Eigen::VectorXd &acceleration, &torque;
    /// Acceleration that acts besides that of the torque.
    const Eigen::VectorXd& disturbance;
  };
  /// Sets a motion to a stop. @return whether there is one within the torque limits
  [[nodiscard]] bool find(const Start& start, double least_utilisation, FailSafe& out);
  /// The same where there is none: within the bounds of acceleration and jerk, where there are any.
  void force(const Start& start, FailSafe& out);
  /// The share of the allowed torques that the last stop needs.
  [[nodiscard]] double utilisation() const noexcept { return braking_.utilisation(); }

  /// A stop takes at least this time [s]: a torque that stops the arm at once would not resolve the
  /// motion.
  [[nodiscard]] static double least_time_s(bool torque_limits, double period_s) noexcept;
  /// The share of the torques' rate with which a stop is planned: the rest is for its feedback.
  static constexpr double ramp_share = 0.5;

 private:
  /// The ramp and the fade that the bounds require for a rate.
  [[nodiscard]] std::pair<double, double> transition_times(const Start& start, double rate);

  /// Makes the stop keep the bounds of acceleration and jerk, where there are any. Changes w_.
  void keep_bounds(const Start& start, double& rate, double& ramp, double& fade);

  const model::Model& model_;
  ChangeBounds bounds_;
  BrakingRate braking_;
  dynamics::Workspace ws_;
  Eigen::VectorXd w_, q_, rate_, torque_;
};

}  // namespace hamelin::control
