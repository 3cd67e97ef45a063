#pragma once
#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "hamelin/control/fail_safe.hpp"
#include "hamelin/control/levers.hpp"
#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/stop_motion.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::control {

/// By how much an arm may stray from a stop, given the errors that a scene states:
/// docs/theory.md (14.17)–(14.21). No allocation after construction.
class Straying {
 public:
  /// @param model, levers kept by reference
  /// @param period_s time between two steps
  /// @param feedback_rate ω of a stop's feedback, docs/theory.md (14.14) [1/s]
  /// @param torque_rate largest rate of change of each torque [Nm/s or N/s]; zero: unbounded
  Straying(const scene::Scene& scene, const model::Model& model, const Levers& levers,
           double period_s, double feedback_rate, double torque_rate);

  /// Sets the bounds for a stop.
  void bound(const StopMotion& stop);
  /// Sets the bounds for an arm that rests at q.
  void bound_at_rest(const Eigen::VectorXd& q);
  /// Raises them, where need be, to those of the move of a FailSafe after its stop.
  void include_move(const FailSafe& motion);
  /// What the motion itself causes, of each joint [rad or m].
  [[nodiscard]] const Eigen::VectorXd& tracking() const noexcept { return tracking_; }
  /// What errors of the model and noise cause in addition, of each joint [rad or m].
  [[nodiscard]] const Eigen::VectorXd& errors() const noexcept { return errors_; }
  /// The same of each shape [m], far less than the joints' added up; of size zero: none.
  [[nodiscard]] const Eigen::VectorXd& shapes() const noexcept { return shapes_; }
  /// Bound of the friction that the model does not have, of each joint [Nm or N].
  [[nodiscard]] const Eigen::VectorXd& friction() const noexcept { return friction_; }
  /// Bound of the noise of measured joint positions [rad or m].
  [[nodiscard]] double noise() const noexcept { return noise_; }

  /// What is not known of an arm that rests, or moves at a constant speed.
  struct AtRest {
    Eigen::VectorXd position;  ///< by how much each joint may stray [rad or m]
    Eigen::VectorXd velocity;  ///< by how much it may be faster than it seems [rad/s or m/s]
  };
  [[nodiscard]] AtRest at_rest(const Eigen::VectorXd& q);

 private:
  [[nodiscard]] bool has_model_errors() const {
    return mass_error_ > 0.0 || !friction_.isZero(0.0);
  }
  /// A motion whose errors are bounded: where, how fast and for how long the arm moves.
  struct Effort {
    const Eigen::VectorXd &q, &velocity, &acceleration;
    double duration_s, ramp_s;
  };
  void bound(const Effort& effort);
  void add_model_errors(const Effort& effort);
  void add_noise();
  /// Sets mass_ and mass_inverse_.
  void invert_mass(const Eigen::VectorXd& q);
  /// Sets shapes_ for the unexplained torque torque_.
  void bound_shapes(const Eigen::VectorXd& q, double compliance_s2);

  const model::Model& model_;
  const Levers& levers_;
  double period_s_;
  bool limits_rate_;          ///< whether torques change at a bounded rate
  double mass_error_;         ///< bound of unexplained torques as a share of the model's own
  Eigen::VectorXd friction_;  ///< bound of unexplained friction of each joint [Nm or N]
  double noise_;
  double compliance_s2_;     ///< by how much a joint strays per unexplained acceleration
  double velocity_error_s_;  ///< of a velocity per unexplained acceleration
  Eigen::VectorXd stated_;   ///< safety.tracking_rad
  Eigen::VectorXd tracking_, errors_, shapes_;
  Eigen::VectorXd before_tracking_, before_errors_, before_shapes_, velocity_, acceleration_;
  Eigen::MatrixXd mass_, mass_inverse_;
  Eigen::LLT<Eigen::MatrixXd> factors_;
  Eigen::VectorXd torque_, bias_;
  dynamics::Matrix6Xd jacobian_, response_;  ///< response: acceleration of a link per torque
  dynamics::Workspace ws_;
};

}  // namespace hamelin::control
