// Complete runs with the planner as a plugin.
#include <algorithm>
#include <catch2/catch.hpp>

#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/test/arm_loop.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;
using log::Outcome;

namespace {

const std::filesystem::path plugin_file = HAMELIN_TEST_PLUGIN_DIR "/mppi.hamelin.so";
const std::filesystem::path robots = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/robots";

/// planar4 with the limits that scenes model.
model::Robot limited_planar4() {
  model::Robot robot = test::planar4(10);
  for (auto& link : robot.links) {
    link.joint.velocity_max = 1.2;
    link.joint.effort_max = 200.0;
  }
  return robot;
}

Json planar_scene(const Json& goal, const Json& obstacles = Json::array()) {
  return {{"schema", "hamelin.scene/1"},
          {"robot", {{"file", "robot.json"}}},
          {"goals", {goal}},
          {"obstacles", obstacles},
          {"model", {{"velocity_limits", true}, {"torque_limits", true}}},
          {"planner", {{"name", "mppi"}, {"params", {{"samples", 64}}}}},
          {"step_s", 0.002},
          {"duration_s", 20.0}};
}

Json joint_goal(const std::vector<double>& q) {
  return {{"type", "joint"}, {"q", q}};
}

Json ball(double x, double y, double radius) {
  return {{"name", "ball"}, {"type", "sphere"}, {"radius_m", radius}, {"position_m", {x, y, 0.0}}};
}

Json arm7_scene(const std::vector<double>& from, const Json& goal) {
  Json scene = planar_scene(goal);
  scene["robot"] = {{"file", (robots / "arm7.urdf").string()},
                    {"tip", "flange"},
                    {"spheres", (robots / "arm7.spheres.json").string()}};
  scene["start"] = {{"q", from}};
  scene["model"]["joint_limits"] = true;
  return scene;
}

log::Result run(const Json& document) {
  const test::TemporaryFolder folder;
  const auto write = [&](const char* name, const Json& json) {
    write_file_atomically(folder.path() / name, json.dump(1));
  };
  write("robot.json", description::robot_to_json(limited_planar4()));
  write("scene.json", document);
  return simulation::run(scene::read_scene(folder.path() / "scene.json"), {HAMELIN_TEST_PLUGIN_DIR},
                         {});
}

const std::vector<double> left{-0.9, -0.3, 0.0, -2.0, 0.0, 1.7, 0.0},
    right{0.9, -0.3, 0.0, -2.0, 0.0, 1.7, 0.0};

}  // namespace

TEST_CASE("mppi reaches goals of each type in free space", "[mppi]") {
  SECTION("a joint goal") {
    const auto result = run(planar_scene(joint_goal({0.9, -0.4, 0.6, 0.2})));
    CHECK(result.outcome == Outcome::reached);
    // The fastest joint needs at least 0.9 rad at 1.2 rad/s.
    CHECK(result.time_s > 0.75);
    CHECK(result.time_s < 3.0);
  }
  SECTION("a position, with and without a path") {
    Json scene = planar_scene({{"type", "position"}, {"position_m", {2.0, 2.5, 0.0}}});
    CHECK(run(scene).outcome == Outcome::reached);
    scene["planner"]["params"]["guide"] = "none";
    CHECK(run(scene).outcome == Outcome::reached);
  }
  SECTION("a pose") {
    const double half = 0.6;
    CHECK(run(planar_scene({{"type", "pose"},
                            {"position_m", {2.0, 2.2, 0.0}},
                            {"quaternion_wxyz", {std::cos(half), 0.0, 0.0, std::sin(half)}}}))
              .outcome == Outcome::reached);
  }
  SECTION("a path") {
    const auto result =
        run(planar_scene({{"type", "path"}, {"q", {{0.4, 0.0, 0.0, 0.0}, {0.4, 0.6, 0.0, 0.3}}}}));
    CHECK(result.outcome == Outcome::reached);
  }
}

TEST_CASE("mppi goes around an obstacle that blocks the straight way", "[mppi]") {
  // The straight motion sweeps the arm through the ball.
  Json scene = arm7_scene(left, joint_goal(right));
  scene["obstacles"] = Json::array({ball(0.5, 0.0, 0.2)});
  scene["obstacles"][0]["position_m"][2] = 0.6;
  for (const char* actuation : {"ideal", "sampled"}) {
    scene["actuation"] = {{"type", actuation}};
    const auto result = run(scene);
    CHECK(result.outcome == Outcome::reached);
    CHECK(result.min_clearance_m > 0.0);
  }
}

