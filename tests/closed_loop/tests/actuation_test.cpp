#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "../scratch_scene.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/test/scene_data.hpp"

using namespace hamelin;
using log::Outcome;
using test::run_scene;
using test::scene_52;
using test::TemporaryFolder;
using test::vector_of;

namespace {

Json scene_of(const Json& params, const std::string& actuation = "ideal") {
  Json scene = scene_52();
  scene["goals"] = {{{"type", "joint"}, {"q", {9.0, 9.0, 9.0, 9.0}}}};
  scene["planner"] = {{"name", "probe"}, {"params", params}};
  scene["actuation"] = {{"type", actuation}};
  scene["step_s"] = 0.001;
  scene["duration_s"] = 0.1;
  return scene;
}

struct Logged {
  log::Result result;
  std::vector<Json> ticks, events;
};

Logged logged_run(const TemporaryFolder& folder, const Json& scene,
                  const model::Robot& robot = test::planar4()) {
  log::RunLog log(folder.path() / "run.jsonl");
  simulation::Watch watch;
  watch.log = &log;
  Logged logged;
  logged.result = run_scene(folder, scene, watch, robot);
  (void)log::check_log(log.file());
  for (auto& line : log::read_log(log.file()).lines) {
    if (line["type"] == "tick") logged.ticks.push_back(line);
    if (line["type"] == "event") logged.events.push_back(line);
  }
  return logged;
}

}  // namespace

TEST_CASE("a planner is given the actuation's settings and a goal's path",
          "[simulation][actuation]") {
  const TemporaryFolder folder;
  Json scene = scene_of(Json::object(), "sampled");
  scene["goals"] = {{{"type", "path"},
                     {"q", {{0.5, 0.0, 0.0, 0.0}, {0.2, 0.1, 0.0, 0.0}, {0.0, 0.0, 0.0, 0.0}}}}};
  scene["actuation"] = {{"type", "sampled"},
                        {"control_period_s", 0.002},
                        {"delay_s", 0.004},
                        {"torque_rate_max_Nm_s", 750.0}};
  const auto run = logged_run(folder, scene);
  REQUIRE_FALSE(run.events.empty());
  CHECK(run.events[0]["text"] == "probe: sampled 1, delay 0.004000, rate 750.000000, path 3");
  // A path is reached at its end, where the arm already is.
  CHECK(run.result.outcome == Outcome::reached);
  CHECK(run.result.goal->type == "path");
  CHECK(*run.result.goal->error_rad == 0.0);

  scene["goals"][0]["q"] = {{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}};
  CHECK_THROWS_WITH(run_scene(folder, scene),
                    Catch::Contains("/goals/0/q/0: 3 values given, expected 4"));
}

TEST_CASE("a held torque changes no faster than its rate limit, and that is counted",
          "[simulation][actuation]") {
  const TemporaryFolder folder;
  Json scene = scene_of({{"torque", {10.0, -3.0, 0.0, 0.5}}}, "sampled");
  scene["actuation"]["torque_rate_max_Nm_s"] = 1000.0;
  const auto run = logged_run(folder, scene);
  Eigen::VectorXd before = Eigen::VectorXd::Zero(4);
  for (std::size_t k = 0; k + 1 < run.ticks.size(); ++k) {
    const Eigen::VectorXd tau = vector_of(run.ticks[k]["tau"]);
    CHECK((tau - before).lpNorm<Eigen::Infinity>() <= 1.0 + 1e-12);
    CHECK(tau[3] == 0.5);  // a smaller torque is not limited
    CHECK(run.ticks[k]["saturated"] == (k < 9));
    before = tau;
  }
  CHECK(before[0] == Approx(10.0));
  CHECK(run.result.saturated_share == Approx(0.09));
  scene["actuation"]["type"] = "ideal";
  CHECK_THROWS_WITH(run_scene(folder, scene),
                    Catch::Contains("/actuation/torque_rate_max_Nm_s: is not allowed"));
}

