#include <catch2/catch.hpp>

#include "hamelin/control/world_view.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/test/arm_loop.hpp"
#include "hamelin/test/readme.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;

TEST_CASE("the README's example proves a motion beside a ball", "[control][unit]") {
  const test::TemporaryFolder temporary;
  const std::filesystem::path& folder = temporary.path();
  const model::Robot robot = test::planar4();
  write_file_atomically(folder / "control_readme_robot.json",
                        description::robot_to_json(robot).dump());
  const Json document{{"schema", "hamelin.scene/1"},
                      {"robot", {{"file", "control_readme_robot.json"}}},
                      {"goals", {{{"type", "position"}, {"position_m", {2.0, 3.0, 0.0}}}}},
                      {"obstacles",
                       {{{"name", "ball"},
                         {"type", "sphere"},
                         {"radius_m", 0.1},
                         {"position_m", {1.5, 0.4, 0.0}}}}},
                      {"planner", {{"name", "apf"}}}};
  const Eigen::VectorXd from = Eigen::VectorXd::Zero(4), to = Eigen::VectorXd::Constant(4, 0.02);
  // clang-format off
  // [example]
// An arm of four links of one metre in a plane, beside a ball.
const scene::Scene scene = scene::scene_from_json(document, folder, "scene.json");
const model::Model arm(robot);
control::WorldView world(scene, arm, 0.5);  // obstacles matter up to 0.5 m
const Eigen::VectorXd v = Eigen::VectorXd::Zero(4);
world.look(from, 0.0);
world.depart(from, v);
world.look(to, 0.01);
const auto verdict = world.certify(to, v);
  // [example]
  // clang-format on
  CHECK(world.clearance_m() < 0.3);
  CHECK(verdict.certified);
  CHECK(verdict.margin_m > 0.0);
  CHECK(verdict.margin_m < world.clearance_m());
  test::check_readme_example("libs/control");
}
