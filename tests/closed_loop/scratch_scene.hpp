#pragma once

#include <filesystem>
#include <string>

#include "hamelin/description/robot_io.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/test/arm_loop.hpp"
#include "hamelin/test/temporary.hpp"

namespace hamelin::test {

inline const std::vector<std::filesystem::path> plugin_directories{HAMELIN_TEST_PLUGIN_DIR,
                                                                   HAMELIN_TEST_ONLY_PLUGIN_DIR};

/// Writes robot and scene as files, reads them as the program does, and runs.
inline log::Result run_scene(const TemporaryFolder& folder, const Json& document,
                             const simulation::Watch& watch = {},
                             const model::Robot& robot = planar4()) {
  write_file_atomically(folder.path() / "robot.json", description::robot_to_json(robot).dump(1));
  write_file_atomically(folder.path() / "scene.json", document.dump(1));
  return simulation::run(scene::read_scene(folder.path() / "scene.json"), plugin_directories,
                         watch);
}

/// Example 5.2's arm and goal without gravity, limits and obstacles, with planner apf as published.
inline Json scene_52() {
  return {
      {"schema", "hamelin.scene/1"},
      {"robot", {{"file", "robot.json"}}},
      {"gravity_m_s2", {0.0, 0.0, 0.0}},
      {"model", {{"joint_limits", false}, {"velocity_limits", false}, {"torque_limits", false}}},
      {"goals", {{{"type", "position"}, {"position_m", {2.0, 3.0, 0.0}}, {"speed_max", 0.05}}}},
      {"obstacles", Json::array()},
      {"planner",
       {{"name", "apf"},
        {"params",
         {{"algorithm", "published"}, {"k_p", 29.5}, {"k_v", 19.9}, {"joint_damping", 2.07}}}}},
      {"step_s", 0.004},
      {"duration_s", 40.0}};
}

/// planar4 with this torque limit in each joint.
inline model::Robot strong(double effort) {
  model::Robot robot = planar4();
  for (auto& link : robot.links) link.joint.effort_max = effort;
  return robot;
}

inline Json ball(const std::string& name, double x, double y, double radius) {
  return {{"name", name}, {"type", "sphere"}, {"radius_m", radius}, {"position_m", {x, y, 0.0}}};
}

inline Eigen::VectorXd vector_of(const Json& numbers) {
  Eigen::VectorXd x(static_cast<Eigen::Index>(numbers.size()));
  for (std::size_t i = 0; i < numbers.size(); ++i)
    x[static_cast<Eigen::Index>(i)] = numbers[i].get<double>();
  return x;
}

}  // namespace hamelin::test
