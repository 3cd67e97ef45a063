#pragma once
#include <Eigen/Core>
#include <memory>

#include "energy_audit.hpp"
#include "hamelin/control/controller.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "simulated_arm.hpp"

namespace hamelin::simulation {

/// The robot's side of the control loop: what measures the arm, and how a controller's answers
/// become motion of a plant.
class Actuation {
 public:
  Actuation() = default;
  Actuation(const Actuation&) = delete;
  Actuation& operator=(const Actuation&) = delete;
  virtual ~Actuation() = default;

  /// The arm carries something else: the model has changed, in place.
  virtual void take_load() {}
  /// The state that the controller is shown at a tick.
  virtual void observe(Eigen::VectorXd& q, Eigen::VectorXd& v) = 0;
  /// Whether node k is a tick.
  [[nodiscard]] virtual bool is_tick(long k) const = 0;
  /// Lets an answer act from the node on. @param fresh whether the node is a tick; else the answer
  /// is that of the last one
  virtual void take(const control::Answer& answer, bool fresh) = 0;
  /// Books the node, after take().
  virtual void book(const control::Answer& answer, bool fresh, EnergyAudit& audit) = 0;
  /// Lets the plant step. @return whether it converged
  [[nodiscard]] virtual bool step(double step_s) = 0;
  /// Whether the account of the last node needs one more answer of the planner.
  [[nodiscard]] virtual bool needs_answer_at_end() const { return false; }
  /// Velocity with which the motion leaves the node.
  [[nodiscard]] virtual const Eigen::VectorXd& departure_velocity() const = 0;
  /// Torque of each channel that acts from this node on, and their sum, for the log.
  /// @param answer null if a stop acts
  virtual void torques(const planning::CommandBuffers* answer, Eigen::VectorXd& sum,
                       Json& channels) = 0;
  /// Whether a limit cut the current answer.
  [[nodiscard]] virtual bool saturated() const = 0;
  /// By how much the torque changed from tick to tick; null under ideal actuation.
  [[nodiscard]] virtual const log::TorqueChange* torque_change() const { return nullptr; }
  /// Whether the scene limits torques.
  [[nodiscard]] virtual bool limited() const = 0;
};

/// That of hamelin's own plant under ideal actuation, which the controller drives itself.
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
