// What is wrong from outside, while an arm moves: updates that are refused must leave everything as
// it was, and a planner that fails must leave the arm at rest.
#include <catch2/catch.hpp>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "../loop.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;
using Catch::Contains;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::Loop;
using test::refusal;
using test::sampled;

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// The first half of a map's file.
std::filesystem::path truncated_map(const std::filesystem::path& folder) {
  const std::string whole = read_file(test::data_folder / "maps/clutter.bt");
  write_file_atomically(folder / "half.bt", whole.substr(0, whole.size() / 2));
  return folder / "half.bt";
}

scene::Obstacle ball_at(const Vector3d& position) {
  scene::Obstacle ball;
  ball.name = "ball";
  ball.radius_m = 0.05;
  ball.pose = {Eigen::Matrix3d::Identity(), position};
  return ball;
}

struct BadUpdate {
  std::string message;  ///< that it must contain
  std::function<void(control::Controller&)> make;
};

std::vector<BadUpdate> bad_updates(const scene::Scene& scene, const std::filesystem::path& folder) {
  const auto map_of = [scene](const std::filesystem::path& file) {
    return [scene, file](control::Controller& controller) {
      scene::MapSpec map = *scene.map;
      map.file = file;
      controller.world().set_map(map);
    };
  };
  scene::MapChangeSpec change;
  change.file = folder / "half.bt";
  return {
      {"obstacle 'bal': there is none of this name, expected one of the 1 that exist; did you mean "
       "'ball'?",
       [](auto& c) { c.world().move_obstacle("bal", {}, Vector3d::Zero(), 0.0); }},
      {"obstacle 'crate': there is none of this name",
       [](auto& c) { c.world().remove_obstacle("crate"); }},
      {"obstacle 'ball': its pose is not finite",
       [](auto& c) {
         c.world().set_obstacle(ball_at({0.0, nan, 0.0}));
       }},
      {"obstacle 'ball': its pose is not finite",
       [](auto& c) {
         c.world().move_obstacle("ball", ball_at({nan, 0.0, 0.0}).pose, Vector3d::Zero(), 0.0);
       }},
      {"obstacle 'ball': its velocity or its time is not finite",
       [](auto& c) { c.world().move_obstacle("ball", {}, Vector3d::Zero(), nan); }},
      {"half.bt", map_of(truncated_map(folder))},
      {"no_such_map.bt", map_of(folder / "no_such_map.bt")},
      {"half.bt", [change](auto& c) { c.world().change_map(change); }},
      {"goal 1: q: 3 values given, expected 7",
       [](auto& c) { c.set_goal(scene::joint_goal(VectorXd::Zero(3))); }},
      {"goal 1: pose: is not finite",
       [](auto& c) {
         c.set_goal(scene::position_goal({nan, 0.0, 0.0}));
       }},
      {"/cruise_speed: -1 is not allowed",
       [](auto& c) {
         c.set_planner_params({{"cruise_speed", -1}});
       }},
      {"unknown key 'cruise_sped'",
       [](auto& c) {
         c.set_planner_params({{"cruise_sped", 1}});
       }},
      {"/escape: cannot be changed while it runs",
       [](auto& c) {
         c.set_planner_params({{"escape", "none"}});
       }},
  };
}

}  // namespace

TEST_CASE("an arm whose world, goals and parameters get bad updates moves as if there were none",
          "[control][bad_input]") {
  const test::TemporaryFolder folder;
  const scene::Scene scene = sampled("clutter.json");
  Loop disturbed(scene), undisturbed(scene);
  for (Loop* loop : {&disturbed, &undisturbed})
    loop->controller.world().set_obstacle(ball_at({0.6, 0.3, 0.9}));
  const auto before = disturbed.controller.world().latest();
  const Json params = disturbed.controller.planner_params();
  const auto updates = bad_updates(scene, folder.path());
  for (std::size_t k = 0; k < 60 * updates.size(); ++k) {
    if (k % 50 == 25) {
      const BadUpdate& bad = updates[(k / 50) % updates.size()];
      const std::string message = refusal([&] { bad.make(disturbed.controller); });
      CHECK_THAT(message, Contains(bad.message));
      CHECK(message.find('\n') == std::string::npos);
      CHECK(disturbed.controller.world().latest() == before);
      CHECK(disturbed.controller.planner_params() == params);
    }
    const control::Answer& answer = disturbed.tick();
    REQUIRE(answer.torque == undisturbed.tick().torque);
    CHECK(answer.snapshot == 1);
    CHECK(answer.goals_number == 0);
    disturbed.step(answer.torque);
    undisturbed.step(undisturbed.controller.answer().torque);
  }
  CHECK(before->number == 1);
  CHECK((disturbed.state.q - scene.start_q).norm() > 0.5);  // it moved
}

