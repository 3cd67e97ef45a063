#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstring>
#include <exception>
#include <limits>
#include <string>

#include "hamelin/control/controller.hpp"
#include "hamelin/control/hamelin_control.h"
#include "hamelin/core/error.hpp"

struct hamelin_controller {
  explicit hamelin_controller(const std::filesystem::path& scene,
                              const std::vector<std::filesystem::path>& plugins,
                              hamelin::control::Controller::Options options)
      : controller(scene, plugins, std::move(options)),
        q(Eigen::VectorXd::Zero(controller.answer().torque.size())),
        v(q) {}

  hamelin::control::Controller controller;
  Eigen::VectorXd q, v;
  std::array<char, 256> cause{}, load_refusal{};  ///< of the last answer, nul-terminated
};

namespace {

using namespace hamelin;

void write_line(std::string_view line, char* out, std::size_t size) noexcept {
  if (out == nullptr || size == 0) return;
  out[line.copy(out, size - 1)] = '\0';
}

// Runs f; what it throws becomes a line. @return 0, or 1 if it threw
template <class F>
std::int32_t guarded(char* error, std::size_t error_size, F&& f) noexcept {
  try {
    f();
    return 0;
  } catch (const std::exception& e) {
    write_line(e.what(), error, error_size);
  } catch (...) {
    write_line("an exception that is not a std::exception", error, error_size);
  }
  return 1;
}

template <class T>
T* required(T* pointer, const char* what) {
  if (pointer == nullptr)
    throw Error(ErrorCode::usage, std::string(what) + ": is null, expected its value");
  return pointer;
}

// f of a controller that must be given.
template <class F>
std::int32_t guarded(hamelin_controller* of, char* error, std::size_t error_size, F&& f) noexcept {
  return guarded(error, error_size, [&] { f(*required(of, "controller")); });
}

// The same for a change that has a number.
template <class F>
std::int32_t update(hamelin_controller* of, std::uint64_t* number, char* error,
                    std::size_t error_size, F&& f) noexcept {
  return guarded(of, error, error_size, [&](hamelin_controller& controller) {
    const std::uint64_t made = f(controller);
    if (number != nullptr) *number = made;
  });
}

// dof numbers of the caller.
Eigen::Map<const Eigen::VectorXd> joints(const hamelin_controller& of, const double* numbers,
                                         const char* what) {
  return {required(numbers, what), of.q.size()};
}

// What the caller chooses instead of a default, which 0 selects; others check the number.
template <class T>
void take_choice(double given, T& out) {
  if (given != 0.0) out = given;
}

// A struct of a caller that may be built against an earlier header, whose struct was shorter, with
// zeros for what it lacks. `size` is that of the first header.
template <class T>
T complete(const T* given, std::size_t size, const char* what) {
  if (given == nullptr || given->struct_size < size)
    throw Error(ErrorCode::usage, fmt::format("{}: is null or its struct_size is too small", what));
  T full{};
  std::memcpy(&full, given, std::min<std::size_t>(given->struct_size, sizeof full));
  return full;
}

std::optional<Eigen::Vector3d> optional_vector(const double* numbers) {
  if (numbers == nullptr) return std::nullopt;
  return Eigen::Map<const Eigen::Vector3d>(numbers);
}

control::ObservationOptions observations_of(const hamelin_controller_options& given) {
  control::ObservationOptions out;
  take_choice(given.observation_noise_m, out.noise_m);
  take_choice(given.observation_jerk_m_s3, out.jerk_m_s3);
  take_choice(given.observation_timeout_s, out.timeout_s);
  return out;
}

geometry::SE3 pose_of(const double* position, const double* wxyz) {
  return {geometry::rotation_from_wxyz(Eigen::Map<const Eigen::Vector4d>(wxyz)),
          Eigen::Map<const Eigen::Vector3d>(position)};
}

control::Observation observation_of(const hamelin_observation* given, const char* what) {
  const hamelin_observation full = complete(given, sizeof(hamelin_observation), what);
  return {full.time_s, pose_of(full.position_m, full.quaternion_wxyz),
          optional_vector(full.velocity_m_s), optional_vector(full.acceleration_m_s2),
          optional_vector(full.angular_velocity_rad_s)};
}

scene::Goal follow_goal_of_stream(const hamelin_target_stream* given) {
  if (given == nullptr) return scene::follow_goal();
  const hamelin_target_stream full = complete(given, sizeof(hamelin_target_stream), "stream");
  scene::TargetStream stream;
  for (auto [value, out] :
       {std::pair(full.gap_max_s, &stream.gap_max_s),
        std::pair(full.jump_max_m, &stream.jump_max_m),
        std::pair(full.jump_max_rad, &stream.jump_max_rad),
        std::pair(full.noise_m, &stream.noise_m), std::pair(full.noise_rad, &stream.noise_rad),
        std::pair(full.leash_m, &stream.leash_m), std::pair(full.leash_rad, &stream.leash_rad)})
    take_choice(value, *out);
  return scene::follow_goal(full.position_only != 0, stream);
}

void write_target(const control::Controller& controller, hamelin_answer& out) {
  const control::TargetState* const target = controller.answer().target;
  if (target == nullptr) return;
  out.target = target->waiting ? HAMELIN_TARGET_WAITING
               : target->lost  ? HAMELIN_TARGET_LOST
                               : HAMELIN_TARGET_FOLLOWED;
  std::copy_n(target->pose.p().data(), 3, out.target_position_m);
  out.target_error_m = (controller.tip().p() - target->pose.p()).norm();
}

hamelin_answer answer_of(hamelin_controller& of, const control::Answer& answer) {
  const auto& verdict = of.controller.verdict();
  hamelin_answer full{};
  full.state = static_cast<std::int32_t>(answer.state);
  write_line(answer.cause, of.cause.data(), of.cause.size());
  full.cause = of.cause.data();
  full.torque = answer.torque.data();
  full.q_next = answer.q_next.data();
  full.v_next = answer.v_next.data();
  full.goal_index = answer.goal_index;
  full.snapshot = answer.snapshot;
  full.clearance_m = of.controller.view().clearance_m();
  full.certified = !verdict || verdict->certified ? 1 : 0;
  full.margin_m = verdict ? verdict->margin_m : full.clearance_m;
  full.saturated = answer.saturated ? 1 : 0;
  full.goals = answer.goals_number;
  full.planner_s = answer.planner_s;
  full.overruns = answer.overruns;
  full.load = answer.load;
  full.refused_load = answer.refused_load;
  write_line(answer.load_refusal, of.load_refusal.data(), of.load_refusal.size());
  full.load_refusal = of.load_refusal.data();
  write_target(of.controller, full);
  return full;
}

scene::Obstacle obstacle_of(const hamelin_obstacle& given) {
  scene::Obstacle out;
  out.name = required(given.name, "obstacle: name");
  const auto choose = [&](const auto& values, std::int32_t index, const char* what) {
    if (index < 0 || static_cast<std::size_t>(index) >= values.size())
      throw Error(ErrorCode::invalid, fmt::format("obstacle '{}': its {}", out.name, what));
    return values[static_cast<std::size_t>(index)];
  };
  constexpr std::array shapes{scene::Shape::sphere, scene::Shape::box, scene::Shape::cylinder,
                              scene::Shape::capsule};
  constexpr std::array predictions{scene::Prediction::constant_acceleration,
                                   scene::Prediction::constant_velocity,
                                   scene::Prediction::speed_bound};
  out.shape =
      choose(shapes, given.shape, "shape is unknown, expected a sphere, box, cylinder or capsule");
  out.radius_m = given.radius_m;
  out.length_m = given.length_m;
  out.size_m = Eigen::Map<const Eigen::Vector3d>(given.size_m);
  out.pose = pose_of(given.position_m, given.quaternion_wxyz);
  out.prediction = choose(predictions, given.prediction,
                          "prediction is unknown, expected a constant acceleration, a constant "
                          "velocity or a speed bound");
  out.speed_max_m_s = given.speed_max_m_s;
  return out;
}

scene::Payload payload_of(const hamelin_payload& given) {
  scene::Payload out;
  out.name = required(given.name, "payload: name");
  out.mass_kg = given.mass_kg;
  out.position_m = Eigen::Map<const Eigen::Vector3d>(given.position_m);
  const double* i = given.inertia_kg_m2;
  out.inertia_kg_m2 << i[0], i[3], i[4], i[3], i[1], i[5], i[4], i[5], i[2];
  if (given.shape_count > 0) (void)required(given.shapes, "payload: shapes");
  for (std::size_t k = 0; k < given.shape_count; ++k) {
    const hamelin_payload_capsule& shape = given.shapes[k];
    const Eigen::Vector3d from(shape.from_m), to(shape.to_m);
    if (from == to)
      out.spheres.push_back({from, shape.radius_m});
    else
      out.capsules.push_back({from, to, shape.radius_m});
  }
  return out;
}

}  // namespace

