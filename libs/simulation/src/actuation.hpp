#pragma once
#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

#include "energy_audit.hpp"
#include "hamelin/control/controller.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "simulated_arm.hpp"

namespace hamelin::simulation {

/// How a planner's commands become motion.
class Actuation {
 public:
  Actuation() = default;
  Actuation(const Actuation&) = delete;
  Actuation& operator=(const Actuation&) = delete;
  virtual ~Actuation() = default;

  /// Computes the arm's velocity at a node, into arm.v, before the planner is called.
  virtual void reach_node(SimulatedArm& arm) = 0;
  /// Whether the planner is called at node k.
  [[nodiscard]] virtual bool asks_planner(long k) const = 0;
  /// Books the node's energies with the planner's answer at the node.
  virtual void book(SimulatedArm& arm, const planning::CommandBuffers& answer,
                    EnergyAudit& audit) = 0;
  /// Puts the answer into the channels and the state. It acts until the next node.
  virtual void apply(SimulatedArm& arm, const control::Answer& answer, EnergyAudit& audit) = 0;
  /// Whether the account of the last node needs one more answer of the planner.
  [[nodiscard]] virtual bool needs_answer_at_end() const = 0;
  /// Velocity with which the motion leaves the node.
  [[nodiscard]] virtual const Eigen::VectorXd& departure_velocity(SimulatedArm& arm) = 0;
  /// Torque of each channel that acts from this node on, and their sum, for the log.
  virtual void torques(SimulatedArm& arm, const planning::CommandBuffers& answer,
                       Eigen::VectorXd& sum, Json& channels) = 0;
  /// Whether a limit cut the current answer.
  [[nodiscard]] virtual bool saturated() const = 0;
  /// By how much the torque changed from tick to tick; null under ideal actuation.
  [[nodiscard]] virtual const log::TorqueChange* torque_change() const { return nullptr; }
  /// Whether the scene limits torques.
  [[nodiscard]] virtual bool limited() const = 0;
};

/// The actuation of a scene.
/// @throws Error invalid for periods and delays that are not integer multiples of the step
[[nodiscard]] std::unique_ptr<Actuation> make_actuation(const scene::Scene& scene,
                                                        SimulatedArm& arm);

/// Steps between two ticks of the planner. @throws Error invalid
[[nodiscard]] long steps_per_tick(const scene::Scene& scene);

}  // namespace hamelin::simulation
