#pragma once
#include "hamelin/planning/nominal_arm.hpp"
#include "hamelin/planning/plugin.hpp"
#include "turning.hpp"

namespace hamelin::gyro {

/// The improved potential field of Shen, Wang, Shi (2021) as published: gyroscopic forces replace
/// the repulsion, and the limits of the joints are not regarded. The algorithm keep_attraction
/// differs from it in the attraction only.
class Published final : public planning::Planner {
 public:
  Published(const planning::Setup& setup, const Json& params);
  void tick(const planning::Tick& tick, planning::Command& command) override;

 private:
  planning::Setup setup_;
  planning::NominalArm arm_;
  Turning turning_;
  double k_p_, k_v_, joint_damping_;
  bool keep_attraction_, gravity_compensation_;
  Eigen::VectorXd tau_;
};

}  // namespace hamelin::gyro