TEST_CASE("mppi evades an obstacle that moves into its way", "[mppi]") {
  Json scene = arm7_scene(left, joint_goal(right));
  Json sphere = {
      {"name", "pendulum"},
      {"type", "sphere"},
      {"radius_m", 0.12},
      {"position_m", {0.5, 0.0, 0.6}},
      {"motion", {{"type", "sine"}, {"amplitude_m", {0.0, 0.0, 0.5}}, {"period_s", 4.0}}}};
  scene["obstacles"] = Json::array({sphere});
  const auto result = run(scene);
  CHECK(result.outcome == Outcome::reached);
  CHECK(result.min_clearance_m > 0.0);
}

TEST_CASE("mppi keeps the parts of the arm apart", "[mppi]") {
  // The arm folds from one side to the other; self-collision is modelled.
  Json scene = arm7_scene({0.0, -0.4, 0.0, -2.4, -2.4, 2.2, 0.0},
                          joint_goal({0.3, 0.6, 0.0, -2.2, 2.4, 2.4, 0.5}));
  scene["model"]["self_collision"] = true;
  const auto result = run(scene);
  CHECK(result.outcome == Outcome::reached);
  REQUIRE(result.min_self_clearance_m);
  CHECK(*result.min_self_clearance_m > 0.0);
}

TEST_CASE("mppi keeps the limits of speed, acceleration and torque", "[mppi]") {
  Json scene = planar_scene(joint_goal({1.6, -1.0, 1.4, -0.8}));
  scene["safety"] = {{"type", "none"}};
  const auto result = run(scene);
  CHECK(result.outcome == Outcome::reached);
  // 1.2 rad/s is the limit of the robot, 8 rad/s² that of the planner; tracking adds little.
  CHECK(result.v_abs_max.maxCoeff() < 1.2);
  CHECK(result.a_abs_max.maxCoeff() < 8.8);
  CHECK(result.saturated_share == 0.0);
}

TEST_CASE("mppi gives up with a reason if no path is found", "[mppi]") {
  Json scene = planar_scene(joint_goal({1.2, 0.0, 0.0, 0.0}), Json::array({ball(0.6, 1.2, 0.4)}));
  scene["planner"]["guide_options"] = {{"checks_max", 2000}, {"searches_max", 2}};
  const auto result = run(scene);
  CHECK(result.outcome == Outcome::stalled);
  CHECK(result.cause.find("no way") != std::string::npos);
}

TEST_CASE("any number of threads gives the same motion", "[mppi][threads]") {
  Json scene = planar_scene(joint_goal({1.2, 0.0, 0.0, 0.0}), Json::array({ball(2.6, 1.6, 0.3)}));
  scene["duration_s"] = 1.0;
  const auto alone = run(scene);
  for (const int threads : {1, 2, 3}) {
    scene["planner"]["params"]["threads"] = threads;
    const auto result = run(scene);
    CHECK(result.time_s == alone.time_s);
    CHECK((result.q.array() == alone.q.array()).all());
    CHECK((result.v.array() == alone.v.array()).all());
    CHECK(result.min_clearance_m == alone.min_clearance_m);
  }
}

