#pragma once
#include <Eigen/Core>
#include <memory>

#include "hamelin/integration/integrator.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::simulation {

/// The simulated arm: its integrator, its state, and the channels that act during the next step.
struct SimulatedArm {
  /// At the scene's start. The channels include friction and damping of the scene.
  /// @throws Error invalid for numbers that do not fit the robot, usage for an unknown integrator
  SimulatedArm(const scene::Scene& scene, const model::Model& model,
               const integration::Parameters& options);

  /// Advances by one step. @return whether it converged; if not, the state is unchanged
  [[nodiscard]] bool step(double step_s);

  const model::Model& model;
  dynamics::Workspace ws;
  std::unique_ptr<integration::Integrator> integrator;
  Eigen::VectorXd own_damping;  ///< viscous, of the joints themselves; size zero: none
  integration::State state;
  integration::Channels channels;
  integration::StepReport report;  ///< of the last step
  Eigen::VectorXd v;               ///< at the node, as the planner is given it
};

}  // namespace hamelin::simulation
