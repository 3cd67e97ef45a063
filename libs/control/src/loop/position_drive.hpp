#pragma once
#include <optional>
#include "loop/drive.hpp"
#include "loop/torque_limits.hpp"

namespace hamelin::control {

/// Sends set points to servos: they follow the planner's velocity, or the one that its torque
/// causes, within bounds of velocity, acceleration and jerk. The planner acts on the set point: if
/// it were shown where servos have brought the arm, it would correct what they are about to
/// correct, and oscillate.
class PositionDrive final : public Drive {
 public:
  PositionDrive(const scene::Scene& scene, const model::Model& model, const DriveOptions& options,
                const LimitReserve& reserve);

  void measure(const Eigen::VectorXd& q, const Eigen::VectorXd& v, bool seen) override;
  void start() override;
  void forget() noexcept override { started_ = false; }
  void continue_from(const Drive& other) override;
  void resume() override;
  void describe_defect(LineBuffer& line) const override;
  Torques torques() const noexcept override { return {&setpoint_.torque}; }
  bool propose(const planning::CommandBuffers& answer) override;
  std::optional<Shield::Step> step() override;
  StopFinder::Start stop_start() override;
  void follow(Stop& stop) override;
  const Setpoint& send() override;

 private:
  [[nodiscard]] bool moves_as_sent() const;
  [[nodiscard]] double rate_up_to(double rise, Eigen::Index joint) const;
  /// Sets the change of velocity to that of rate_ within the bounds, and the set point by it.
  void advance();

  const model::Model& model_;
  DriveOptions options_;
  bool measures_velocity_;
  Eigen::VectorXd velocity_max_;  ///< of size zero: not bounded
  TorqueLimits limits_;
  ChannelSum sum_;
  dynamics::Workspace ws_;
  bool started_ = false;
  Eigen::VectorXd q_measured_, v_measured_;
  Eigen::VectorXd rate_, command_rate_, torque_;
  Setpoint setpoint_;
};

}  // namespace hamelin::control
