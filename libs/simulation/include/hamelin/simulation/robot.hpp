#pragma once
#include <Eigen/Core>
#include <memory>
#include <string>

#include "hamelin/control/controller.hpp"
#include "hamelin/log/result.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/simulation/plant.hpp"

namespace hamelin::simulation {

class Actuation;
class Judge;

/// A simulated robot apart from its controller: a plant, what measures it, what makes set points
/// act on it, and a judge. For controllers in another process.
class Robot {
 public:
  /// @throws Error as run() does for the robot's part of a scene, and usage for ideal actuation and
  ///         for events, which only run() simulates
  Robot(const scene::Scene& scene, const PlantFactory& plant_factory);
  ~Robot();
  Robot(const Robot&) = delete;
  Robot& operator=(const Robot&) = delete;

  /// Of a period of the controller [s].
  [[nodiscard]] double period_s() const noexcept { return period_s_; }
  [[nodiscard]] double time_s() const noexcept;
  [[nodiscard]] int dof() const noexcept { return model_.dof(); }
  /// What the controller is shown at a tick.
  void measure(Eigen::VectorXd& q, Eigen::VectorXd& v);
  /// Moves for a period by a set point: the torque, or q_next and v_next, of an answer.
  /// @return whether the run can go on; else see cause()
  [[nodiscard]] bool move(const control::Answer& setpoint);
  /// Why the run ended; empty if it can go on.
  [[nodiscard]] const std::string& cause() const noexcept { return cause_; }
  [[nodiscard]] log::Outcome outcome() const noexcept { return outcome_; }
  /// What the judge and the plant found: clearances, proofs, limits and contacts.
  void fill(log::Result& result) const;

 private:
  void finish(log::Outcome outcome, std::string cause);
  void observe_node();

  const scene::Scene scene_;
  model::Model model_;
  double period_s_;
  long steps_per_period_;
  std::unique_ptr<Plant> plant_;
  std::unique_ptr<Actuation> actuation_;
  std::unique_ptr<Judge> judge_;
  log::Result counts_;
  log::Outcome outcome_ = log::Outcome::timeout;
  std::string cause_;
};

}  // namespace hamelin::simulation
