#pragma once
#include <optional>

#include "loop/drive.hpp"
#include "loop/state_estimator.hpp"
#include "loop/torque_limits.hpp"
#include "loop/torque_pipeline.hpp"

namespace hamelin::control {

/// Sends torques, which act some periods later. Where a measurement is lost, the arm is where its
/// model and what was not explained last take it.
class TorqueDrive final : public Drive {
 public:
  TorqueDrive(const scene::Scene& scene, const model::Model& model, const DriveOptions& options);

  void measure(const Eigen::VectorXd& q, const Eigen::VectorXd& v, bool seen) override;
  void start() override;
  void forget() noexcept override { started_ = false; }
  void continue_from(const Drive& other) override;
  Torques torques() const noexcept override {
    return {&setpoint_.torque, &estimate_.disturbance()};
  }
  bool propose(const planning::CommandBuffers& answer) override;
  std::optional<Shield::Step> step() override;
  StopFinder::Start stop_start() override;
  void follow(Stop& stop) override;
  const Setpoint& send() override;

 private:
  /// The model's acceleration since the last tick, in rate_.
  void predict_rate();
  /// Where the arm will be when the next torque begins to act; once in a tick.
  void look_ahead();

  const model::Model& model_;
  double period_s_;
  TorqueLimits limits_;
  ChannelSum sum_;
  TorquePipeline pipeline_;
  StateEstimator estimate_;
  bool measures_velocity_;
  dynamics::Workspace ws_;
  bool started_ = false;
  bool seen_ = false;    ///< whether the last measurement could be used
  bool looked_ = false;  ///< ahead in this tick
  /// What a stop starts from: where friction is not known, an estimate lags behind.
  Eigen::VectorXd q_measured_;
  Eigen::VectorXd proposed_, rate_, zero_;
  bool saturated_ = false;
  Setpoint setpoint_;
};

}  // namespace hamelin::control
