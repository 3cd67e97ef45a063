#pragma once
#include <Eigen/Core>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/scene.hpp"
#include "loop/stop_finder.hpp"
#include "shield/fail_safe.hpp"
#include "shield/straying.hpp"

namespace hamelin::control {

/// The motion to rest that goes on while no answer of a planner acts, whatever the cause, and the
/// feedback that keeps the arm on it: docs/theory.md (14.14), (14.15). With a shield it is one that
/// the shield has verified. No allocation after construction.
class Stop {
 public:
  /// A configuration and a velocity.
  struct Node {
    const Eigen::VectorXd& q;
    const Eigen::VectorXd& v;
  };
  /// @param model, finder, straying kept by reference; straying null: how far the arm may stray is
  ///        not known
  /// @param period_s time between two steps
  Stop(const scene::Scene& scene, const model::Model& model, double period_s,
       const ChangeBounds& changes, StopFinder& finder, Straying* straying);

  /// Begins another motion, in exchange for the one before.
  /// @param bounds by how much the arm may stray from it
  void begin(FailSafe& motion, const Straying::Bounds& bounds);
  /// Begins one where the arm is. Beyond the torque limits if it needs more.
  void begin(const StopFinder::Start& start);
  /// Goes on with another motion at a time from its start.
  void turn_to(FailSafe& motion, double from_s, const Straying::Bounds& more);

  /// The torque for the next period, and goes on by that: docs/theory.md (14.14).
  /// @param disturbance acceleration that acts besides that of the torques [rad/s² or m/s²]
  /// @param last the torque of the period before, where torques change at a bounded rate
  void torque(const Node& node, const Eigen::VectorXd& disturbance, const Eigen::VectorXd& last,
              Eigen::VectorXd& torque);
  /// Goes on by a period. Where the motion is then, for arms that are controlled by position.
  void point(Eigen::VectorXd& q, Eigen::VectorXd& v);

  [[nodiscard]] const FailSafe& motion() const noexcept { return motion_; }
  /// Since the motion began [s].
  [[nodiscard]] double time_s() const noexcept { return time_s_; }
  /// Whether the motion has ended.
  [[nodiscard]] bool at_rest() const noexcept { return time_s_ >= motion_.duration_s(); }
  /// Whether it moves on after the stop itself, and has begun to.
  [[nodiscard]] bool has_stopped() const noexcept { return time_s_ >= motion_.stop_s(); }
  [[nodiscard]] const Straying::Bounds& bounds() const noexcept { return bounds_; }
  /// ω of docs/theory.md (14.14) [1/s].
  [[nodiscard]] static double feedback_rate(double period_s) noexcept;

  /// The largest deviations from the motion.
  struct Strayed {
    double most = 0.0;   ///< of a joint [rad or m]
    double share = 0.0;  ///< of the bound
    int joint = -1;      ///< whose share that is
  };
  [[nodiscard]] const Strayed& strayed() const noexcept { return strayed_; }
  void set_strayed(const Strayed& strayed) noexcept { strayed_ = strayed; }

 private:
  /// The torque that keeps to the motion in the next period.
  void follow(const Node& node, const Eigen::VectorXd& disturbance, Eigen::VectorXd& torque);
  /// Adds what resists a disturbance at rest.
  void resist(const Eigen::VectorXd& disturbance, Eigen::VectorXd& torque);
  /// Sets rate_ to the acceleration that brings the arm back to the motion.
  void feed_back(const Node& node);
  /// Whether the arm has strayed beyond its bounds, and the torque that would bring it back is
  /// farther from the last one than the drives can go in the time of the feedback.
  [[nodiscard]] bool is_lost(const Node& node, const Eigen::VectorXd& torque,
                             const Eigen::VectorXd& last) const;
  /// Lets the stop begin again from where the arm is.
  void begin_again(const Node& node, const Eigen::VectorXd& disturbance,
                   const Eigen::VectorXd& last);
  void note_straying(Eigen::Index joint, double strayed);

  const model::Model& model_;
  StopFinder& finder_;
  Straying* straying_;
  bool sampled_;  ///< whether actuation is not ideal
  double period_s_, feedback_rate_, torque_rate_;
  Eigen::VectorXd effort_max_, damping_, friction_;  ///< of size zero: not modelled
  double friction_speed_;
  Eigen::VectorXd unknown_friction_;  ///< bound of what the model does not have [Nm or N]
  FailSafe motion_, other_;
  double time_s_ = 0.0;
  Straying::Bounds bounds_;
  Eigen::VectorXd stray_;     ///< by how much joints may stray [rad or m]
  Eigen::VectorXd integral_;  ///< of the deviation, times ω [rad or m]
  Strayed strayed_;
  Eigen::VectorXd reference_q_, reference_v_, q_, v_, rate_, acceleration_;
  dynamics::Workspace ws_;
};

}  // namespace hamelin::control