TEST_CASE("Coulomb friction holds a torque below it nearly at rest, and only takes energy out",
          "[simulation][actuation]") {
  const TemporaryFolder folder;
  const std::string actuation = GENERATE(as<std::string>{}, "ideal", "sampled");
  CAPTURE(actuation);
  Json scene = scene_of({{"torque", {4.0, -4.0, 4.0, -4.0}}}, actuation);
  scene["actuation"]["coulomb_friction_share"] = 0.05;
  scene["duration_s"] = 4.0;
  const auto held = run_scene(folder, scene, {}, test::strong(100.0));
  // 5 Nm tanh(v / 0.01) = 4 Nm
  const double creep = 0.01 * std::atanh(0.8);
  CHECK((held.v - creep * Eigen::Vector4d(1.0, -1.0, 1.0, -1.0)).lpNorm<Eigen::Infinity>() <
        0.02 * creep);
  CHECK(held.dissipated_J > 0.0);

  // A swinging arm comes to rest.
  scene["planner"]["params"] = Json::object();
  scene["start"] = {{"v", {1.0, -2.0, 1.5, 0.5}}};
  scene["duration_s"] = 20.0;
  const auto swung = run_scene(folder, scene, {}, test::strong(100.0));
  CHECK(swung.v.lpNorm<Eigen::Infinity>() < 1e-3);
  CHECK(swung.dissipated_J == Approx(swung.energy_initial_J).epsilon(1e-3));

  CHECK_THROWS_WITH(run_scene(folder, scene),
                    Catch::Contains("/actuation/coulomb_friction_share") &&
                        Catch::Contains("joint 'j1' of 'planar4' has none"));
}

TEST_CASE("dry friction of the model and of the actuation act alike and add up",
          "[simulation][actuation]") {
  const TemporaryFolder folder;
  Json scene = scene_of({{"torque", {9.0, -4.0, 12.0, 1.0}}}, "ideal");
  scene["start"] = {{"v", {1.0, -2.0, 1.5, 0.5}}};
  scene["duration_s"] = 0.5;
  const auto final_q = [&](const Json& model, double share) {
    scene["model"] = test::scene_52()["model"];
    scene["model"].update(model);
    scene["actuation"]["coulomb_friction_share"] = share;
    model::Robot robot = test::strong(100.0);
    for (auto& link : robot.links) link.joint.friction = 5.0;
    return run_scene(folder, scene, {}, robot).q;
  };
  const Eigen::VectorXd named = final_q({{"friction", 5.0}}, 0.0);
  CHECK(named == final_q(Json::object(), 0.05));
  CHECK(named == final_q({{"friction", "robot"}}, 0.0));
  CHECK(named == final_q({{"friction", {2.5, 2.5, 2.5, 2.5}}}, 0.025));
  CHECK((named - final_q(Json::object(), 0.0)).norm() > 1e-3);
  CHECK((named - final_q({{"friction", 5.0}, {"friction_speed", 0.5}}, 0.0)).norm() > 1e-5);
}

TEST_CASE(
    "under sampled actuation a node velocity becomes a torque by the planner's masses, not the "
    "true ones",
    "[simulation][actuation]") {
  const TemporaryFolder folder;
  for (const double scale : {0.9, 1.0, 1.1}) {
    Json scene = scene_of({{"velocity", {0.02, -0.01, 0.03, 0.01}}}, "sampled");
    scene["actuation"]["planner_mass_scale"] = scale;
    scene["duration_s"] = 0.001;
    const auto result = run_scene(folder, scene);
    const Eigen::Vector4d expected = scale * Eigen::Vector4d(0.02, -0.01, 0.03, 0.01);
    CAPTURE(scale, result.v.transpose());
    CHECK((result.v - expected).norm() < 1e-3 * expected.norm());
  }
}

TEST_CASE("with exact positions an estimated velocity is as good as a measured one",
          "[simulation][actuation]") {
  const TemporaryFolder folder;
  Json scene = scene_of({{"torque", {9.0, -4.0, 12.0, 1.0}}}, "sampled");
  scene["actuation"]["delay_s"] = GENERATE(0.0, 0.003);
  scene["planner"] = {{"name", "hybrid"}, {"guide", "none"}};
  scene["goals"] = {{{"type", "joint"}, {"q", {0.4, -0.3, 0.5, 0.2}}}};
  scene["duration_s"] = 0.6;
  const auto measured = run_scene(folder, scene);
  scene["actuation"]["joint_velocity"] = "estimated";
  const auto estimated = run_scene(folder, scene);
  CAPTURE(measured.q.transpose(), estimated.q.transpose());
  CHECK(measured.v.norm() > 0.1);
  CHECK((measured.q - estimated.q).norm() < 1e-4);
  CHECK((measured.v - estimated.v).norm() < 1e-3);
}

