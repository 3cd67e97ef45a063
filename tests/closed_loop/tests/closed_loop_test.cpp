#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>

#include "../scratch_scene.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/chains.hpp"

using namespace hamelin;
using log::Outcome;
using test::ball;
using test::run_scene;
using test::scene_52;
using test::TemporaryFolder;

namespace {

// An undamped spring of stiffness 1 N/m pulls the tip: E_0 = 6.5 J.
Json spring(double step_s, const std::string& actuation) {
  Json scene = scene_52();
  scene["goals"][0]["speed_max"] = 1e-9;
  scene["planner"]["params"] = {
      {"algorithm", "published"}, {"mapping", "potential"}, {"k_p", 1.0}, {"joint_damping", 0.0}};
  scene["actuation"] = {{"type", actuation}};
  scene["step_s"] = step_s;
  scene["duration_s"] = 20.0;
  return scene;
}

Json moving(Json obstacle, double x, double y) {
  obstacle["motion"] = {{"type", "sine"}, {"amplitude_m", {x, y, 0.0}}, {"period_s", 5.0}};
  return obstacle;
}

// Kinetic energy plus that of the spring at the end of a run, computed from its state alone.
double spring_energy(const log::Result& result) {
  const model::Model model(test::planar4(), geometry::SE3{}, Eigen::Vector3d::Zero());
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, result.q);
  const double away = (dynamics::tip_pose(model, ws).p() - test::goal_52).norm();
  return dynamics::kinetic_energy(model, ws, result.q, result.v) + 0.5 * away * away;
}

// The log's lines without the parts that depend on clock and machine.
std::string fixed_part(const std::filesystem::path& file) {
  std::string text;
  for (Json line : log::read_log(file).lines) {
    line.erase("timing");
    line.erase("provenance");
    text += line.dump() + "\n";
  }
  return text;
}

}  // namespace

TEST_CASE("the energy account of a control potential closes with the square of the step",
          "[simulation][energy]") {
  const TemporaryFolder folder;
  std::vector<double> errors;
  for (const double h : {0.001, 0.002, 0.004}) {
    const auto kicks = run_scene(folder, spring(h, "ideal"));
    CAPTURE(h, kicks.cause);
    REQUIRE(kicks.outcome == Outcome::timeout);
    CHECK(kicks.energy_initial_J == Approx(6.5).epsilon(1e-9));
    CHECK(spring_energy(kicks) == Approx(6.5).margin(2.0 * kicks.energy_error_max_J));
    errors.push_back(kicks.energy_error_max_J);

    const auto held = run_scene(folder, spring(h, "sampled"));
    REQUIRE(held.outcome == Outcome::timeout);
    CHECK(std::abs(spring_energy(held) - 6.5) > 100.0 * kicks.energy_error_max_J);
  }
  CAPTURE(errors[0], errors[1], errors[2]);
  CHECK(errors[1] / errors[0] == Approx(4.0).epsilon(0.2));
  CHECK(errors[2] / errors[1] == Approx(4.0).epsilon(0.2));
}

TEST_CASE(
    "energy-neutral steering does no work at any step, and brings the arm of example 5.2 to its "
    "goal",
    "[simulation][energy]") {
  const TemporaryFolder folder;
  Json scene = read_json(std::filesystem::path(HAMELIN_SOURCE_DIR) / "data" / "scenes" /
                         "paper_52_gyro.json");
  scene["robot"]["file"] = "robot.json";
  for (const double h : {0.001, 0.004, 0.01}) {
    scene["step_s"] = h;
    const auto result = run_scene(folder, scene);
    CAPTURE(h, result.cause, result.gyroscopic_work_J);
    CHECK(result.outcome == Outcome::reached);
    CHECK(std::abs(result.gyroscopic_work_J) <= 1e-10);
    REQUIRE(result.min_clearance_m.has_value());
    CHECK(*result.min_clearance_m > 0.0);
    CHECK(*result.min_clearance_m < 0.5);  // near enough to steer
  }
}

