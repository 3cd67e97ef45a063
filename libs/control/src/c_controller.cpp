#include <memory>

#include "c_interface.hpp"

using namespace hamelin;
using namespace hamelin::control;

namespace {

// One value for all joints, or one per joint; the controller checks how many there are.
void take_per_joint(const double* values, std::size_t count, const char* what,
                    std::vector<double>& out) {
  if (values == nullptr && count == 0) return;
  constexpr std::size_t count_max = 10'000;
  if (count > count_max)
    throw Error(ErrorCode::usage,
                fmt::format("{}: {} values given, expected one, or one per joint", what, count));
  out.assign(required(values, what), values + count);
}

void take_motion_bound(double value, const char* name, const double* values, std::size_t count,
                       const char* list_name, std::vector<double>& out) {
  take_choice(value, name, out.front());
  if (value > 0.0 && values != nullptr)
    throw Error(ErrorCode::usage, fmt::format("{}: is given in addition to {}, expected one of the "
                                              "two",
                                              list_name, name));
  take_per_joint(values, count, list_name, out);
}

ObservationOptions observations_of(const hamelin_controller_options& given) {
  ObservationOptions out;
  take_choice(given.observation_noise_m, "observation_noise_m", out.noise_m);
  take_choice(given.observation_jerk_m_s3, "observation_jerk_m_s3", out.jerk_m_s3);
  take_choice(given.observation_timeout_s, "observation_timeout_s", out.timeout_s);
  take_choice(given.observation_noise_rad, "observation_noise_rad", out.noise_rad);
  take_choice(given.observation_jerk_rad_s3, "observation_jerk_rad_s3", out.jerk_rad_s3);
  return out;
}

void take_motion(const hamelin_controller_options& given, Controller::Options& out) {
  out.position = given.position != 0;
  take_motion_bound(given.acceleration_max, "acceleration_max", given.joint_acceleration_max,
                    given.joint_acceleration_max_count, "joint_acceleration_max",
                    out.acceleration_max);
  take_motion_bound(given.jerk_max, "jerk_max", given.joint_jerk_max, given.joint_jerk_max_count,
                    "joint_jerk_max", out.jerk_max);
  take_per_joint(given.tracking_max, given.tracking_max_count, "tracking_max", out.tracking_max);
}

void take_clock(const hamelin_controller_options& given, Controller::Options& out) {
  if (given.late_answers_max < 0)
    throw Error(ErrorCode::usage,
                fmt::format("late_answers_max: is {}, expected 0 or more", given.late_answers_max));
  if (given.clock_s != nullptr)
    out.clock_s = given.clock_s;
  else if (given.late_answers_max > 0)
    out.clock_s = steady_clock_s;
  out.late_answers_max = given.late_answers_max;
}

Controller::Options options_of(const hamelin_controller_options& given) {
  Controller::Options out;
  out.observations = observations_of(given);
  if (given.obstacles_max > 0) out.obstacles_max = given.obstacles_max;
  take_motion(given, out);
  take_clock(given, out);
  if (given.log != nullptr)
    out.log = [log = given.log, context = given.log_context](std::int32_t level,
                                                             std::string_view line) {
      log(context, level, line.data(), line.size());
    };
  take_choice(given.payload_reach_m, "payload_reach_m", out.payload_reach_m);
  if (given.payload_shapes_max > 0) out.payload_shapes_max = given.payload_shapes_max;
  take_choice(given.period_s, "period_s", out.period_s);
  if (given.path_points_max > 0) out.path_points_max = given.path_points_max;
  out.certify = given.no_certificate == 0;
  out.fixed_world = given.fixed_world != 0;
  out.guide_thread = given.no_guide_thread == 0;
  return out;
}

std::vector<std::filesystem::path> plugin_directories_of(const hamelin_controller_options& given) {
  std::vector<std::filesystem::path> out;
  if (given.plugin_directory_count > 0)
    (void)required(given.plugin_directories, "plugin_directories");
  for (std::size_t i = 0; i < given.plugin_directory_count; ++i)
    out.emplace_back(required(given.plugin_directories[i], "plugin_directories"));
  return out;
}

std::unique_ptr<hamelin_controller> make_controller(const hamelin_controller_options& given) {
  Controller::Options options = options_of(given);
  const auto plugins = plugin_directories_of(given);
  if (given.scene_json == nullptr) {
    const std::filesystem::path file = required(given.scene_file, "scene_file");
    return std::make_unique<hamelin_controller>(scene::read_scene(file), file.parent_path(),
                                                plugins, std::move(options));
  }
  if (given.scene_file != nullptr)
    throw Error(ErrorCode::usage,
                "scene_json: is given in addition to scene_file, expected one of the two");
  const std::filesystem::path folder = given.scene_folder != nullptr ? given.scene_folder : ".";
  return std::make_unique<hamelin_controller>(
      scene::scene_from_json(json_of(given.scene_json, "scene_json"), folder, "scene_json"), folder,
      plugins, std::move(options));
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
    constexpr std::size_t first_size = offsetof(hamelin_controller_options, observation_noise_m);
    made = make_controller(complete(options, first_size, "options")).release();
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

double hamelin_controller_deadline_s(const hamelin_controller* controller) {
  return controller != nullptr ? controller->controller.deadline_s() : 0.0;
}

const char* hamelin_controller_series_name(const hamelin_controller* controller,
                                           std::size_t index) {
  if (controller == nullptr || index >= controller->controller.series().size()) return nullptr;
  return controller->controller.series()[index].name.c_str();
}

std::int32_t hamelin_controller_reset(hamelin_controller* controller, char* error,
                                      std::size_t error_size) {
  return guarded(controller, error, error_size,
                 [](hamelin_controller& of) { of.controller.reset(); });
}

std::int32_t hamelin_controller_stop(hamelin_controller* controller, const char* cause, char* error,
                                     std::size_t error_size) {
  return guarded(controller, error, error_size,
                 [&](hamelin_controller& of) { of.controller.stop(required(cause, "cause")); });
}

std::int32_t hamelin_controller_resume(hamelin_controller* controller, char* error,
                                       std::size_t error_size) {
  return guarded(controller, error, error_size,
                 [](hamelin_controller& of) { of.controller.resume(); });
}

std::int32_t hamelin_controller_run_guide(hamelin_controller* controller, char* error,
                                          std::size_t error_size) {
  return guarded(controller, error, error_size,
                 [](hamelin_controller& of) { of.controller.run_guide(); });
}

std::int32_t hamelin_controller_set_planner_params(hamelin_controller* controller,
                                                   const char* params_json, char* error,
                                                   std::size_t error_size) {
  return guarded(controller, error, error_size, [&](hamelin_controller& of) {
    of.controller.set_planner_params(json_of(params_json, "params_json"));
  });
}

std::int32_t hamelin_controller_planner_params(hamelin_controller* controller, char* json,
                                               std::size_t json_size, std::size_t* needed,
                                               char* error, std::size_t error_size) {
  return guarded(controller, error, error_size, [&](hamelin_controller& of) {
    write_json(of.controller.planner_params(), json, json_size, needed);
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

std::int32_t hamelin_controller_attached(hamelin_controller* controller, char* json,
                                         std::size_t json_size, std::size_t* needed, char* error,
                                         std::size_t error_size) {
  return guarded(controller, error, error_size, [&](hamelin_controller& of) {
    write_json(of.controller.attached(), json, json_size, needed);
  });
}

}  // extern "C"
