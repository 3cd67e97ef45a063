#pragma once
#include "loop/discrete_arm.hpp"
#include "loop/drive.hpp"
#include "loop/torque_limits.hpp"

namespace hamelin::control {

/// Sends nothing, but sets the channels of an arm that makes exactly the discrete step: the
/// potential as half-kicks at both nodes of a step, damping and gyroscopic terms at the step's own
/// velocity, the node velocity at once: docs/theory.md (8.1)–(8.3). Before a shield decides on a
/// step, the arm tries it.
class IdealDrive final : public Drive {
 public:
  /// @param arm kept by reference
  IdealDrive(const scene::Scene& scene, DiscreteArm& arm, const DriveOptions& options);

  void measure(const Eigen::VectorXd& q, const Eigen::VectorXd& v, bool seen) override;
  void start() override;
  void forget() noexcept override { arm_.closes_with_kick = false; }
  void continue_from(const Drive& other) override;
  void take_over() override;
  bool propose(const planning::CommandBuffers& answer) override;
  std::optional<Shield::Step> step() override;
  StopFinder::Start stop_start() override;
  void follow(Stop& stop) override;
  const Setpoint& send() override { return setpoint_; }

 private:
  /// Mends the half-kick that closed the last step, docs/theory.md (8.4).
  void correct_kick();
  void set_channels(const planning::CommandBuffers& answer);
  void set_node_velocity(const planning::CommandBuffers& answer);
  void kick();

  DiscreteArm& arm_;
  double step_s_;
  std::size_t gyroscopic_terms_max_;
  TorqueLimits limits_;
  Eigen::VectorXd gradient_, gradient_before_;  ///< of the control potential, and at the last node
  Eigen::VectorXd impulse_, change_, zero_;
  integration::State measured_;  ///< the arm's state at the node, before the drive changes it
  Setpoint setpoint_;
};

}  // namespace hamelin::control