extern "C" {

hamelin_controller* hamelin_controller_create(const hamelin_controller_options* options,
                                              char* error, std::size_t error_size) {
  hamelin_controller* made = nullptr;
  (void)guarded(error, error_size, [&] {
    const hamelin_controller_options given =
        complete(options, offsetof(hamelin_controller_options, observation_noise_m), "options");
    control::Controller::Options chosen;
    chosen.observations = observations_of(given);
    if (given.obstacles_max > 0) chosen.obstacles_max = given.obstacles_max;
    chosen.position = given.position != 0;
    if (given.late_answers_max < 0)
      throw Error(ErrorCode::usage, fmt::format("late_answers_max: is {}, expected 0 or more",
                                                given.late_answers_max));
    if (given.late_answers_max > 0) chosen.clock_s = control::steady_clock_s;
    chosen.late_answers_max = given.late_answers_max;
    take_choice(given.acceleration_max, chosen.acceleration_max.front());
    take_choice(given.jerk_max, chosen.jerk_max.front());
    if (given.log != nullptr)
      chosen.log = [log = given.log, context = given.log_context](std::int32_t level,
                                                                  std::string_view line) {
        log(context, level, line.data(), line.size());
      };
    std::vector<std::filesystem::path> plugins;
    if (given.plugin_directory_count > 0)
      (void)required(given.plugin_directories, "plugin_directories");
    for (std::size_t i = 0; i < given.plugin_directory_count; ++i)
      plugins.emplace_back(required(given.plugin_directories[i], "plugin_directories"));
    take_choice(given.payload_reach_m, chosen.payload_reach_m);
    if (given.payload_shapes_max > 0) chosen.payload_shapes_max = given.payload_shapes_max;
    made = std::make_unique<hamelin_controller>(required(given.scene_file, "scene_file"), plugins,
                                                std::move(chosen))
               .release();
  });
  return made;
}

void hamelin_controller_destroy(hamelin_controller* controller) {
  delete controller;
}

std::size_t hamelin_controller_dof(const hamelin_controller* controller) {
  return controller != nullptr ? static_cast<std::size_t>(controller->q.size()) : 0;
}

double hamelin_controller_period_s(const hamelin_controller* controller) {
  return controller != nullptr ? controller->controller.period_s() : 0.0;
}

std::int32_t hamelin_controller_tick(hamelin_controller* controller, double time_s, const double* q,
                                     const double* v, hamelin_answer* out) {
  constexpr std::size_t first_size = offsetof(hamelin_answer, goals);
  if (out == nullptr || out->struct_size < first_size) return 1;
  std::array<char, 256> line{};
  hamelin_answer full{};
  const std::int32_t failed =
      guarded(controller, line.data(), line.size(), [&](hamelin_controller& of) {
        of.q = joints(of, q, "q");
        of.v = joints(of, v, "v");
        full = answer_of(of, of.controller.tick(time_s, of.q, of.v));
      });
  if (failed != 0) {
    full = {};
    full.state = HAMELIN_CONTROL_STOPPING;
    full.cause = full.load_refusal = "";
    if (controller != nullptr) {
      controller->cause = line;
      full.cause = controller->cause.data();
    }
  }
  // A caller that was built against an earlier header has a shorter struct.
  full.struct_size = out->struct_size;
  std::memcpy(out, &full, std::min<std::size_t>(out->struct_size, sizeof full));
  return failed;
}

std::int32_t hamelin_controller_reset(hamelin_controller* controller, char* error,
                                      std::size_t error_size) {
  return guarded(controller, error, error_size,
                 [](hamelin_controller& of) { of.controller.reset(); });
}

std::int32_t hamelin_controller_set_joint_goal(hamelin_controller* controller, const double* q,
                                               double tolerance_rad, std::uint64_t* number,
                                               char* error, std::size_t error_size) {
  return update(controller, number, error, error_size, [&](hamelin_controller& of) {
    scene::Goal goal = scene::joint_goal(joints(of, q, "goal: q"));
    take_choice(tolerance_rad, goal.tolerance_rad);
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
    take_choice(tolerance_m, goal.tolerance_m);
    take_choice(tolerance_rad, goal.tolerance_rad);
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
    take_choice(tolerance_rad, goal.tolerance_rad);
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

std::int32_t hamelin_controller_set_planner_params(hamelin_controller* controller,
                                                   const char* params_json, char* error,
                                                   std::size_t error_size) {
  return guarded(controller, error, error_size, [&](hamelin_controller& of) {
    const std::string place = "params_json";
    of.controller.set_planner_params(parse_json(required(params_json, "params_json"), place));
  });
}

std::int32_t hamelin_controller_attach(hamelin_controller* controller,
                                       const hamelin_payload* payload, const double* q,
                                       std::uint64_t* load, char* error, std::size_t error_size) {
  return update(controller, load, error, error_size, [&](hamelin_controller& of) {
    const hamelin_payload given = complete(payload, sizeof(hamelin_payload), "payload");
    return of.controller.attach(payload_of(given), joints(of, q, "q"));
  });
}

std::int32_t hamelin_controller_detach(hamelin_controller* controller, const char* name,
                                       const double* q, std::uint64_t* load, char* error,
                                       std::size_t error_size) {
  return update(controller, load, error, error_size, [&](hamelin_controller& of) {
    return of.controller.detach(required(name, "payload: name"), joints(of, q, "q"));
  });
}

std::int32_t hamelin_controller_set_obstacle(hamelin_controller* controller,
                                             const hamelin_obstacle* given, std::uint64_t* snapshot,
                                             char* error, std::size_t error_size) {
  return update(controller, snapshot, error, error_size, [&](hamelin_controller& of) {
    return of.controller.world().set_obstacle(
        obstacle_of(complete(given, offsetof(hamelin_obstacle, prediction), "obstacle")));
  });
}

std::int32_t hamelin_controller_move_obstacle(hamelin_controller* controller, const char* name,
                                              const double position_m[3],
                                              const double quaternion_wxyz[4],
                                              const double velocity_m_s[3], double time_s,
                                              std::uint64_t* snapshot, char* error,
                                              std::size_t error_size) {
  return update(controller, snapshot, error, error_size, [&](hamelin_controller& of) {
    return of.controller.world().move_obstacle(
        required(name, "obstacle: name"),
        pose_of(required(position_m, "obstacle: position_m"),
                required(quaternion_wxyz, "obstacle: quaternion_wxyz")),
        Eigen::Map<const Eigen::Vector3d>(required(velocity_m_s, "obstacle: velocity_m_s")),
        time_s);
  });
}

std::int32_t hamelin_controller_observe_obstacle(hamelin_controller* controller, const char* name,
                                                 const hamelin_observation* observation,
                                                 std::uint64_t* snapshot, char* error,
                                                 std::size_t error_size) {
  return update(controller, snapshot, error, error_size, [&](hamelin_controller& of) {
    return of.controller.world().observe_obstacle(required(name, "obstacle: name"),
                                                  observation_of(observation, "observation"));
  });
}

std::int32_t hamelin_controller_last_observed(hamelin_controller* controller, const char* name,
                                              double* time_s, char* error, std::size_t error_size) {
  return guarded(controller, error, error_size, [&](hamelin_controller& of) {
    const auto last = of.controller.world().last_observed(required(name, "obstacle: name"));
    if (time_s != nullptr) *time_s = last.value_or(-std::numeric_limits<double>::infinity());
  });
}

std::int32_t hamelin_controller_remove_obstacle(hamelin_controller* controller, const char* name,
                                                std::uint64_t* snapshot, char* error,
                                                std::size_t error_size) {
  return update(controller, snapshot, error, error_size, [&](hamelin_controller& of) {
    return of.controller.world().remove_obstacle(required(name, "obstacle: name"));
  });
}

std::int32_t hamelin_controller_set_map(hamelin_controller* controller, const char* file,
                                        std::uint64_t* snapshot, char* error,
                                        std::size_t error_size) {
  return update(controller, snapshot, error, error_size, [&](hamelin_controller& of) {
    std::optional<scene::MapSpec> map;
    if (file != nullptr) {
      map.emplace();
      map->file = file;
    }
    return of.controller.world().set_map(map);
  });
}

}  // extern "C"
