#include <algorithm>
#include <catch2/catch.hpp>

#include "../scratch_scene.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/test/scene_data.hpp"

using namespace hamelin;
using log::Outcome;
using test::run_scene;
using test::TemporaryFolder;
using test::vector_of;

namespace {

constexpr double period_s = 0.001;

// The torques of the planner move the set point as they would move the arm.
Json servo_scene(const Json& torque, double kp, double kv) {
  Json scene = test::scene_52();
  scene["goals"] = {{{"type", "joint"}, {"q", {9.0, 9.0, 9.0, 9.0}}}};
  scene["planner"] = {{"name", "probe"}, {"params", {{"torque", torque}}}};
  scene["actuation"] = {{"type", "position"}, {"servo", {{"kp", kp}, {"kv", kv}}}};
  scene["step_s"] = period_s;
  scene["duration_s"] = 0.1;
  return scene;
}

std::vector<Json> logged_ticks(const TemporaryFolder& folder, const Json& scene,
                               const model::Robot& robot = test::planar4()) {
  log::RunLog log(folder.path() / "run.jsonl");
  simulation::Watch watch;
  watch.log = &log;
  (void)run_scene(folder, scene, watch, robot);
  std::vector<Json> ticks;
  for (auto& line : log::read_log(log.file()).lines)
    if (line["type"] == "tick") ticks.push_back(line);
  return ticks;
}

}  // namespace

TEST_CASE("a servo's torque follows the set point, which arrives after the delay",
          "[simulation][servo]") {
  const TemporaryFolder folder;
  const Json given{3.0, -1.0, 0.5, 0.2};
  Json scene = servo_scene(given, 500.0, 30.0);
  scene["actuation"]["servo"]["kv"] = {30.0, 20.0, 10.0, 5.0};
  const int delay_ticks = GENERATE(0, 2);
  scene["actuation"]["delay_s"] = delay_ticks * period_s;
  const bool dynamic = GENERATE(true, false);
  if (!dynamic) scene["actuation"]["servo"]["feedforward"] = "gravity";
  const auto ticks = logged_ticks(folder, scene);

  const model::Model model(test::planar4(), geometry::SE3{}, Eigen::Vector3d::Zero());
  dynamics::Workspace ws(model);
  const Eigen::VectorXd zero = Eigen::VectorXd::Zero(4);
  Eigen::VectorXd a(4);
  dynamics::forward_dynamics(model, ws, zero, zero, vector_of(given), a);
  const Eigen::VectorXd v = period_s * a, q = period_s * v;
  Eigen::VectorXd expected = 500.0 * q + Eigen::Vector4d(30.0, 20.0, 10.0, 5.0).cwiseProduct(v);
  if (dynamic) {  // without gravity in the plane
    Eigen::VectorXd feedforward(4);
    dynamics::inverse_dynamics(model, ws, q, v, a, feedforward);
    expected += feedforward;
  }
  for (int k = 0; k < delay_ticks; ++k)
    CHECK(vector_of(ticks.at(static_cast<std::size_t>(k))["tau"]).isZero(0.0));
  const Eigen::VectorXd found = vector_of(ticks.at(static_cast<std::size_t>(delay_ticks))["tau"]);
  CHECK((found - expected).norm() < 1e-9 * expected.norm());
}

TEST_CASE("stiffer servos keep the arm nearer to the motion that the planner asks for",
          "[simulation][servo]") {
  const TemporaryFolder folder;
  const Json torque{3.0, -1.0, 0.5, 0.2};
  Json ideal = servo_scene(torque, 1.0, 1.0);
  ideal["actuation"] = {{"type", "sampled"}};
  const Eigen::VectorXd wanted = run_scene(folder, ideal).q;
  const auto error = [&](double kp, double kv) {
    Json scene = servo_scene(torque, kp, kv);
    scene["actuation"]["servo"]["feedforward"] = "gravity";
    return (run_scene(folder, scene).q - wanted).norm();
  };
  const double soft = error(100.0, 10.0), stiff = error(1e4, 400.0);
  CHECK(stiff < 0.05 * wanted.norm());
  CHECK(soft > 10.0 * stiff);
}

TEST_CASE("an arm whose servos know its dynamics follows its set points when these accelerate",
          "[simulation][servo]") {
  const TemporaryFolder folder;
  Json scene = servo_scene({3.0, -1.0, 0.5, 0.2}, 100.0, 10.0);
  Json ideal = scene;
  ideal["actuation"] = {{"type", "sampled"}};
  const Eigen::VectorXd wanted = run_scene(folder, ideal).q;
  const double known = (run_scene(folder, scene).q - wanted).norm();
  scene["actuation"]["servo"]["feedforward"] = "gravity";
  const double unknown = (run_scene(folder, scene).q - wanted).norm();
  CHECK(known < 0.05 * wanted.norm());
  CHECK(unknown > 10.0 * known);
}