TEST_CASE("noisy positions are enough for a smooth torque that keeps its distance",
          "[simulation][actuation]") {
  scene::Scene scene = scene::read_scene(test::data / "scenes" / "clutter.json");
  scene.actuation.type = scene::ActuationType::sampled;
  scene.actuation.control_period_s = scene.step_s = 0.001;
  scene.actuation.delay_s = 0.001;
  scene.actuation.joint_noise_rad = 1e-4;
  scene.actuation.estimates_velocity = true;
  scene.actuation.coulomb_friction_share = 0.02;
  scene.actuation.planner_mass_scale = GENERATE(0.95, 1.05);
  scene.actuation.torque_rate_max_Nm_s = 1000.0;
  const auto result = simulation::run(scene, {HAMELIN_TEST_PLUGIN_DIR}, {});
  CAPTURE(result.cause);
  CHECK(result.outcome == Outcome::reached);
  CHECK(*result.min_clearance_m > 0.002);
  REQUIRE(result.torque_change);
  CHECK(result.torque_change->mean() < 0.5);
  CHECK(result.torque_change->max <= 1.0 + 1e-9);  // 1000 Nm/s for 1 ms
}

TEST_CASE("the error of a goal of the tip is reported also if the planner's masses are wrong",
          "[simulation][actuation]") {
  const TemporaryFolder folder;
  Json scene = scene_of(Json::object(), "sampled");
  scene["actuation"]["planner_mass_scale"] = 1.1;
  scene["duration_s"] = 0.001;
  for (const std::string type : {"position", "pose"}) {
    scene["goals"] = {{{"type", type}, {"position_m", {9.0, 0.0, 0.0}}}};
    if (type == "pose") scene["goals"][0]["quaternion_wxyz"] = {1.0, 0.0, 0.0, 0.0};
    const auto result = run_scene(folder, scene);
    REQUIRE(result.goal->error_m);
    CHECK(*result.goal->error_m > 4.0);  // the arm is 4 m long
    CHECK(result.goal->error_rad.has_value() == (type == "pose"));
  }
}

TEST_CASE("torque limits scale a node's change of velocity as a whole, and that is counted",
          "[simulation][actuation]") {
  const TemporaryFolder folder;
  const model::Robot robot = test::strong(10.0);
  const model::Model model(robot, geometry::SE3{}, Eigen::Vector3d::Zero());
  dynamics::Workspace ws(model);
  Json scene = scene_of({{"velocity", {1.0, 0.0, 0.0, 0.0}}, {"torque", {2.0, 0.0, 0.0, 0.0}}});
  scene["model"]["torque_limits"] = true;
  scene["duration_s"] = 0.01;
  const auto run = logged_run(folder, scene, robot);
  Eigen::VectorXd asked(4);
  dynamics::momentum(model, ws, Eigen::VectorXd::Zero(4), Eigen::Vector4d(1000.0, 0.0, 0.0, 0.0),
                     asked);
  const Json& tick = run.ticks.at(0);
  CHECK(tick["saturated"] == true);
  const Eigen::VectorXd node = vector_of(tick["channels"]["node"]), tau = vector_of(tick["tau"]);
  CHECK(tau.lpNorm<Eigen::Infinity>() == Approx(10.0).epsilon(1e-9));
  CHECK((node - node[0] / asked[0] * asked).norm() < 1e-9 * node.norm());  // the direction is kept
  CHECK(node[0] == Approx(8.0));  // the held torque has priority
  CHECK(run.result.saturated_share == 1.0);
  CHECK(run.result.node_work_J > 0.0);
  CHECK(run.result.energy_error_max_J < 1e-6);

  scene["model"]["torque_limits"] = false;
  const auto free = logged_run(folder, scene, robot);
  CHECK_FALSE(free.result.saturated_share.has_value());
  CHECK_FALSE(free.ticks.at(0).contains("saturated"));
  CHECK(vector_of(free.ticks.at(0)["channels"]["node"])[0] == Approx(asked[0]));
}

