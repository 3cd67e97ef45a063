#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/scene/allowance.hpp"
#include "hamelin/scene/joint_trajectory.hpp"
#include "hamelin/scene/motion.hpp"
#include "hamelin/scene/tip_constraint.hpp"

namespace hamelin::scene {

/// follow: a target that moves, which the tip follows until the run ends; any_of: one of several
/// others.
enum class GoalType : std::int32_t { joint, position, pose, follow, any_of };

[[nodiscard]] std::string_view to_string(GoalType type) noexcept;

/// What is done where a streamed target is lost. hold: the arm holds its place where it can, and
/// resumes with the stream; end: the run ends.
enum class WhenLost : std::int32_t { hold, end };

[[nodiscard]] std::string_view to_string(WhenLost when) noexcept;

/// A target whose poses or twists arrive while the arm moves, and bounds of what is believed.
struct TargetStream {
  std::filesystem::path file;  ///< JSON lines; empty: the program that runs the scene has them
  double gap_max_s = 0.2;      ///< after a longer time without a new line the target is lost
  /// Largest distance of a pose from where the target is expected by its last motion.
  double jump_max_m = 0.1, jump_max_rad = 0.5;
  /// Standard deviation of poses per axis, which are smoothed if the stream has no velocities.
  double noise_m = 0.0005, noise_rad = 0.002;
  /// Targets that are commanded by twists stay so near to the tip.
  double leash_m = 0.05, leash_rad = 0.3;
  WhenLost when_lost = WhenLost::hold;
};

/// The largest number of constraints of a goal.
inline constexpr std::size_t constraints_max = 8;
/// The largest number of options of a goal.
inline constexpr std::size_t options_max = 1000;

/// What the tip keeps on a straight way or an arc.
struct WayTolerance {
  /// Of its point and its rotation, above 0; from π on the rotation is free.
  double m = 0.002, rad = 0.02;
};

/// The whole way to a goal is a line or an arc, on which the tip's rotation changes evenly.
struct TipWay {
  std::optional<Eigen::Vector3d> through_m;  ///< a point of the arc in the world; none: a line
  WayTolerance tolerance;
};

/// The first or the last stretch of the way to a goal is straight, with a rotation that stays.
struct Stretch {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< in which the tip moves, of length 1
  bool in_world = false;                                 ///< else the direction is in its frame
  double distance_m = 0.0;                               ///< above 0
  WayTolerance tolerance;
};

struct Goal {
  GoalType type = GoalType::joint;
  Eigen::VectorXd q;  ///< joint [rad or m]
  /// Joint, if given as a path or a trajectory: way-points as columns, q the last; else empty.
  Eigen::MatrixXd path;
  std::filesystem::path path_file;  ///< that these were read from; empty: the scene file
  /// Joint, if given as a trajectory: the motion to q, whose points are the path.
  std::optional<JointTrajectory> trajectory;
  /// Position, pose: of the tip in the world; rotation unused for position. Follow: of the target
  /// at rest, see Frame::pose.
  geometry::SE3 pose;
  Quaternion quaternion_wxyz{1.0, 0.0, 0.0, 0.0};  ///< see Quaternion
  /// Position, pose: the tip's point may be anywhere in this box about the pose's, in its frame.
  Eigen::Vector3d low_m = Eigen::Vector3d::Zero(), high_m = Eigen::Vector3d::Zero();
  /// Pose: the tip may be turned about this unit vector of its frame.
  std::optional<Eigen::Vector3d> free_axis;
  std::vector<Goal> any_of;    ///< any_of: joint, position and pose goals, at most options_max
  double tolerance_m = 0.0;    ///< position 0.02, pose 0.01, follow 0.01
  double tolerance_rad = 0.0;  ///< joint 0.05, pose 0.26, follow 0.1
  /// Largest |v_i| at arrival; joint 0.05, else none.
  double speed_max = std::numeric_limits<double>::infinity();
  std::optional<double> tip_speed_max_m_s;  ///< position, pose: of the tip at arrival
  /// Reached at any speed: the arm may pass it on the way to the next goal.
  bool passes = false;
  bool position_only = false;              ///< follow: whether the orientation is free
  std::optional<Motion> motion;            ///< follow: of the target; none: it is streamed
  TargetStream stream;                     ///< follow without a motion
  Allowance may_touch;                     ///< while this goal is the current one
  std::optional<TipWay> way;               ///< position, pose: of the tip; none: any
  std::optional<Stretch> approach;         ///< joint, pose: the last stretch of the way
  std::optional<Stretch> retreat;          ///< the first stretch of the way
  std::vector<TipConstraint> constraints;  ///< kept on the way to it; at most constraints_max
};

/// The goals one of which is to be reached: those of any_of, else the goal itself.
[[nodiscard]] std::span<const Goal> options_of(const Goal& goal) noexcept;
/// Whether a goal may be one of several: a joint, position or pose goal without a path.
[[nodiscard]] bool is_option(const Goal& goal) noexcept;
/// Whether a position or pose goal leaves open where in a box the tip is, or how it is turned.
[[nodiscard]] bool is_region(const Goal& goal) noexcept;
/// Whether only a path leads to a goal: because of what the tip keeps on the way, or because it is
/// any of several poses.
[[nodiscard]] bool needs_path(const Goal& goal) noexcept;
/// The key of a scene file for which it does; empty: it does not.
[[nodiscard]] std::string_view path_need(const Goal& goal) noexcept;
/// Of a position or pose goal the pose that is nearest to that of a tip.
[[nodiscard]] geometry::SE3 nearest_pose(const Goal& goal, const geometry::SE3& tip);
/// @throws Error invalid, "where: what is wrong", for a way, an approach or a retreat
void check_way(const Goal& goal, const std::string& where);
/// @throws Error invalid, "where: what is wrong", for what a goal leaves open
void check_region(const Goal& goal, const std::string& where);

/// Goals with the tolerances that a scene file gets by default.
[[nodiscard]] Goal joint_goal(Eigen::VectorXd q);
/// @throws Error invalid as check(trajectory) does
[[nodiscard]] Goal trajectory_goal(JointTrajectory trajectory);
/// @throws Error as read_joint_trajectory() does
[[nodiscard]] Goal trajectory_goal(const std::filesystem::path& file);
[[nodiscard]] Goal position_goal(const Eigen::Vector3d& position_m);
[[nodiscard]] Goal pose_goal(const geometry::SE3& pose);
/// @throws Error invalid for an empty list, or one with goals of other types than joint, position
///         and pose
[[nodiscard]] Goal any_of_goal(std::vector<Goal> options);

/// A goal that follows a target that is streamed.
[[nodiscard]] Goal follow_goal(bool position_only = false, const TargetStream& stream = {});

/// The goal's "type" in a scene file: "path" is a joint goal with way-points, "trajectory" one
/// whose way-points have times.
[[nodiscard]] std::string_view type_name(const Goal& goal) noexcept;

}  // namespace hamelin::scene