TEST_CASE("servos keep the torque limits, and that is counted", "[simulation][servo]") {
  const TemporaryFolder folder;
  Json scene = servo_scene({3.0, 0.0, 0.0, 0.0}, 1e4, 300.0);
  scene["model"]["torque_limits"] = true;
  scene["model"]["friction"] = 0.9;
  const auto ticks = logged_ticks(folder, scene, test::strong(1.0));
  double largest = 0.0;
  for (const Json& tick : ticks)
    largest = std::max(largest, vector_of(tick["tau"]).lpNorm<Eigen::Infinity>());
  CHECK(largest == 1.0);
  CHECK(ticks.at(50)["saturated"] == true);
  CHECK(*run_scene(folder, scene, {}, test::strong(1.0)).saturated_share > 0.1);
}

TEST_CASE("a set point at the goal is not enough: the arm itself must reach it",
          "[simulation][servo]") {
  const TemporaryFolder folder;
  Json scene = test::scene_52();
  scene["step_s"] = period_s;
  scene["duration_s"] = 12.0;
  scene["actuation"] = {{"type", "position"}, {"servo", {{"kp", 2000.0}, {"kv", 200.0}}}};
  CHECK(run_scene(folder, scene).outcome == Outcome::reached);
  scene["model"]["friction"] = 100.0;
  scene["duration_s"] = 6.0;
  const auto off = run_scene(folder, scene);
  CHECK(off.outcome == Outcome::timeout);
  CHECK(*off.goal->error_m > 0.01);
  CHECK(off.goal->index == 1);  // by the set point
}

TEST_CASE("a run ends where servos cannot follow their set points", "[simulation][servo]") {
  const TemporaryFolder folder;
  Json scene = test::scene_52();
  scene["step_s"] = period_s;
  scene["duration_s"] = 12.0;
  scene["model"]["friction"] = 500.0;
  scene["actuation"] = {{"type", "position"}, {"servo", {{"kp", 10.0}, {"kv", 1.0}}}};
  const auto held = run_scene(folder, scene);
  CHECK(held.outcome == Outcome::stalled);
  CHECK_THAT(held.cause, Catch::Contains("rad from its set point, expected at most 0.1"));
  CHECK(held.time_s < 5.0);
}

TEST_CASE("servos reach the goals of the clutter with friction, wrong masses and noise",
          "[simulation][servo]") {
  scene::Scene scene = scene::read_scene(test::data / "scenes" / "clutter.json");
  scene.actuation.type = scene::ActuationType::position;
  scene.actuation.servo = {{2000.0}, {80.0}};
  scene.actuation.delay_s = 0.001;
  scene.actuation.joint_noise_rad = 1e-5;
  scene.actuation.planner_mass_scale = GENERATE(0.95, 1.05);
  scene.actuation.coulomb_friction_share = 0.02;
  scene.model.armature = {false, {0.1}};
  scene.model.joint_damping = {false, {0.1}};
  const auto result = simulation::run(scene, {HAMELIN_TEST_PLUGIN_DIR}, {});
  CAPTURE(result.cause);
  CHECK(result.outcome == Outcome::reached);
  CHECK(*result.min_clearance_m > 0.005);
  CHECK(*result.goal->error_rad < 0.05);
}

TEST_CASE("gains that do not fit the robot or are unstable are refused", "[simulation][servo]") {
  const TemporaryFolder folder;
  Json scene = servo_scene({0.0, 0.0, 0.0, 0.0}, 500.0, 30.0);
  scene["actuation"]["servo"]["kp"] = {1.0, 2.0};
  CHECK_THROWS_WITH(run_scene(folder, scene),
                    Catch::Contains("/actuation/servo/kp: 2 values given, expected 1 or 4"));
  scene["actuation"]["servo"] = {{"kp", 1.0}, {"kv", 1.0}, {"jerk_max", {1.0, 2.0}}};
  CHECK_THROWS_WITH(run_scene(folder, scene),
                    Catch::Contains("/actuation/servo/jerk_max: 2 values given, expected 1 or 4"));
  scene["actuation"]["servo"] = {{"kp", 1.0}, {"kv", {1.0, 1.0, 1.0, 1e4}}};
  CHECK_THROWS_WITH(
      run_scene(folder, scene),
      Catch::Contains("/actuation/servo: joint 'j4' is unstable at the step 0.001 s"));
  scene["step_s"] = 1e-5;
  scene["duration_s"] = 1e-3;
  CHECK(run_scene(folder, scene).outcome == Outcome::timeout);
}

TEST_CASE("a plant that is not part of the build is refused in one line", "[simulation][plant]") {
  scene::Scene scene = scene::read_scene(test::data / "scenes" / "clutter.json");
  scene.name = "cell.json";
  scene.actuation.type = scene::ActuationType::sampled;
  scene.plant = scene::PlantType::mujoco;
  CHECK_THROWS_WITH(
      simulation::run(scene, {HAMELIN_TEST_PLUGIN_DIR}, {}),
      "cell.json: /plant/type: is mujoco, which this build of hamelin is without, expected "
      "hamelin; to build with MuJoCo, install libmujoco-dev and configure again");
}
