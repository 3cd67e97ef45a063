#pragma once
#include <Eigen/Core>
#include <string>

#include "hamelin/integration/integrator.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/simulation/plant.hpp"
#include "loop/discrete_arm.hpp"

namespace hamelin::simulation {

/// Hamelin's own plant: an arm that makes the steps of an integrator. Under ideal actuation the
/// controller sets what acts on it; under other actuation it is used as any Plant.
class SimulatedArm final : public Plant {
 public:
  /// @throws Error invalid for numbers that do not fit the robot, usage for an unknown integrator
  SimulatedArm(const scene::Scene& scene, const model::Model& model,
               const integration::Parameters& options);

  [[nodiscard]] const Description& description() const noexcept override { return description_; }
  void start(const Eigen::VectorXd& q, const Eigen::VectorXd& v) override;
  [[nodiscard]] bool step(const Eigen::VectorXd& torque, double step_s) override;
  void take_load() override;
  void push(std::span<const dynamics::ExternalWrench> wrenches) override {
    arm_.channels.wrenches.assign(wrenches.begin(), wrenches.end());
  }
  [[nodiscard]] integration::Energy energy() override {
    return arm_.integrator->energy(arm_.state, node_.v);
  }

  [[nodiscard]] control::DiscreteArm& arm() noexcept { return arm_; }
  /// Makes a step with what acts on arm() as it is.
  [[nodiscard]] bool make_step(double step_s);
  /// Sets the node's velocity to that of arm().
  void update_velocity() { node_.v = arm_.v; }

 private:
  std::string scheme_;
  integration::Parameters options_;
  control::DiscreteArm arm_;
  Description description_;
};

}  // namespace hamelin::simulation
