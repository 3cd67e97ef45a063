#pragma once
#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/scene/levers.hpp"
#include "hamelin/scene/scene.hpp"
#include "shield/fail_safe.hpp"
#include "shield/stop_motion.hpp"

namespace hamelin::control {

/// Bound of the friction that a scene's model of the arm does not have, of each joint [Nm or N].
[[nodiscard]] Eigen::VectorXd unknown_friction(const scene::Scene& scene,
                                               const model::Robot& robot);

/// By how much an arm may stray from a stop, given the errors that a scene states:
/// docs/theory.md (14.17)–(14.21). No allocation after construction.
class Straying {
 public:
  /// @param model, levers kept by reference
  /// @param period_s time between two steps
  /// @param feedback_rate ω of a stop's feedback, docs/theory.md (14.14) [1/s]
  /// @param torque_rate largest rate of change of each torque [Nm/s or N/s]; zero: unbounded
  Straying(const scene::Scene& scene, const model::Model& model, const scene::Levers& levers,
           double period_s, double feedback_rate, double torque_rate);

  /// By how much the arm may stray from a motion.
  struct Bounds {
    Eigen::VectorXd tracking;  ///< what the motion itself causes, of each joint [rad or m]
    /// What errors of the model and noise cause in addition, of each joint [rad or m].
    Eigen::VectorXd errors;
    /// The same of each shape [m], far less than the joints' added up; of size zero: none.
    Eigen::VectorXd shapes;
    /// Raises them to others where these are larger.
    void include(const Bounds& others);
  };

  /// Sets the bounds for a stop.
  void bound(const StopMotion& stop);
  /// The same for a stop along a path.
  void bound(const PathStop& stop);
  /// Sets the bounds for the stop of a motion.
  void bound_stop(const FailSafe& motion) {
    motion.along_path() ? bound(motion.path_stop()) : bound(motion.stop());
  }
  /// Sets the bounds for an arm that rests at q.
  void bound_at_rest(const Eigen::VectorXd& q);
  /// Raises them, where need be, to those of the move of a FailSafe after its stop.
  void include_move(const FailSafe& motion);
  /// Adds to what the motion itself causes.
  void add_tracking(const Eigen::VectorXd& more) { bounds_.tracking += more; }
  [[nodiscard]] const Bounds& bounds() const noexcept { return bounds_; }
  [[nodiscard]] const Eigen::VectorXd& tracking() const noexcept { return bounds_.tracking; }
  [[nodiscard]] const Eigen::VectorXd& errors() const noexcept { return bounds_.errors; }
  [[nodiscard]] const Eigen::VectorXd& shapes() const noexcept { return bounds_.shapes; }
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
  /// Sets them for an arm that is as modelled, whose velocity changes by so much.
  void begin(const Eigen::VectorXd& velocity, const Eigen::VectorXd& acceleration);
  /// Raises errors and shapes to what errors of the model cause there.
  void include_model_errors(const Effort& effort);
  void add_noise();
  /// Sets mass_ and mass_inverse_.
  void invert_mass(const Eigen::VectorXd& q);
  /// Raises the shapes' bounds to those for the unexplained torque torque_.
  void include_shapes(const Eigen::VectorXd& q, double compliance_s2);

  const model::Model& model_;
  const scene::Levers& levers_;
  double period_s_, feedback_rate_;
  bool limits_rate_;          ///< whether torques change at a bounded rate
  double mass_error_;         ///< bound of unexplained torques as a share of the model's own
  Eigen::VectorXd friction_;  ///< bound of unexplained friction of each joint [Nm or N]
  double noise_;
  /// By how much a joint strays per bound of an unexplained acceleration, whatever its course.
  double compliance_s2_;
  double estimate_s2_;       ///< the same for wrong estimates of velocity
  double velocity_error_s_;  ///< of a velocity per unexplained acceleration
  double lag_s_ = 0.0;       ///< drift per change of velocity
  Eigen::VectorXd stated_;   ///< safety.tracking_rad
  Bounds bounds_, before_;
  Eigen::VectorXd q_, velocity_, acceleration_;
  Eigen::MatrixXd mass_, mass_inverse_;
  Eigen::LLT<Eigen::MatrixXd> factors_;
  Eigen::VectorXd torque_, bias_;
  dynamics::Matrix6Xd jacobian_, response_;  ///< response: acceleration of a link per torque
  dynamics::Workspace ws_;
};

}  // namespace hamelin::control
