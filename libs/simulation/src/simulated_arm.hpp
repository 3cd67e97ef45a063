#pragma once
#include <Eigen/Core>
#include <memory>

#include "hamelin/integration/integrator.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::simulation {

/// The arm that is simulated: its integrator, its state, and what acts on it during the next step.
struct SimulatedArm {
  /// At the scene's start. Friction and damping of the scene are among the channels.
  /// @throws Error invalid for numbers that do not fit the robot, usage for an unknown integrator
  SimulatedArm(const scene::Scene& scene, const model::Model& model, const integration::Parameters& options);

  /// Advances by one step. @return whether it converged; else the state is as it was
  [[nodiscard]] bool step(double step_s);

  const model::Model& model;
  dynamics::Workspace ws;
  std::unique_ptr<integration::Integrator> integrator;
  Eigen::VectorXd own_damping;  ///< viscous, of the joints themselves; of size zero for none
  integration::State state;
  integration::Channels channels;
  integration::StepReport report;  ///< of the last step
  Eigen::VectorXd v;               ///< at the node, as the planner sees it
};

}  // namespace hamelin::simulation
