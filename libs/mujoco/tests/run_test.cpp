#include <catch2/catch.hpp>

#include "fixture.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/simulation/replay.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;
using Eigen::VectorXd;

namespace {

const std::vector<std::filesystem::path> plugins{HAMELIN_TEST_PLUGIN_DIR};

scene::Scene clutter() {
  scene::Scene scene = scene::read_scene(test::data / "scenes" / "clutter.json");
  scene.plant = scene::PlantType::mujoco;
  scene.actuation.type = scene::ActuationType::sampled;
  scene.actuation.delay_s = 0.001;
  scene.actuation.coulomb_friction_share = 0.02;
  return scene;
}

log::Result run(const scene::Scene& scene, const simulation::Watch& watch = {}) {
  return simulation::run(scene, plugins, watch, mujoco::make_plant);
}

// A ball where the tip of the arm is after 1 s.
scene::Obstacle ball_on_the_way(const scene::Scene& scene) {
  VectorXd q;
  simulation::Watch watch;
  watch.at_node = [&](double time_s, const VectorXd& at) {
    if (time_s <= 1.0) q = at;
  };
  REQUIRE(run(scene, watch).outcome == log::Outcome::reached);
  const model::Model model = control::load_model(scene);
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, q);
  scene::Obstacle ball;
  ball.name = "hidden ball";
  ball.radius_m = 0.03;
  ball.pose = {Eigen::Matrix3d::Identity(), dynamics::tip_pose(model, ws).p()};
  ball.judge_only = true;
  return ball;
}

}  // namespace

TEST_CASE("the clutter's goals are reached by torques and by servos, and no contact is counted",
          "[mujoco]") {
  scene::Scene scene = clutter();
  scene.model.armature = {false, {0.1}};
  scene.model.joint_damping = {false, {0.1}};
  scene.actuation.planner_mass_scale = GENERATE(0.95, 1.05);
  if (GENERATE(false, true)) {
    scene.actuation.type = scene::ActuationType::position;
    scene.actuation.servo = {{2000.0}, {80.0}};
  }
  const log::Result result = run(scene);
  CAPTURE(result.cause);
  CHECK(result.outcome == log::Outcome::reached);
  REQUIRE(result.plant);
  CHECK(result.plant->type == "mujoco");
  CHECK(result.plant->contacts == 0);
  CHECK(result.plant->judge_contacts == 0);
  CHECK_FALSE(result.plant->deepest_m);
  CHECK(*result.min_clearance_m > 0.0);
  CHECK(result.dissipated_J > 1.0);
}

TEST_CASE("a ball that the planner is not told of is touched, by MuJoCo's count and by the judge's",
          "[mujoco]") {
  scene::Scene scene = clutter();
  scene.obstacles.push_back(ball_on_the_way(scene));
  const log::Result result = run(scene);
  CHECK(result.outcome == log::Outcome::collision);
  CHECK(result.time_s < 1.0);
  REQUIRE(result.plant);
  CHECK(result.plant->contacts == 1);
  CHECK(result.plant->judge_contacts == 1);
  CHECK(*result.plant->deepest_m < 0.0);
  CHECK(*result.plant->deepest_m == Approx(*result.min_clearance_m).margin(1e-9));
  CHECK_THAT(result.cause, Catch::StartsWith("MuJoCo counts a contact at ") &&
                               Catch::Contains("mm inside obstacle 'hidden ball'; the judge: ") &&
                               Catch::Contains("mm inside obstacle 'hidden ball' at "));

  scene.start_q = VectorXd(run(scene).q);  // there from the start
  const log::Result refused = run(scene);
  CHECK(refused.outcome == log::Outcome::refused);
  CHECK(refused.plant->contacts == 1);
}

TEST_CASE("a run in MuJoCo repeats to the bit", "[mujoco]") {
  const test::TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "run.jsonl";
  scene::Scene scene = clutter();
  scene.duration_s = 0.5;
  scene.actuation.joint_noise_rad = 1e-4;
  {
    log::RunLog log(file);
    simulation::Watch watch;
    watch.log = &log;
    CHECK(run(scene, watch).outcome == log::Outcome::timeout);
  }
  const auto recorded = simulation::read_header(file, plugins);
  CHECK(recorded.scene.plant == scene::PlantType::mujoco);
  const auto verdict = simulation::verify(recorded, file, 0.0, plugins, {}, mujoco::make_plant);
  CHECK(verdict.finished);
  CHECK(verdict.ticks == 501);
  CHECK_FALSE(verdict.first_difference);
}

TEST_CASE("a can is carried through the shelf in MuJoCo, which counts no contact", "[mujoco]") {
  scene::Scene scene = scene::read_scene(test::data / "scenes" / "shelf_carry.json");
  scene.plant = scene::PlantType::mujoco;
  scene.actuation.type = scene::ActuationType::sampled;
  const log::Result result = run(scene);
  CAPTURE(result.cause);
  CHECK(result.outcome == log::Outcome::reached);
  CHECK(result.plant->contacts == 0);
  CHECK(*result.min_clearance_m > 0.003);
  // what the controller is not told of is touched, by MuJoCo's count, too
  scene.events[0].attach->shapes_known = false;
  const log::Result unknown = run(scene);
  CHECK(unknown.outcome == log::Outcome::collision);
  CHECK(unknown.plant->contacts + unknown.plant->judge_contacts > 0);
}