TEST_CASE("a turn that is predicted leads past a ball, where the same law without turns does not",
          "[simulation][energy]") {
  const TemporaryFolder folder;
  Json scene = scene_52();
  scene["obstacles"] = Json::array({ball("in the way", 2.4, 2.3, 0.25)});
  scene["goals"] = {{{"type", "joint"}, {"q", {1.6, 0.0, 0.0, 0.0}}}};
  scene["actuation"]["type"] = GENERATE("ideal", "sampled");
  scene["duration_s"] = 60.0;
  CAPTURE(scene["actuation"]);
  const auto run = [&](const std::string& turns) {
    scene["planner"] = {{"name", "gyro"}, {"params", {{"variant", "predicted"}, {"turns", turns}}}};
    const auto result = run_scene(folder, scene);
    CHECK(result.gyroscopic_work_J == 0.0);
    CHECK(*result.min_clearance_m > 0.0);
    CHECK(result.energy_error_max_J < 1e-3);
    return result.outcome;
  };
  CHECK(run("none") != Outcome::reached);
  if (scene["actuation"]["type"] == "ideal") CHECK(run("tangents") == Outcome::reached);
  CHECK(run("all") == Outcome::reached);
}

TEST_CASE("a start in contact is refused before the first step", "[simulation][outcome]") {
  const TemporaryFolder folder;
  Json scene = scene_52();
  scene["obstacles"] = Json::array({ball("post", 2.5, 0.1, 0.2)});
  const auto result = run_scene(folder, scene);
  CHECK(result.outcome == Outcome::refused);
  CHECK(result.steps == 0);
  CHECK_THAT(result.cause, Catch::Contains("'link3'") && Catch::Contains("'post'"));
}

TEST_CASE("a goal inside an obstacle is never reached and never touched", "[simulation][outcome]") {
  const TemporaryFolder folder;
  Json scene = scene_52();
  scene["obstacles"] = Json::array({ball("over the goal", 2.0, 3.0, 0.3)});
  scene["stall"] = Json::object();
  scene["planner"]["params"]["eta"] = 1.84;
  const auto result = run_scene(folder, scene);
  CAPTURE(result.cause);
  CHECK(result.outcome == Outcome::stalled);
  REQUIRE(result.goal.has_value());
  CHECK(*result.goal->error_m > 0.3);
  CHECK(*result.min_clearance_m > 0.0);
}

TEST_CASE("too little time ends as timeout at the last step", "[simulation][outcome]") {
  const TemporaryFolder folder;
  Json scene = scene_52();
  scene["duration_s"] = 0.4;
  const auto result = run_scene(folder, scene);
  CHECK(result.outcome == Outcome::timeout);
  CHECK(result.steps == 100);
  CHECK(result.time_s == Approx(0.4).epsilon(1e-12));
  CHECK_FALSE(result.min_clearance_m.has_value());
}

TEST_CASE("a timeout says if the shield holds the arm, and for what", "[simulation][outcome]") {
  const TemporaryFolder folder;
  Json scene = scene_52();
  scene["robot"]["file"] = HAMELIN_SOURCE_DIR "/data/robots/arm7.urdf";
  scene["start"] = {{"q", {0.0, -0.7, 0.0, -2.3, 0.0, 1.5, 0.7}}};
  scene["goals"] = {{{"type", "joint"}, {"q", {1.0, -0.7, 0.0, -2.3, 0.0, 1.5, 0.7}}}};
  scene["model"] = {{"joint_limits", true}, {"velocity_limits", true}, {"torque_limits", true}};
  scene["planner"] = {{"name", "apf"}, {"params", {{"algorithm", "published"}, {"k_p", 1e6}}}};
  scene["step_s"] = 0.004;
  scene["duration_s"] = 0.04;
  const auto result = run_scene(folder, scene);
  CHECK(result.outcome == Outcome::timeout);
  CHECK(result.cause ==
        "goal not reached within 0.04 s; the shield has held the arm since 0.000 s: joint 'joint7' "
        "would pass its velocity limit");
}

