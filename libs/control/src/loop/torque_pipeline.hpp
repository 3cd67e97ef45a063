#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "loop/stop.hpp"

namespace hamelin::control {

/// The torques that are on their way to an arm whose torques act late, and where the arm will be
/// when they have acted: docs/theory.md (14.16). What the model does not explain is expected to go
/// on. No allocation after construction.
class TorquePipeline {
 public:
  /// @param delay_periods how many periods after the tick its torque acts
  /// @param period_s for which each torque is held
  TorquePipeline(const model::Model& model, std::size_t delay_periods, double period_s);

  /// The state when the next torque begins to act, from the state now.
  /// @param disturbance acceleration that the model does not explain [rad/s² or m/s²]
  void predict(dynamics::Workspace& ws, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
               const Eigen::VectorXd& disturbance);
  [[nodiscard]] const Eigen::VectorXd& q() const noexcept { return q_; }
  [[nodiscard]] const Eigen::VectorXd& v() const noexcept { return v_; }
  [[nodiscard]] Stop::Node now() const noexcept { return {q_, v_}; }
  /// The state one period after q(), v() if this torque acts, and its acceleration.
  void advance(dynamics::Workspace& ws, const Eigen::VectorXd& torque);
  [[nodiscard]] const Eigen::VectorXd& q_next() const noexcept { return q_next_; }
  [[nodiscard]] const Eigen::VectorXd& v_next() const noexcept { return v_next_; }
  [[nodiscard]] Stop::Node next() const noexcept { return {q_next_, v_next_}; }
  [[nodiscard]] const Eigen::VectorXd& acceleration() const noexcept { return rate_; }

  /// Forgets the past: this torque has acted and will act.
  void start_from(const Eigen::VectorXd& torque);
  /// Goes on where that of the arm with another load was.
  void continue_from(const TorquePipeline& other);
  /// Sends the torque of this tick.
  void send(const Eigen::VectorXd& torque);
  /// The torque that was sent last.
  [[nodiscard]] const Eigen::VectorXd& last() const noexcept { return last_; }
  /// The torque that acts since the last tick.
  [[nodiscard]] const Eigen::VectorXd& acting() const noexcept { return acting_; }

 private:
  void step(dynamics::Workspace& ws, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
            const Eigen::VectorXd& torque);

  const model::Model& model_;
  double period_s_;
  std::vector<Eigen::VectorXd> waiting_;  ///< oldest at first_
  std::size_t first_ = 0;
  Eigen::VectorXd q_, v_, q_next_, v_next_, rate_, last_, acting_, disturbance_;
};

}  // namespace hamelin::control
