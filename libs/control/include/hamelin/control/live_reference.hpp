#pragma once
#include <Eigen/Core>

#include "hamelin/scene/scene.hpp"

namespace hamelin::control {

/// Where the motion of a trajectory goal is at the time of a tick. It waits for an arm that is held
/// up, so its own time may run slower than that of the ticks.
struct ReferenceState {
  Eigen::VectorXd q, v, a;  ///< that the arm should have now; dof numbers each
  double time_s = 0.0;      ///< on the clock of the trajectory
  double rate = 1.0;        ///< how fast that clock runs, 0 to 1
  double error = 0.0;       ///< largest distance of a joint from q [rad or m]
  bool ended = false;       ///< whether time_s is the trajectory's end
  bool certified = false;   ///< whether it is that of a path which is proved to be clear

  /// The rate of the clock for an error: full while no joint is farther from the reference than
  /// `tracked_within`, and zero beyond `left_beyond` [rad or m]; docs/theory.md (18.16).
  [[nodiscard]] static double rate_for(double error) noexcept;
  static constexpr double tracked_within = 0.02, left_beyond = 0.1;
  /// Makes velocity and acceleration at full rate those at `rate`, which changes by so much [1/s].
  void slow_down(double rate_change);
};

/// The reference of a trajectory goal from tick to tick, docs/theory.md (18.16). It belongs to the
/// thread of the ticks, and neither allocates nor locks.
class LiveReference {
 public:
  explicit LiveReference(Eigen::Index dof);

  /// Starts with a goal that has a trajectory. It must outlive this, or stay until the next start.
  void start(const scene::Goal& goal) noexcept;
  void stop() noexcept { goal_ = nullptr; }
  /// The goal whose reference it is; null before start() and after stop().
  [[nodiscard]] const scene::Goal* goal() const noexcept { return goal_; }

  /// Moves on by a period, not at the first call after start(). @param q, v of the arm
  const ReferenceState& update(double period_s, const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  [[nodiscard]] const ReferenceState& state() const noexcept { return state_; }
  /// Whether the arm is on the trajectory and has not come to its end: its goal does not yet count
  /// as reached, even if the arm is at the end's configuration.
  [[nodiscard]] bool on_the_way() const noexcept;

 private:
  void begin(const Eigen::VectorXd& q);
  void move_on(double period_s);
  /// Goes to where the trajectory passes near q later on, if it does.
  void rejoin(const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  /// Evaluates the trajectory at the state's time. @param rate_change of the rate [1/s]
  void evaluate(double rate_change);
  [[nodiscard]] double error_of(const Eigen::VectorXd& q) const;
  /// The next time at which the trajectory passes near q; below 0 if there is none.
  [[nodiscard]] double time_near(const Eigen::VectorXd& q);

  const scene::Goal* goal_ = nullptr;
  ReferenceState state_;
  bool started_ = false;
  Eigen::Index point_ = 0;  ///< the last one that was passed
  Eigen::VectorXd between_, offset_;
};

}  // namespace hamelin::control