TEST_CASE("a planner that throws or answers NaN ends the run as a defect that names the step",
          "[simulation][outcome]") {
  const TemporaryFolder folder;
  Json scene = scene_52();
  for (const std::string how : {"throw", "nan"}) {
    scene["planner"] = {{"name", "breaking"}, {"params", {{"at_tick", 10}, {"how", how}}}};
    const auto result = run_scene(folder, scene);
    CAPTURE(how, result.cause);
    CHECK(result.outcome == Outcome::defect);
    CHECK(result.steps == 10);
    CHECK_THAT(result.cause, Catch::Contains("'breaking' at step 10"));
    CHECK(result.cause.find('\n') == std::string::npos);
  }
  scene["planner"]["params"] = {{"at_tick", 10}, {"how", "give up"}};
  const auto result = run_scene(folder, scene);
  CHECK(result.outcome == Outcome::stalled);
  CHECK(result.cause == "no path to the goal");
}

TEST_CASE("an obstacle that appears on the arm is a collision that names both",
          "[simulation][outcome]") {
  const TemporaryFolder folder;
  Json scene = scene_52();
  scene["planner"] = {{"name", "breaking"}};  // the arm rests
  scene["obstacles"] = Json::array({ball("ghost", 3.5, 0.05, 0.2)});
  scene["obstacles"][0]["appears_s"] = 1.0;
  const auto result = run_scene(folder, scene);
  CAPTURE(result.cause, result.time_s);
  CHECK(result.outcome == Outcome::collision);
  CHECK(result.time_s == Approx(1.0).margin(1e-9));
  CHECK_THAT(result.cause, Catch::Contains("'link4'") && Catch::Contains("'ghost'"));
}

TEST_CASE("goals of every type have their own error measure", "[simulation][goal]") {
  const TemporaryFolder folder;
  Json scene = scene_52();
  const auto position = run_scene(folder, scene);
  REQUIRE(position.outcome == Outcome::reached);
  CHECK(position.goal->type == "position");
  CHECK(*position.goal->error_m < 0.02);
  CHECK_FALSE(position.goal->error_rad.has_value());
  CHECK(position.v.lpNorm<Eigen::Infinity>() < 0.05);

  SECTION("joint") {
    scene["goals"] = {{{"type", "joint"}, {"q", {0.4, -0.3, 0.2, 0.5}}}};
    const auto result = run_scene(folder, scene);
    REQUIRE(result.outcome == Outcome::reached);
    const Eigen::Vector4d goal(0.4, -0.3, 0.2, 0.5);
    CHECK((result.q - goal).lpNorm<Eigen::Infinity>() < 0.05);
    CHECK(*result.goal->error_rad == Approx((result.q - goal).lpNorm<Eigen::Infinity>()));
    CHECK_FALSE(result.goal->error_m.has_value());
  }
  SECTION("pose: the angle decides where the position is met") {
    // The planner controls the position only, so the arm arrives as before, turned by the sum of
    // its angles.
    const double turn = position.q.sum();
    const auto pose = [&](double angle) {
      Json goal{{"type", "pose"}, {"position_m", {2.0, 3.0, 0.0}}, {"speed_max", 0.05}};
      goal["quaternion_wxyz"] = {std::cos(0.5 * angle), 0.0, 0.0, std::sin(0.5 * angle)};
      return goal;
    };
    scene["goals"] = Json::array({pose(turn + 0.1)});
    const auto met = run_scene(folder, scene);
    CHECK(met.outcome == Outcome::reached);
    CHECK(*met.goal->error_m < 0.01);
    CHECK(*met.goal->error_rad == Approx(0.1).margin(0.1));
    scene["goals"] = Json::array({pose(turn + 3.0)});
    scene["duration_s"] = 10.0;
    const auto missed = run_scene(folder, scene);
    CHECK(missed.outcome == Outcome::timeout);
    CHECK(*missed.goal->error_rad > 2.0);
  }
  SECTION("position with the tip's speed, as example 5.2 has it") {
    const model::Model model(test::planar4(), geometry::SE3{}, Eigen::Vector3d::Zero());
    dynamics::Workspace ws(model);
    const auto tip_at = [&](const Eigen::VectorXd& q) -> Eigen::Vector3d {
      dynamics::forward_kinematics(model, ws, q);
      return dynamics::tip_pose(model, ws).p();
    };
    const auto tip_speed = [&](const log::Result& result) {
      const double h = 1e-6;
      return (tip_at(result.q + h * result.v) - tip_at(result.q - h * result.v)).norm() / (2.0 * h);
    };
    scene["goals"][0].erase("speed_max");
    const auto fast = run_scene(folder, scene);
    REQUIRE(fast.outcome == Outcome::reached);
    const double least = tip_speed(fast) / 3.0;
    scene["goals"][0]["tip_speed_max_m_s"] = least;
    const auto slow = run_scene(folder, scene);
    REQUIRE(slow.outcome == Outcome::reached);
    CHECK(slow.time_s > fast.time_s);
    CHECK(*slow.goal->error_m < 0.02);
    CHECK(tip_speed(slow) < least);
    // It arrives at the first node at which this holds: one step before it was faster.
    CHECK(tip_speed(slow) > 0.98 * least);
  }
  SECTION("a list, in its order") {
    scene["goals"] = {{{"type", "position"}, {"position_m", {2.0, 3.0, 0.0}}},
                      {{"type", "joint"}, {"q", {0.4, -0.3, 0.2, 0.5}}}};
    scene["duration_s"] = 60.0;
    log::RunLog log(folder.path() / "run.jsonl");
    simulation::Watch watch;
    watch.log = &log;
    const auto result = run_scene(folder, scene, watch);
    CHECK(result.outcome == Outcome::reached);
    CHECK(result.goal->count == 2);
    std::vector<std::size_t> aimed;
    for (const auto& line : log::read_log(log.file()).lines)
      if (line["type"] == "tick" && (aimed.empty() || aimed.back() != line["goal_index"]))
        aimed.push_back(line["goal_index"]);
    CHECK(aimed == std::vector<std::size_t>{0, 1, 2});
  }
}

