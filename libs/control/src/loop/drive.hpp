#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <optional>
#include <vector>

#include "hamelin/control/line_buffer.hpp"
#include "hamelin/control/planner_setup.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/scene.hpp"
#include "loop/discrete_arm.hpp"
#include "loop/stop.hpp"
#include "shield/shield.hpp"

namespace hamelin::control {

/// What a robot is sent. ideal: nothing, but the arm of a simulation makes the discrete step.
enum class DriveKind { ideal, torque, position };

/// What a Drive is made with.
struct DriveOptions {
  DriveKind kind = DriveKind::torque;
  double period_s = 0.001;        ///< between two ticks
  std::size_t delay_periods = 0;  ///< after which a torque acts
  std::size_t gyroscopic_terms_max = 0;
  DiscreteArm* arm = nullptr;  ///< of an ideal drive; kept by reference
  /// Of set points, per joint [rad/s² and rad/s³, or m/s² and m/s³].
  Eigen::VectorXd acceleration_max, jerk_max;
  Eigen::VectorXd tracking_max;  ///< how far the arm may be from its set point [rad or m]
  [[nodiscard]] ChangeBounds changes(const scene::Scene& scene) const;
};

/// What is sent.
struct Setpoint {
  Eigen::VectorXd torque;  ///< within the limits of torque and its rate [Nm or N]
  bool saturated = false;  ///< whether a limit reduced it
  Eigen::VectorXd q, v;    ///< one period ahead, where positions are sent
};

/// What a planner is shown of torques; null where there are none.
struct Torques {
  const Eigen::VectorXd* last = nullptr;  ///< that was sent, or that of the set point
  /// The acceleration that the controller's model does not explain [rad/s² or m/s²].
  const Eigen::VectorXd* disturbance = nullptr;
};

/// Makes set points of a planner's answers. It knows where the arm is, what was sent last, and the
/// limits of what can be sent. In each tick: measure(), and then either propose() and, with a
/// shield, step(), or follow() where the proposal must not act; send() at the end. No allocation
/// after construction.
class Drive {
 public:
  Drive() = default;
  Drive(const Drive&) = delete;
  Drive& operator=(const Drive&) = delete;
  virtual ~Drive() = default;

  /// Takes what was measured. @param seen whether it can be used; else it is not read
  virtual void measure(const Eigen::VectorXd& q, const Eigen::VectorXd& v, bool seen) = 0;
  /// The state that planner, goals and shield are shown: measured, estimated, or the set point.
  [[nodiscard]] const Eigen::VectorXd& q() const noexcept { return q_; }
  [[nodiscard]] const Eigen::VectorXd& v() const noexcept { return v_; }
  [[nodiscard]] Stop::Node node() const noexcept { return {q_, v_}; }

  /// At the first tick, after measure(): holds the arm until something else acts.
  virtual void start() = 0;
  /// The next tick is the first one again.
  virtual void forget() noexcept = 0;
  /// Takes the state of the drive of the arm with another load, of the same kind.
  virtual void continue_from(const Drive& other) = 0;
  /// From now on this one acts, in place of the one that it continues.
  virtual void take_over() {}
  /// Goes on when a stop ends, from where the arm is.
  virtual void resume() {}
  /// Writes that the arm does not do what it was sent; nothing if it does.
  virtual void describe_defect(LineBuffer&) const {}

  [[nodiscard]] virtual Torques torques() const noexcept { return {}; }
  /// What an answer makes of it, within the limits of the drive. @return false if that is no number
  [[nodiscard]] virtual bool propose(const planning::CommandBuffers& answer) = 0;
  /// Where the proposal leads to; none if it leads nowhere. Refers to the drive.
  [[nodiscard]] virtual std::optional<Shield::Step> step() = 0;
  /// Where a stop can begin, and what acts there. Refers to the drive.
  [[nodiscard]] virtual StopFinder::Start stop_start() = 0;
  void begin(Stop& stop) { stop.begin(stop_start()); }
  /// The next period of a stop instead of a proposal.
  virtual void follow(Stop& stop) = 0;
  /// What acts in the next period.
  virtual const Setpoint& send() = 0;

 protected:
  Eigen::VectorXd q_, v_;
};

/// @param model the controller's model of the arm, kept by reference
/// @param reserve what a shield keeps of the limits
[[nodiscard]] std::unique_ptr<Drive> make_drive(const scene::Scene& scene,
                                                const model::Model& model,
                                                const DriveOptions& options,
                                                const LimitReserve& reserve);
/// Larger numbers are neither torques nor accelerations [Nm or N, rad/s² or m/s²]: what follows
/// from them may overflow. Also false for numbers that are not finite.
[[nodiscard]] bool can_be_sent(const Eigen::VectorXd& x);

}  // namespace hamelin::control