TEST_CASE(
    "impossible accounts of a filter are a defect under ideal actuation and only reported "
    "otherwise",
    "[simulation][certificate]") {
  const TemporaryFolder folder;
  const auto [key, value, text] = GENERATE(table<std::string, double, std::string>(
      {{"filter_work_J", 1e-3, "its filter added 0.001 J"},
       {"recovery_work_J", -1e-3, "its recovery took out 0.001 J"}}));
  CAPTURE(key);
  Json scene = scene_of({{"velocity", {0.1, 0.0, 0.0, 0.0}}, {key, value}, {"books_at_tick", 5}});
  const auto broken = run_scene(folder, scene);
  CHECK(broken.outcome == Outcome::defect);
  CHECK(log::exit_code(broken.outcome) == 3);
  CHECK(broken.steps == 5);
  CHECK_THAT(broken.cause, Catch::Contains("planner 'probe' at step 5: " + text));

  scene["planner"]["params"][key] = -value;  // the sign that filters may have
  CHECK(run_scene(folder, scene).outcome == Outcome::timeout);
  scene["planner"]["params"][key] = 1e-12 * value;  // rounding
  CHECK(run_scene(folder, scene).outcome == Outcome::timeout);
  scene["planner"]["params"][key] = value;
  scene["integrator"] = {{"name", "rk4"}};
  CHECK(run_scene(folder, scene).outcome == Outcome::timeout);
  scene["integrator"] = {{"name", "hamel-variational"}};
  scene["actuation"]["type"] = "sampled";
  const auto sampled = run_scene(folder, scene);
  CHECK(sampled.outcome == Outcome::timeout);
  CHECK((key == "filter_work_J" ? sampled.filter_work_J : sampled.recovery_work_J) == value);
}

TEST_CASE("an energy account that does not close is a defect that names the step",
          "[simulation][certificate]") {
  const TemporaryFolder folder;
  Json scene = scene_of(Json::object());
  scene["start"] = {{"v", {6.0, -14.0, 10.0, -12.0}}};
  scene["duration_s"] = 2.0;
  const auto fine = run_scene(folder, scene);
  CHECK(fine.outcome == Outcome::timeout);
  scene["step_s"] = 0.05;  // 0.7 rad per step
  const auto coarse = run_scene(folder, scene);
  CAPTURE(coarse.cause);
  CHECK(coarse.outcome == Outcome::defect);
  CHECK_THAT(coarse.cause,
             Catch::Contains("step ") && Catch::Contains("the energy account is off by "));
  scene["integrator"] = {{"name", "semi-implicit-euler"}};  // not checked
  CHECK(run_scene(folder, scene).outcome != Outcome::defect);
}

TEST_CASE("the largest acceleration and jerk are those of the logged velocities",
          "[simulation][log]") {
  const TemporaryFolder folder;
  Json scene = scene_of({{"torque", {3.0, -2.0, 1.0, 0.5}}, {"torque_until_s", 0.05}});
  const auto run = logged_run(folder, scene);
  Eigen::VectorXd a = Eigen::VectorXd::Zero(4), jerk = a, last;
  for (std::size_t k = 1; k < run.ticks.size(); ++k) {
    const Eigen::VectorXd now =
        (vector_of(run.ticks[k]["v"]) - vector_of(run.ticks[k - 1]["v"])) / 0.001;
    a = a.cwiseMax(now.cwiseAbs());
    if (last.size() > 0) jerk = jerk.cwiseMax((now - last).cwiseAbs() / 0.001);
    last = now;
  }
  CHECK(a.minCoeff() > 0.01);
  CHECK((run.result.a_abs_max - a).norm() < 1e-9 * a.norm());
  CHECK((run.result.jerk_abs_max - jerk).norm() < 1e-9 * jerk.norm());
  CHECK(jerk[0] > 100.0);  // when the torque ends
}