TEST_CASE("a planner that fails leaves the arm at rest, also with masses that are wrong",
          "[control][bad_input]") {
  for (const std::string how : {"throw", "nan"})
    for (const double mass_scale : {1.0, 1.1}) {
      scene::Scene scene = sampled("clutter.json");
      scene.planner->name = "breaking";
      scene.actuation.planner_mass_scale = mass_scale;
      Loop loop(scene, {}, {{"at_tick", 100}, {"how", how}});  // until then the arm falls
      VectorXd failed_at, rested_at;
      double speed = 0.0;  // of the fastest joint when it fails
      for (int k = 0; k < 2000; ++k) {
        const control::Answer& answer = loop.tick();
        CHECK((answer.state == control::ControlState::stopping) == (k >= 100));
        if (k == 100) {
          speed = loop.v.lpNorm<Eigen::Infinity>();
          failed_at = loop.state.q;
        }
        if (k == 1000) rested_at = loop.state.q;
        loop.step(answer.torque);
      }
      CHECK(loop.v.lpNorm<Eigen::Infinity>() < 1e-4);
      CHECK(speed > 0.5);
      const double braking =
          speed * speed / (2.0 * control::ControllerOptions{}.acceleration_max.front());
      CHECK((loop.state.q - failed_at).lpNorm<Eigen::Infinity>() < braking + 0.05);
      CHECK((loop.state.q - rested_at).lpNorm<Eigen::Infinity>() < 1e-3);
    }
}

TEST_CASE("positions come to rest within their bounds if the planner fails",
          "[control][bad_input]") {
  scene::Scene scene = sampled("clutter.json");
  scene.planner->name = "breaking";
  control::Controller::Options options;
  options.position = true;
  Loop loop(scene, options, {{"at_tick", 100}, {"how", "nan"}});
  VectorXd q = scene.start_q, v = VectorXd::Zero(loop.arm.dof());
  double fastest = 0.0, acceleration = 0.0;
  for (int k = 0; k < 1500; ++k) {
    const control::Answer& answer = loop.controller.tick(0.001 * k, q, v);
    acceleration = std::max(acceleration, (answer.v_next - v).lpNorm<Eigen::Infinity>() / 0.001);
    q = answer.q_next;
    v = answer.v_next;
    fastest = std::max(fastest, v.lpNorm<Eigen::Infinity>());
  }
  CHECK(loop.controller.answer().state == control::ControlState::stopping);
  CHECK(fastest > 0.2);
  CHECK(acceleration <= options.acceleration_max.front() * (1.0 + 1e-9));
  CHECK(v.lpNorm<Eigen::Infinity>() < 1e-6);
}

TEST_CASE("late answers of a planner are counted and reported once, and used if that is allowed",
          "[control][bad_input]") {
  scene::Scene scene = sampled("clutter.json");
  scene.planner->name = "reporting";
  scene.map.reset();
  scene.actuation.deadline_s = 0.001;
  std::vector<std::string> lines;
  control::Controller::Options options;
  options.clock_s = control::steady_clock_s;
  options.late_answers_max = 0;
  options.log_overrun = GENERATE(true, false);
  options.log = [&](std::int32_t level, std::string_view line) {
    CHECK(level == HAMELIN_LOG_WARNING);
    lines.emplace_back(line);
  };
  Loop loop(scene, options, {{"sleep_s", 0.002}});
  for (int k = 0; k < 50; ++k) loop.step(loop.tick().torque);
  CHECK(loop.controller.answer().planner_s >= 0.002);
  CHECK(loop.controller.answer().overruns == 50);
  CHECK(lines.size() == (options.log_overrun ? 1U : 0U));
  if (!lines.empty()) {
    CHECK_THAT(lines.front(), Contains("planner 'reporting' took ") &&
                                  Contains("in the tick at 0 s, expected at most its deadline of "
                                           "0.001 s"));
    CHECK(lines.front().find('\n') == std::string::npos);
  }
  loop.controller.set_planner_params({{"sleep_s", 0.0}});
  control::ControlState state = control::ControlState::running;
  for (int k = 0; k < 20000 && state == control::ControlState::running; ++k) {
    state = loop.tick().state;
    loop.step(loop.controller.answer().torque);
  }
  CHECK(state == control::ControlState::reached);
  CHECK(lines.size() == (options.log_overrun ? 1U : 0U));
}

