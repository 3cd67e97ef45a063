#include "free_motion.hpp"

#include <fmt/format.h>

#include "command_line.hpp"
#include "document.hpp"
#include "hamelin/core/error.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

void note_ignored_parts(const scene::Scene& scene) {
  std::vector<std::string> ignored;
  if (scene.planner) ignored.push_back(fmt::format("planner '{}'", scene.planner->name));
  if (scene.map) ignored.push_back("the map");
  if (!scene.obstacles.empty())
    ignored.push_back(fmt::format("{} obstacle(s)", scene.obstacles.size()));
  if (!scene.goals.empty()) ignored.push_back(fmt::format("{} goal(s)", scene.goals.size()));
  if (!ignored.empty())
    note(fmt::format("{}: free motion ignores {}", scene.name, fmt::join(ignored, ", ")));
}

void set_joints(const char* option, const std::optional<std::string>& given, int dof,
                Eigen::VectorXd& joints) {
  if (!given) return;
  const auto numbers = number_list(option, *given, static_cast<std::size_t>(dof));
  joints = Eigen::Map<const Eigen::VectorXd>(numbers.data(), dof);
}

}  // namespace

void add_motion_flags(CLI::App& command, MotionFlags& flags) {
  command.add_option("file", flags.file, "scene file, or robot file (.urdf or JSON)")
      ->required()
      ->type_name("SCENE_OR_ROBOT");
  command.add_option("--tip", flags.tip, "tip link (default for a URDF: its only leaf)")
      ->type_name("LINK");
  command
      .add_option("--q0", flags.q0,
                  "joint positions at the start [rad or m] (default the scene's, or 0)")
      ->type_name("a,b,..");
  command
      .add_option("--v0", flags.v0,
                  "joint velocities at the start [rad/s or m/s] (default the scene's, or 0)")
      ->type_name("a,b,..");
}

scene::Scene read_motion(const MotionFlags& flags) {
  const Kind kind = kind_of(flags.file);
  scene::Scene scene;
  if (kind == Kind::scene) {
    scene = scene::read_scene(flags.file);
    note_ignored_parts(scene);
  } else if (kind == Kind::urdf || kind == Kind::robot) {
    scene.name = flags.file.string();
    scene.robot.file = flags.file;
  } else {
    throw Error(ErrorCode::invalid, fmt::format("{}: is a {}, expected a robot or a scene",
                                                flags.file.string(), to_string(kind)));
  }
  if (flags.tip) scene.robot.tip = flags.tip;
  return scene;
}

void set_start(const MotionFlags& flags, int dof, scene::Scene& scene) {
  set_joints("--q0", flags.q0, dof, scene.start_q);
  set_joints("--v0", flags.v0, dof, scene.start_v);
}

}  // namespace hamelin::app
