#pragma once
#include <Eigen/Core>
#include <memory>

#include "hamelin/integration/integrator.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/simulation/plant.hpp"

namespace hamelin::simulation {

/// Hamelin's own plant: an integrator, its state, and the channels that act during the next step.
/// Ideal actuation sets the channels itself; other actuation uses it as any Plant.
class SimulatedArm final : public Plant {
 public:
  /// @throws Error invalid for numbers that do not fit the robot, usage for an unknown integrator
  SimulatedArm(const scene::Scene& scene, const model::Model& model,
               const integration::Parameters& options);

  [[nodiscard]] const Description& description() const noexcept override { return description_; }
  void start(const Eigen::VectorXd& q, const Eigen::VectorXd& v) override;
  [[nodiscard]] bool step(const Eigen::VectorXd& torque, double step_s) override;
  void take_load() override;
  [[nodiscard]] integration::Energy energy() override { return integrator->energy(state, node_.v); }

  /// Advances with the channels as they are. The node's velocity is updated by update_velocity().
  [[nodiscard]] bool step_channels(double step_s);
  /// Takes a step that was made from the present state with step() of the integrator.
  void accept(const integration::State& stepped, const integration::StepReport& report,
              double step_s);
  /// Sets the node's velocity to that of the state, after a step, a kick or a new velocity.
  void update_velocity() { integrator->velocity(state, node_.v); }

  const model::Model& model;
  dynamics::Workspace ws;
  std::unique_ptr<integration::Integrator> integrator;
  Eigen::VectorXd own_damping;  ///< viscous, of the joints themselves; size zero: none
  integration::State state;
  integration::Channels channels;  ///< friction and damping of the joints included

 private:
  /// Makes the state the node.
  void reach(double step_s);
  std::string scheme_;
  integration::Parameters options_;
  Description description_;
};

}  // namespace hamelin::simulation
