#include <tuple>

#include "c_interface.hpp"
#include "hamelin/scene/parts.hpp"

using namespace hamelin;
using namespace hamelin::control;

namespace {

scene::Goal follow_goal_of_stream(const hamelin_target_stream* given) {
  if (given == nullptr) return scene::follow_goal();
  const hamelin_target_stream full = complete(given, sizeof(hamelin_target_stream), "stream");
  scene::TargetStream stream;
  for (const auto& [value, what, out] :
       {std::tuple(full.gap_max_s, "stream: gap_max_s", &stream.gap_max_s),
        std::tuple(full.jump_max_m, "stream: jump_max_m", &stream.jump_max_m),
        std::tuple(full.jump_max_rad, "stream: jump_max_rad", &stream.jump_max_rad),
        std::tuple(full.noise_m, "stream: noise_m", &stream.noise_m),
        std::tuple(full.noise_rad, "stream: noise_rad", &stream.noise_rad),
        std::tuple(full.leash_m, "stream: leash_m", &stream.leash_m),
        std::tuple(full.leash_rad, "stream: leash_rad", &stream.leash_rad)})
    take_choice(value, what, *out);
  return scene::follow_goal(full.position_only != 0, stream);
}

}  // namespace

extern "C" {

std::int32_t hamelin_controller_set_goals(hamelin_controller* controller, const char* goals_json,
                                          const char* folder, std::uint64_t* number, char* error,
                                          std::size_t error_size) {
  return update(controller, number, error, error_size, [&](hamelin_controller& of) {
    return of.controller.set_goals(
        scene::goals_from_json(json_of(goals_json, "goals_json"), folder_of(of, folder), "goals"));
  });
}

std::int32_t hamelin_controller_set_joint_goal(hamelin_controller* controller, const double* q,
                                               double tolerance_rad, std::uint64_t* number,
                                               char* error, std::size_t error_size) {
  return update(controller, number, error, error_size, [&](hamelin_controller& of) {
    scene::Goal goal = scene::joint_goal(joints(of, q, "goal: q"));
    take_choice(tolerance_rad, "goal: tolerance_rad", goal.tolerance_rad);
    return of.controller.set_goal(std::move(goal));
  });
}

std::int32_t hamelin_controller_set_pose_goal(hamelin_controller* controller,
                                              const double position_m[3],
                                              const double quaternion_wxyz[4], double tolerance_m,
                                              double tolerance_rad, std::uint64_t* number,
                                              char* error, std::size_t error_size) {
  return update(controller, number, error, error_size, [&](hamelin_controller& of) {
    (void)required(position_m, "goal: position_m");
    scene::Goal goal = quaternion_wxyz == nullptr
                           ? scene::position_goal(Eigen::Map<const Eigen::Vector3d>(position_m))
                           : scene::pose_goal(pose_of(position_m, quaternion_wxyz));
    take_choice(tolerance_m, "goal: tolerance_m", goal.tolerance_m);
    take_choice(tolerance_rad, "goal: tolerance_rad", goal.tolerance_rad);
    return of.controller.set_goal(std::move(goal));
  });
}

std::int32_t hamelin_controller_set_trajectory(hamelin_controller* controller, const double* time_s,
                                               const double* q, const double* v, const double* a,
                                               std::size_t points, double tolerance_rad,
                                               std::uint64_t* number, char* error,
                                               std::size_t error_size) {
  return update(controller, number, error, error_size, [&](hamelin_controller& of) {
    constexpr std::size_t points_max = 10'000'000;
    if (points > points_max)
      throw Error(ErrorCode::usage,
                  fmt::format("points: {}, expected at most {}", points, points_max));
    const Eigen::Index dof = of.q.size(), count = static_cast<Eigen::Index>(points);
    const auto columns = [&](const double* from, const char* name) -> Eigen::MatrixXd {
      return Eigen::Map<const Eigen::MatrixXd>(required(from, name), dof, count);
    };
    scene::JointTrajectory trajectory;
    trajectory.time_s = Eigen::Map<const Eigen::VectorXd>(required(time_s, "time_s"), count);
    trajectory.q = columns(q, "q");
    trajectory.v = columns(v, "v");
    if (a != nullptr) trajectory.a = columns(a, "a");
    scene::Goal goal = scene::trajectory_goal(std::move(trajectory));
    take_choice(tolerance_rad, "goal: tolerance_rad", goal.tolerance_rad);
    return of.controller.set_goal(std::move(goal));
  });
}

std::int32_t hamelin_controller_follow(hamelin_controller* controller,
                                       const hamelin_target_stream* stream, std::uint64_t* number,
                                       char* error, std::size_t error_size) {
  return update(controller, number, error, error_size, [&](hamelin_controller& of) {
    return of.controller.set_goal(follow_goal_of_stream(stream));
  });
}

std::int32_t hamelin_controller_set_target(hamelin_controller* controller,
                                           const hamelin_observation* pose, char* error,
                                           std::size_t error_size) {
  return guarded(controller, error, error_size, [&](hamelin_controller& of) {
    of.controller.set_target(observation_of(pose, "target"));
  });
}

std::int32_t hamelin_controller_set_target_twist(hamelin_controller* controller, double time_s,
                                                 const double velocity_m_s[3],
                                                 const double angular_velocity_rad_s[3],
                                                 char* error, std::size_t error_size) {
  return guarded(controller, error, error_size, [&](hamelin_controller& of) {
    control::TargetTwist twist{time_s};
    twist.velocity_m_s =
        Eigen::Map<const Eigen::Vector3d>(required(velocity_m_s, "target: velocity_m_s"));
    twist.angular_velocity_rad_s = Eigen::Map<const Eigen::Vector3d>(
        required(angular_velocity_rad_s, "target: angular_velocity_rad_s"));
    of.controller.set_target(twist);
  });
}

}  // extern "C"