namespace {

/// A host of empty space and a planner, ticked at states that a test chooses.
class Bench : public planning::HostServices {
 public:
  explicit Bench(const Json& params)
      : model_(limited_planar4(), geometry::SE3{}, Eigen::Vector3d::Zero()), buffers_(4, 16, 6) {
    const auto plugin = planning::Plugin::load(plugin_file);
    planning::SetupData setup(model_);
    setup.control_period_s = 0.002;
    setup.influence_m = 0.15;
    setup.seed = 3;
    goal_.struct_size = sizeof goal_;
    goal_.type = HAMELIN_GOAL_JOINT;
    goal_.q = q_goal_.data();
    goal_.tolerance_rad = 0.05;
    setup.add_goal(goal_, q_goal_);
    planner_.emplace(
        plugin.create(std::move(setup), *this, planning::check_params(plugin, params)));
  }
  void log(std::int32_t, std::string_view) override {}
  std::size_t closest_points(std::span<const double>, double,
                             planning::ArrayOut<hamelin_contact>) override {
    return 0;
  }
  bool request_path() override {
    ++requests;
    return searches;
  }
  planning::LoadedPlanner& planner() { return *planner_; }
  /// Shows the goal as another one. @param path_search what is known of a path to it
  void show_goal(std::int32_t path_search) {
    goal_.path_search = path_search;
    ++goal_number_;
  }
  bool searches = false;  ///< what it answers to requests of paths
  int requests = 0;
  /// The sum of all torques of 200 ticks with exact tracking of a double integrator.
  std::vector<double> torques() {
    std::vector<double> out;
    Eigen::VectorXd q = Eigen::VectorXd::Zero(4), v = q, a = q;
    dynamics::Workspace ws(model_);
    for (std::uint64_t k = 0; k < 200; ++k) {
      hamelin_tick input{};
      input.struct_size = sizeof input;
      input.k = k;
      input.time_s = 0.002 * static_cast<double>(k);
      input.q = q.data();
      input.v = v.data();
      input.goal = &goal_;
      input.goal_number = goal_number_;
      input.speed_scale = 1.0;
      if (!planner_->tick(input, buffers_))
        throw std::runtime_error(std::string(planner_->error()));
      for (const double x : buffers_.held_torque()) out.push_back(x);
      dynamics::forward_dynamics(model_, ws, q, v, buffers_.held_torque(), a);
      v += 0.002 * a;
      q += 0.002 * v;
    }
    return out;
  }

 private:
  model::Model model_;
  planning::CommandBuffers buffers_;
  Eigen::VectorXd q_goal_ = Eigen::Vector4d(0.5, -0.3, 0.2, 0.4);
  hamelin_goal goal_{};
  std::uint64_t goal_number_ = 1;
  std::optional<planning::LoadedPlanner> planner_;
};

}  // namespace

TEST_CASE("a planner that was reset repeats its answers", "[mppi]") {
  Bench bench(Json::object());
  const auto first = bench.torques();
  CHECK(*std::max_element(first.begin(), first.end()) > 1.0);
  bench.planner().reset(Eigen::VectorXd::Zero(4), Eigen::VectorXd::Zero(4));
  CHECK(bench.torques() == first);
}

TEST_CASE("mppi asks once for a path to a goal, and waits for it", "[mppi]") {
  const auto largest = [](Bench& bench) {
    const auto torques = bench.torques();
    return std::max(std::abs(*std::max_element(torques.begin(), torques.end())),
                    std::abs(*std::min_element(torques.begin(), torques.end())));
  };
  Bench bench(Json::object());
  SECTION("a refusal sends it straight to the goal") {
    CHECK(largest(bench) > 1.0);
    CHECK(bench.requests == 1);
  }
  SECTION("it holds its posture until the goal changes") {
    bench.searches = true;
    CHECK(largest(bench) < 1e-6);
    CHECK(bench.requests == 1);
    bench.show_goal(HAMELIN_PATH_NOT_FOUND);
    CHECK(largest(bench) > 1.0);
    CHECK(bench.requests == 1);
  }
  SECTION("without a guide it does not ask") {
    Bench unguided(Json{{"guide", "none"}});
    CHECK(largest(unguided) > 1.0);
    CHECK(unguided.requests == 0);
  }
}

TEST_CASE("parameters are checked", "[mppi]") {
  const auto plugin = planning::Plugin::load(plugin_file);
  CHECK_THROWS_AS(planning::check_params(plugin, {{"samples", 20}}), Error);
  CHECK_THROWS_AS(planning::check_params(plugin, {{"guide", "maybe"}}), Error);
  CHECK_THROWS_WITH(Bench(Json{{"horizon_s", 0.3}}),
                    Catch::Contains("/horizon_s: the arm cannot brake within the horizon"));
  Bench bench(Json::object());
  auto& planner = bench.planner();
  CHECK_THROWS_WITH(planner.prepare_params(planning::check_params(plugin, {{"threads", 2}})),
                    Catch::Contains("/threads: cannot be changed while it runs, expected 0"));
  const auto slower =
      planner.prepare_params(planning::check_params(plugin, {{"cruise_speed", 0.3}}));
  const auto fast = bench.torques();
  planner.reset(Eigen::VectorXd::Zero(4), Eigen::VectorXd::Zero(4));
  planner.apply_params(slower);
  CHECK(bench.torques() != fast);
}
