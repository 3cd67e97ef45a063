#include <limits>

#include "c/c_interface.hpp"
#include "hamelin/scene/parts.hpp"

using namespace hamelin;
using namespace hamelin::control;

namespace {

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

PointFrame frame_of(const hamelin_point_frame* given) {
  const hamelin_point_frame full = complete(given, offsetof(hamelin_point_frame, frame), "frame");
  if (full.points > static_cast<std::size_t>(PointFrame::points_max))
    throw Error(ErrorCode::invalid, fmt::format("points: {} given, expected 1 to {}", full.points,
                                                PointFrame::points_max));
  if (full.mount < HAMELIN_MOUNT_WORLD || full.mount > HAMELIN_MOUNT_FRAME)
    throw Error(ErrorCode::invalid,
                "points: the sensor's mount is unknown, expected the world, the base, the tip or a "
                "frame");
  PointFrame out;
  out.points = Eigen::Map<const Eigen::Matrix3Xf>(required(full.points_m, "frame: points_m"), 3,
                                                  static_cast<Eigen::Index>(full.points));
  out.sensor = pose_of(full.position_m, full.quaternion_wxyz);
  out.mount = static_cast<scene::Mount>(full.mount);
  if (out.mount == scene::Mount::frame) out.frame = required(full.frame, "frame: frame");
  out.source = full.source;
  out.time_s = full.time_s;
  if (full.range_m != 0.0) out.range_m = full.range_m;
  return out;
}

}  // namespace

extern "C" {

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

std::int32_t hamelin_controller_set_map_json(hamelin_controller* controller, const char* map_json,
                                             const char* folder, const double* q,
                                             std::uint64_t* snapshot, char* error,
                                             std::size_t error_size) {
  return update(controller, snapshot, error, error_size, [&](hamelin_controller& of) {
    Eigen::VectorXd at;
    if (q != nullptr) at = joints(of, q, "q");
    std::optional<scene::MapSpec> map;
    if (map_json != nullptr)
      map = scene::map_from_json(json_of(map_json, "map_json"), folder_of(of, folder), "map");
    return of.controller.world().set_map(map, at);
  });
}

std::int32_t hamelin_controller_insert_points(hamelin_controller* controller,
                                              const hamelin_point_frame* given,
                                              hamelin_frame_report* report, char* error,
                                              std::size_t error_size) {
  return guarded(controller, error, error_size, [&](hamelin_controller& of) {
    if (report != nullptr && report->struct_size < sizeof(hamelin_frame_report))
      refuse_size("report");
    const FrameReport made = of.controller.world().insert_points(frame_of(given));
    if (report == nullptr) return;
    write_struct({0, made.snapshot, made.points, made.on_arm, made.on_obstacles, made.movers,
                  made.occupied, made.cleared},
                 report);
  });
}

std::int32_t hamelin_controller_change_map(hamelin_controller* controller, const char* change_json,
                                           const char* folder, std::uint64_t* snapshot, char* error,
                                           std::size_t error_size) {
  return update(controller, snapshot, error, error_size, [&](hamelin_controller& of) {
    return of.controller.world().change_map(scene::map_change_from_json(
        json_of(change_json, "change_json"), folder_of(of, folder), "change"));
  });
}

}  // extern "C"
