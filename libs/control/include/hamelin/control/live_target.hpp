#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <optional>

#include "hamelin/control/motion_estimator.hpp"
#include "hamelin/geometry/se3.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::control {

/// A pose of a target, in the world. Velocities that are not given are estimated from the poses.
using TargetPose = Observation;

/// A velocity with which a target is commanded to move, as by a joystick, in the axes of the world.
struct TargetTwist {
  double time_s = 0.0;  ///< on the clock of Controller::tick()
  Eigen::Vector3d velocity_m_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d angular_velocity_rad_s = Eigen::Vector3d::Zero();
};

/// What a stream said last.
struct StreamedTarget {
  enum class Kind : std::int32_t { none, pose, twist };
  Kind kind = Kind::none;
  double time_s = 0.0;
  scene::MotionState motion;  ///< at that time; of a twist, only its velocities
};

/// The target of a follow goal at the time of a tick.
struct TargetState : scene::MotionState {
  bool waiting = false;  ///< nothing has arrived yet, and the target is where the tip was
  bool lost = false;     ///< the stream broke off, and the target rests
};

/// The receiving end of a stream of targets: checks what arrives and estimates what is missing. It
/// belongs to the threads that write, one at a time.
class TargetReceiver {
 public:
  /// Starts a new stream. @param bounds of what is believed
  void start(const scene::TargetStream& bounds);

  /// Takes a pose. If it has no velocity, the poses are smoothed and their velocities estimated by
  /// (11.46)–(11.49) of docs/theory.md.
  /// @throws Error invalid, "target: …", for numbers that are not finite, a time that is not after
  ///         the last one, and a jump, (16.1); nothing changes then
  [[nodiscard]] StreamedTarget take(const TargetPose& pose);
  /// Takes a twist. @throws Error invalid as above
  [[nodiscard]] StreamedTarget take(const TargetTwist& twist);

 private:
  void check_time(double time_s) const;
  void check_jump(const TargetPose& pose) const;

  scene::TargetStream bounds_;
  StreamedTarget last_;
  std::optional<MotionEstimator> estimator_;
};

/// The target of a follow goal from tick to tick. It belongs to the thread of the ticks, and
/// neither allocates nor locks.
class LiveTarget {
 public:
  /// Starts with a goal, at the tip. The goal must outlive this, or stay until the next start.
  void start(const scene::Goal& goal, const geometry::SE3& tip);
  void stop() noexcept { goal_ = nullptr; }
  /// The goal whose target it is; null before start() and after stop().
  [[nodiscard]] const scene::Goal* goal() const noexcept { return goal_; }

  /// Where the target is at a time: by its motion; by its last pose and twist, (16.2); or moved on
  /// by a commanded twist, near the tip, (16.3).
  const TargetState& update(double time_s, const StreamedTarget& streamed,
                            const geometry::SE3& tip);
  [[nodiscard]] const TargetState& state() const noexcept { return state_; }

 private:
  void extrapolate(const StreamedTarget& streamed, double time_s);
  void move_by_twist(const StreamedTarget& streamed, double time_s, const geometry::SE3& tip);

  const scene::Goal* goal_ = nullptr;
  TargetState state_;
  double time_s_ = 0.0;  ///< of the last update
  bool driven_ = false;  ///< whether the last update was by a twist
};

}  // namespace hamelin::control