TEST_CASE("a planner that misses its deadline again and again is replaced by a brake",
          "[control][bad_input]") {
  scene::Scene scene = sampled("clutter.json");
  scene.planner->name = "reporting";
  scene.actuation.deadline_s = 0.001;
  control::Controller::Options options;
  options.clock_s = control::steady_clock_s;
  options.late_answers_max = 3;
  Loop loop(scene, options);
  for (int k = 0; k < 300; ++k) loop.step(loop.tick().torque);
  CHECK(loop.v.norm() > 0.1);
  REQUIRE(loop.controller.answer().state == control::ControlState::running);
  const std::uint64_t snapshot = loop.controller.answer().snapshot;

  loop.controller.set_planner_params({{"sleep_s", 0.002}});
  for (int k = 0; k < 1500; ++k) {
    const control::Answer& answer = loop.tick();
    CHECK((answer.state == control::ControlState::stopping) == (k >= 2));
    loop.step(answer.torque);
  }
  CHECK(loop.v.lpNorm<Eigen::Infinity>() < 1e-4);
  CHECK(loop.controller.answer().overruns >= 3);
  CHECK(loop.controller.answer().snapshot == snapshot);
  const std::string cause(loop.controller.answer().cause);
  CHECK_THAT(cause, Contains("the last 3 answers were late, expected answers within 0.001 s; the "
                             "last one took 0.00"));
  CHECK(cause.find('\n') == std::string::npos);

  loop.controller.set_planner_params({{"sleep_s", 0.0}});
  loop.controller.reset();
  CHECK(loop.tick().state == control::ControlState::running);
}

TEST_CASE("without a clock no answer is late", "[control][bad_input]") {
  scene::Scene scene = sampled("clutter.json");
  scene.planner->name = "reporting";
  scene.actuation.deadline_s = 0.001;
  Loop loop(scene, {}, {{"sleep_s", 0.002}});
  for (int k = 0; k < 20; ++k) loop.step(loop.tick().torque);
  CHECK(loop.controller.answer().state == control::ControlState::running);
  CHECK(loop.controller.answer().overruns == 0);
  CHECK(loop.controller.answer().planner_s == 0.0);
}

TEST_CASE("measurements that are not finite for a while end in rest", "[control][bad_input]") {
  const scene::Scene scene = sampled("clutter.json");
  Loop loop(scene);
  const VectorXd nowhere =
      VectorXd::Constant(loop.v.size(), std::numeric_limits<double>::quiet_NaN());
  CHECK_THROWS_WITH(loop.controller.tick(0.0, nowhere, loop.v),
                    Contains("the measured q or v is not finite"));
  for (int k = 0; k < 300; ++k) loop.step(loop.tick().torque);
  REQUIRE(loop.v.norm() > 0.1);
  const int lost = GENERATE(1, 50);
  for (int k = 0; k < 1500; ++k) {
    const bool good = k >= lost;
    const control::Answer& answer = loop.controller.tick(
        loop.state.time_s, good ? loop.state.q : nowhere, good ? loop.v : nowhere);
    CHECK(answer.state == control::ControlState::stopping);
    CHECK_THAT(std::string(answer.cause), Contains("the measured q or v is not finite"));
    REQUIRE(answer.torque.allFinite());
    loop.step(answer.torque);
  }
  CHECK(loop.v.lpNorm<Eigen::Infinity>() < 1e-4);
}
