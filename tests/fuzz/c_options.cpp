#include <string>

#include "c_choices.hpp"
#include "targets.hpp"

namespace hamelin::fuzz {

namespace {

const std::string& scene_text() {
  static const std::string text(
      R"({"schema": "hamelin.scene/1", "robot": {"file": ")" HAMELIN_SOURCE_DIR
      R"(/data/robots/arm7.urdf", "tip": "flange", "spheres": ")" HAMELIN_SOURCE_DIR
      R"(/data/robots/arm7.spheres.json"}, "gravity_m_s2": [0, 0, -9.81],
      "start": {"q": [0, -0.785, 0, -2.356, 0, 1.571, 0.785]},
      "goals": [{"type": "joint", "q": [0.5, -0.7, 0.4, -1.2, 0.1, 2.2, 0.6]}],
      "model": {"joint_limits": true, "velocity_limits": true, "torque_limits": true,
      "self_collision": true}, "planner": {"name": "template"}})");
  return text;
}

const std::string& scene_file() {
  static const MemoryFile file(scene_text());
  return file.path();
}

/// Options of which any may be wrong. The arrays stay valid until the next call.
void change_later_options(Choices& choose, hamelin_controller_options& options) {
  static Joints acceleration{}, jerk{}, tracking{};
  static std::string text;
  const auto list = [&](Joints& numbers, const double*& values, std::size_t& count) {
    if (!choose.rarely()) return;
    for (double& x : numbers) x = choose.rarely() ? choose.number() : 1.0;
    values = choose.or_null(numbers.data());
    count = choose.rarely() ? choose.byte() % (dof + 1) : dof;
  };
  list(acceleration, options.joint_acceleration_max, options.joint_acceleration_max_count);
  list(jerk, options.joint_jerk_max, options.joint_jerk_max_count);
  list(tracking, options.tracking_max, options.tracking_max_count);
  if (choose.rarely()) options.period_s = choose.number();
  options.path_points_max = choose.byte();
  options.no_certificate = choose.byte() % 2;
  options.fixed_world = choose.byte() % 2;
  options.no_guide_thread = choose.byte() % 2;
  if (choose.rarely()) options.observation_noise_rad = choose.number();
  if (choose.rarely()) options.observation_jerk_rad_s3 = choose.number();
  if (!choose.rarely()) return;
  text = scene_text();
  text.resize(choose.rarely() ? text.size() / 2 : text.size());
  if (!choose.rarely()) options.scene_file = nullptr;
  options.scene_json = choose.or_null(text.c_str());
  options.scene_folder = choose.or_null("/no/such/folder");
}

}  // namespace

OwnedController make_controller(Choices& choose, bool usual) {
  const char* const plugins = HAMELIN_TEST_PLUGIN_DIR;
  hamelin_controller_options options{};
  options.struct_size = sizeof options;
  options.scene_file = scene_file().c_str();
  options.plugin_directories = &plugins;
  options.plugin_directory_count = 1;
  options.position = choose.byte() % 2;
  options.payload_reach_m = 0.3;
  options.payload_shapes_max = 4;
  if (!usual) {
    options.struct_size = choose.size_or_other(sizeof options);
    options.scene_file = choose.or_null(options.scene_file);
    options.plugin_directories = choose.or_null(options.plugin_directories);
    options.acceleration_max = choose.number();
    options.jerk_max = choose.number();
    options.late_answers_max = static_cast<std::int32_t>(choose.byte()) - 8;
    options.observation_noise_m = choose.number();
    options.observation_jerk_m_s3 = choose.number();
    options.observation_timeout_s = choose.number();
    options.payload_reach_m = choose.number();
    options.obstacles_max = choose.byte();
    change_later_options(choose, options);
  }
  std::array<char, 200> error{};
  OwnedController made(hamelin_controller_create(&options, error.data(), error.size()));
  require((made == nullptr) == (error.front() != '\0'), "null is returned with a line, only then");
  require(!usual || made != nullptr, std::string("a controller can be made: ") + error.data());
  return made;
}

}  // namespace hamelin::fuzz