TEST_CASE("the same seed gives the same bytes except for clock and machine, another seed differs",
          "[simulation][determinism]") {
  const TemporaryFolder folder;
  Json scene = scene_52();
  scene["obstacles"] = Json::array({ball("obstacle", 2.4, 2.2, 0.25)});
  scene["actuation"] = {{"type", "sampled"},
                        {"control_period_s", 0.008},
                        {"delay_s", 0.008},
                        {"joint_noise_rad", 1e-4}};
  scene["duration_s"] = 1.0;
  const auto logged = [&](int seed, const char* name) {
    scene["seed"] = seed;
    log::RunLog log(folder.path() / name);
    simulation::Watch watch;
    watch.log = &log;
    (void)run_scene(folder, scene, watch);
    return fixed_part(log.file());
  };
  const std::string first = logged(7, "a.jsonl"), second = logged(7, "b.jsonl"),
                    other = logged(8, "c.jsonl");
  CHECK(first.size() > 10000);
  CHECK(first == second);
  // The seed itself is in header and result; the motion must differ as well.
  CHECK(log::read_log(folder.path() / "a.jsonl").lines[100]["q"] !=
        log::read_log(folder.path() / "c.jsonl").lines[100]["q"]);
}

TEST_CASE("every line of a run's log fits its schema", "[simulation][log]") {
  const TemporaryFolder folder;
  Json scene = scene_52();
  scene["obstacles"] = Json::array({ball("obstacle", 2.4, 2.2, 0.25)});
  scene["duration_s"] = 0.4;
  log::RunLog log(folder.path() / "run.jsonl");
  simulation::Watch watch;
  watch.log = &log;
  watch.every = 30;
  (void)run_scene(folder, scene, watch);
  const auto summary = log::check_log(log.file());
  CHECK(summary.has_result);
  CHECK(summary.ticks == 5);  // steps 0, 30, 60, 90 and the last, 100
}

