#include <atomic>
#include <catch2/catch.hpp>

#include "hamelin/control/controller.hpp"
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

// The page's other examples, as functions of what they leave open. The programs of
// docs/control_your_robot.md run the same calls.
// clang-format off
namespace {

struct Robot {
  Eigen::VectorXd torque;
  void write(const Eigen::VectorXd& answer) { torque = answer; }
};

[[maybe_unused]] void tick(const scene::Scene& scene, const model::Model& arm, const planning::Plugin& plugin, const Json& params,
                           const std::atomic<bool>& running, const double& time_s, const Eigen::VectorXd& q,
                           const Eigen::VectorXd& v, Robot& robot) {
control::Controller controller(scene, arm, plugin, params, {});
while (running) {
  const control::Answer& answer = controller.tick(time_s, q, v);  // measured
  robot.write(answer.torque);  // or answer.q_next, answer.v_next
}
}

[[maybe_unused]] void change(control::Controller& controller, const geometry::SE3& above, const geometry::SE3& grasp) {
controller.set_goals({scene::pose_goal(above), scene::pose_goal(grasp)});  // any thread
controller.set_planner_params({{"cruise_speed", 0.3}});                    // any thread
controller.reset();                                                       // the thread of tick()
}

[[maybe_unused]] std::uint64_t carry(control::Controller& controller, const Eigen::VectorXd& q) {
scene::Payload cup;
cup.name = "cup";
cup.mass_kg = 0.3;
cup.position_m = {0.0, 0.0, 0.06};             // in the tip's frame
cup.capsules = {{{0.0, -0.04, 0.06}, {0.0, 0.04, 0.06}, 0.035}};
const std::uint64_t load = controller.attach(cup, q);  // any thread
controller.detach("cup", q);
  return load;
}

}  // namespace
// clang-format on
