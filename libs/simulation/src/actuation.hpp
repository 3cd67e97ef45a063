#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <memory>

#include "energy_audit.hpp"
#include "hamelin/control/controller.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "simulated_arm.hpp"

namespace hamelin::simulation {

/// How a planner's commands become motion of a plant.
class Actuation {
 public:
  Actuation() = default;
  Actuation(const Actuation&) = delete;
  Actuation& operator=(const Actuation&) = delete;
  virtual ~Actuation() = default;

  /// Completes the plant's velocity at a node, before the planner is called.
  virtual void reach_node() {}
  /// Reserves memory for answers with so many gyroscopic terms.
  virtual void reserve(std::size_t) {}
  /// The arm carries something else: the model has changed, in place.
  virtual void take_load() {}
  /// The state that the controller is shown at a tick.
  virtual void observe(Eigen::VectorXd& q, Eigen::VectorXd& v) = 0;
  /// Whether the planner is called at node k.
  [[nodiscard]] virtual bool asks_planner(long k) const = 0;
  /// Books the last node's energies with the planner's answer at the node.
  virtual void book(const planning::CommandBuffers& answer, EnergyAudit& audit) = 0;
  /// Books the node and makes the controller's answer act from it on, unless a shield refuses it.
  /// Without an answer, the shield's stop acts.
  virtual void apply(control::Controller& controller, EnergyAudit& audit) = 0;
  /// Whether a stop of the shield acts from this node on.
  [[nodiscard]] virtual bool stopping() const { return false; }
  /// Lets the plant step. @return whether it converged
  [[nodiscard]] virtual bool step(double step_s) = 0;
  /// Whether the account of the last node needs one more answer of the planner.
  [[nodiscard]] virtual bool needs_answer_at_end() const = 0;
  /// Velocity with which the motion leaves the node.
  [[nodiscard]] virtual const Eigen::VectorXd& departure_velocity() = 0;
  /// Torque of each channel that acts from this node on, and their sum, for the log.
  virtual void torques(const planning::CommandBuffers* answer, Eigen::VectorXd& sum,
                       Json& channels) = 0;
  /// Whether a limit cut the current answer.
  [[nodiscard]] virtual bool saturated() const = 0;
  /// By how much the torque changed from tick to tick; null under ideal actuation.
  [[nodiscard]] virtual const log::TorqueChange* torque_change() const { return nullptr; }
  /// Whether the scene limits torques.
  [[nodiscard]] virtual bool limited() const = 0;
};

/// The ideal actuation of a scene, which only hamelin's own plant can carry out.
[[nodiscard]] std::unique_ptr<Actuation> make_ideal_actuation(const scene::Scene& scene,
                                                              SimulatedArm& arm);

/// The sampled or position actuation of a scene for a plant that was started.
/// @param model the arm
/// @throws Error invalid for periods and delays that are not integer multiples of the step, and for
///         servo gains that do not fit the robot or are unstable at the step
[[nodiscard]] std::unique_ptr<Actuation> make_sampled_actuation(const scene::Scene& scene,
                                                                const model::Model& model,
                                                                Plant& plant);

/// Steps between two ticks of the planner. @throws Error invalid
[[nodiscard]] long steps_per_tick(const scene::Scene& scene);

}  // namespace hamelin::simulation