TEST_CASE("memory does not grow with the number of steps", "[simulation][outcome]") {
  const TemporaryFolder folder;
  Json scene = scene_52();
  scene["duration_s"] = 4e7;  // 10^10 steps of 4 ms
  simulation::Watch watch;
  watch.stop_at = 3;
  const auto result = run_scene(folder, scene, watch);
  CHECK(result.outcome == Outcome::interrupted);
  CHECK(result.steps == 3);
  REQUIRE(result.tick_us.has_value());
  CHECK(result.tick_us->p50 > 0.0);
  CHECK(result.tick_us->p50 <= result.tick_us->p99);
  CHECK(result.tick_us->p99 <= result.tick_us->max);
}

TEST_CASE("a stop from outside ends the run as interrupted, with a complete log",
          "[simulation][outcome]") {
  const TemporaryFolder folder;
  std::atomic<bool> stop = false;
  log::RunLog log(folder.path() / "run.jsonl");
  simulation::Watch watch;
  watch.log = &log;
  watch.stop = &stop;
  Json scene = scene_52();
  scene["planner"] = {{"name", "breaking"}};
  watch.progress = [&](double time_s, double) { stop = time_s > 3.0; };
  const auto result = run_scene(folder, scene, watch);
  CHECK(result.outcome == Outcome::interrupted);
  CHECK(result.steps < 10000);
  CHECK(log::check_log(log.file()).has_result);
}

TEST_CASE("a spatial arm under gravity reaches the same place with each scheme",
          "[simulation][integrator]") {
  const TemporaryFolder folder;
  Json scene = scene_52();
  scene["gravity_m_s2"] = {0.0, 0.0, -9.81};
  scene["start"] = {{"q", {0.3, -0.25, 0.4, -0.15, 0.5, -0.05, 0.6}}};
  scene["goals"] = {{{"type", "joint"}, {"q", {0.5, 0.1, 0.2, -0.3, 0.4, 0.1, 0.5}}}};
  scene["planner"]["params"] = {
      {"algorithm", "published"}, {"k_p", 20.0}, {"k_v", 10.0}, {"joint_damping", 0.5}};
  scene["step_s"] = 0.001;
  scene["duration_s"] = 20.0;
  std::optional<log::Result> first;
  for (const auto& name : integration::integrator_names()) {
    scene["integrator"] = {{"name", name}};
    const auto result = run_scene(folder, scene, {}, test::spatial_chain(7));
    CAPTURE(name, result.cause);
    REQUIRE(result.outcome == Outcome::reached);
    if (!first) first = result;
    CHECK(result.time_s == Approx(first->time_s).margin(0.01));
    CHECK((result.q - first->q).lpNorm<Eigen::Infinity>() < 1e-3);
  }
}

TEST_CASE("scenes that cannot be run are refused in one line", "[simulation][input]") {
  const TemporaryFolder folder;
  const auto refusal = [&](const std::string& pointer, const Json& value) -> std::string {
    Json scene = scene_52();
    scene[Json::json_pointer(pointer)] = value;
    try {
      (void)run_scene(folder, scene);
    } catch (const Error& error) {
      CHECK(std::string(error.what()).find('\n') == std::string::npos);
      return error.what();
    }
    return "";
  };
  CHECK_THAT(refusal("/goals", Json::array()), Catch::Contains("scene.json: /goals"));
  CHECK_THAT(refusal("/start/q", {1.0, 2.0}),
             Catch::Contains("/start/q: 2 values given, expected 4"));
  CHECK_THAT(refusal("/planner", nullptr), Catch::Contains("/planner"));
  CHECK_THAT(refusal("/planner/name", "apff"), Catch::Contains("apf"));
  CHECK_THAT(refusal("/planner/params/k_p", -1), Catch::Contains("k_p"));
  CHECK_THAT(refusal("/model", {{"joint_damping", {1.0, 2.0}}}),
             Catch::Contains("/model/joint_damping"));
  CHECK_THAT(refusal("/duration_s", 0.0037),
             Catch::Contains("not an integer multiple of the step"));
  CHECK_THAT(refusal("/actuation", {{"type", "sampled"}, {"control_period_s", 0.006}}),
             Catch::Contains("control_period_s"));
  CHECK_THAT(refusal("/integrator", {{"name", "euler"}}), Catch::Contains("euler"));
}

