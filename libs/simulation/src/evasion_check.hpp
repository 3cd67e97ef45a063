#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/simulation/explain.hpp"

namespace hamelin::simulation {

/// Whether an arm can make a motion, and whether the motion is clear, by dense sampling.
class EvasionCheck {
 public:
  /// What a controller knew when it had to decide.
  struct Knowledge {
    double time_s = 0.0;
    std::vector<std::uint8_t> seen;  ///< see scene::Environment::reveal_visible
  };

  EvasionCheck(const scene::Scene& scene, const model::Model& model,
               const scene::Environment& environment);

  /// Sets the shortest duration with which the motion is within the limits of the joints.
  /// @return false if there is none
  bool fit_duration(Evasion& evasion);
  /// Whether the motion stays clear of everything, itself included, until a time and to its end.
  bool is_clear(const Evasion& evasion, double until_s);
  /// Whether it stays clear of all obstacles as a controller knew and predicted them.
  bool looks_clear(const Evasion& evasion, double until_s, const Knowledge& knowledge);
  /// Distance from all obstacles at a time [m], at most 2 cm. @param knowledge null: as they are
  double clearance(const Eigen::VectorXd& q, double time_s, const Knowledge* knowledge);

  [[nodiscard]] const control::ModelledLimits& limits() const noexcept { return limits_; }

 private:
  /// Whether the motion is within the limits at this number of equal intervals.
  bool is_within_limits(const Evasion& evasion, int intervals);
  bool is_state_within_limits(const Evasion& evasion) const;
  void set_torque();
  bool stays_clear(const Evasion& evasion, double until_s, const Knowledge* knowledge);
  bool touches_itself();

  const model::Model& model_;
  const scene::Environment& environment_;
  std::optional<scene::SelfField> self_;  ///< none if self-collision is not modelled
  control::ModelledLimits limits_;
  // of size zero, or infinite: none
  Eigen::VectorXd acceleration_max_, jerk_max_, damping_, friction_;
  double torque_rate_, friction_speed_;
  dynamics::Workspace ws_;
  scene::PlacedShapes arm_;
  Evasion::State state_;
  Eigen::VectorXd torque_, torque_before_;
};

}  // namespace hamelin::simulation