namespace {

// Keeps a planner's library loaded: the memory that the dynamic linker needs to load it again
// varies.
planning::Plugin keep_loaded(const std::string& planner) {
  for (const auto& directory : test::plugin_directories)
    if (const auto file = directory / (planner + ".hamelin.so"); std::filesystem::exists(file))
      return planning::Plugin::load(file);
  throw std::runtime_error("no plugin " + planner);
}

}  // namespace

TEST_CASE("a tick does not allocate", "[simulation][allocation]") {
  test::require_allocation_count();
  const TemporaryFolder folder;
  // The host allocates for messages, such as that of a search.
  const auto [planner, params] =
      GENERATE(std::pair("apf", Json::object()), std::pair("gyro", Json::object()),
               std::pair("gyro", Json{{"variant", "predicted"}}),
               std::pair("hybrid", Json{{"escape", "none"}}));
  CAPTURE(planner, params);
  const auto loaded = keep_loaded(planner);
  Json scene = scene_52();
  scene["obstacles"] = {ball("obstacle", 2.4, 2.2, 0.25),
                        moving(ball("passer-by", 1.5, -0.4, 0.1), 0.5, 0.0)};
  scene["model"]["self_collision"] = true;
  scene["planner"] = {{"name", planner}, {"params", params}};
  // From node to node: what a result says at the end depends on the run.
  long before = -1, after = -1;
  simulation::Watch watch;
  watch.at_node = [&](double time_s, const auto&) {
    if (before < 0 && time_s > 0.2) before = allocation_count();
    after = allocation_count();
  };
  scene["duration_s"] = 1.0;
  CHECK(run_scene(folder, scene, watch).outcome == Outcome::timeout);
  CHECK(before > 0);
  CHECK(after == before);
}

TEST_CASE("a tick with everything that can be modelled does not allocate",
          "[simulation][allocation]") {
  test::require_allocation_count();
  const TemporaryFolder folder;
  const std::string actuation = GENERATE(as<std::string>{}, "ideal", "sampled");
  CAPTURE(actuation);
  const auto loaded = keep_loaded("probe");
  model::Robot robot = test::planar4();
  for (auto& link : robot.links) link.joint.effort_max = 5.0;
  Json scene = scene_52();
  scene["obstacles"] = {ball("known", 2.4, 2.2, 0.25), ball("hidden", 2.4, -2.2, 0.25),
                        moving(ball("passer-by", 1.5, 0.8, 0.2), 0.5, 0.0)};
  scene["obstacles"][1]["known"] = false;
  scene["obstacles"][1]["visible_within_m"] = 0.5;
  scene["model"]["self_collision"] = scene["model"]["torque_limits"] = true;
  scene["actuation"] = {{"type", actuation}, {"coulomb_friction_share", 0.1}};
  if (actuation == "sampled") scene["actuation"]["torque_rate_max_Nm_s"] = 100.0;
  scene["planner"] = {{"name", "probe"},
                      {"params",
                       {{"velocity", {0.01, 0.0, 0.0, 0.02}},
                        {"think_of", {0.5, 0.5, 0.0, 0.0}},
                        {"influence_m", 10.0}}}};
  const auto allocations = [&](double duration_s) {
    scene["duration_s"] = duration_s;
    return test::allocations_in([&] {
      const auto result = run_scene(folder, scene, {}, robot);
      CHECK(result.outcome == Outcome::timeout);
    });
  };
  (void)allocations(0.2);
  CHECK(allocations(2.0) == allocations(1.0));
}
