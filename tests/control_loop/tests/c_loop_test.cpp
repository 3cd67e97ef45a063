// Loops through the C interface: what is sent is what the controller in C++ sends, and an arm
// stops, resumes and takes lists of goals.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "../c_loop.hpp"

using namespace hamelin;
using Catch::Contains;
using Eigen::VectorXd;
using test::c_document;
using test::CLoop;

namespace {

void by_position(hamelin_controller_options& options) {
  options.position = 1;
}

const std::vector<std::filesystem::path>& plugin_folders() {
  static const std::vector<std::filesystem::path> folders(test::c_plugins.begin(),
                                                          test::c_plugins.end());
  return folders;
}

bool equal(const double* numbers, const VectorXd& expected) {
  return std::equal(expected.begin(), expected.end(), numbers);
}

/// Compares all of an answer with that of a controller in C++.
void check_same(const hamelin_answer& answer, control::Controller& controller) {
  const control::Answer& expected = controller.answer();
  REQUIRE(equal(answer.torque, expected.torque));
  REQUIRE(equal(answer.q_next, expected.q_next));
  REQUIRE(equal(answer.v_next, expected.v_next));
  REQUIRE(answer.state == static_cast<std::int32_t>(expected.state));
  REQUIRE(answer.goal_index == expected.goal_index);
  REQUIRE(answer.saturated == (expected.saturated ? 1 : 0));
  REQUIRE(answer.shield_stopping == (expected.stopping ? 1 : 0));
  REQUIRE(answer.clearance_m == controller.view().clearance_m());
  REQUIRE(Eigen::Vector3d(answer.tip_position_m) == controller.tip().p());
  const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(controller.tip().R());
  REQUIRE(Eigen::Vector4d(answer.tip_quaternion_wxyz) == wxyz);
  const auto& verdict = controller.verdict();
  REQUIRE((answer.verdict == HAMELIN_VERDICT_NONE) == !verdict);
  if (!verdict) return;
  REQUIRE(answer.margin_m == verdict->margin_m);
  REQUIRE((answer.verdict == HAMELIN_VERDICT_CERTIFIED) == verdict->certified);
}

}  // namespace

TEST_CASE("in C, torques and positions are those of the controller in C++", "[control][c]") {
  const bool position = GENERATE(false, true);
  CAPTURE(position);
  CLoop loop(c_document("hybrid"), position ? by_position : CLoop::Change());
  control::Controller::Options options;
  options.position = position;
  control::Controller controller(loop.scene, plugin_folders(), options);
  for (int k = 0; k < 1500; ++k) {
    REQUIRE(loop.tick() == 0);
    (void)controller.tick(loop.state.time_s, loop.state.q, loop.v);
    check_same(loop.answer, controller);
    position ? loop.follow() : loop.step();
  }
  CHECK((loop.state.q - loop.scene.start_q).norm() > 0.1);
}

TEST_CASE("in C, an arm reaches its goals by torque", "[control][c]") {
  CLoop loop(c_document("hybrid"));
  CHECK(loop.arrives());
  CHECK(loop.answer.goal_index == 2);
  CHECK((loop.state.q - loop.scene.goals.back().q).lpNorm<Eigen::Infinity>() < 0.1);
}

TEST_CASE("in C, an arm reaches its goals by positions that are one motion within its bounds",
          "[control][c]") {
  CLoop loop(c_document("hybrid"), by_position);
  const double T = hamelin_controller_period_s(loop.controller);
  bool reached = false;
  double fastest = 0.0;
  for (int k = 0; k < 20000 && !reached; ++k) {
    REQUIRE(loop.tick() == 0);
    REQUIRE(loop.answer.clearance_m > 0.0);
    const VectorXd q = VectorXd::Map(loop.answer.q_next, 7),
                   v = VectorXd::Map(loop.answer.v_next, 7);
    REQUIRE((v - loop.v).lpNorm<Eigen::Infinity>() <= 15.0 * T * 1.001);
    // of a motion whose velocity stays between those of its ends, but for the jerk in between
    const VectorXd mean = 0.5 * (v + loop.v);
    REQUIRE((q - loop.state.q - T * mean).lpNorm<Eigen::Infinity>() <= 15.0 * T * T);
    fastest = std::max(fastest, v.lpNorm<Eigen::Infinity>());
    reached = loop.answer.state == HAMELIN_CONTROL_REACHED;
    loop.follow();
  }
  CHECK(reached);
  CHECK(fastest > 0.3);
  CHECK((loop.state.q - loop.scene.goals.back().q).lpNorm<Eigen::Infinity>() < 0.1);
}

TEST_CASE("in C, an arm stops on request, says why, and resumes to its goals", "[control][c]") {
  const bool position = GENERATE(false, true);
  CAPTURE(position);
  CLoop loop(c_document("hybrid"), position ? by_position : CLoop::Change());
  char* const error = loop.error.data();
  const std::size_t size = loop.error.size();
  const auto move = [&](int ticks) {
    for (int k = 0; k < ticks; ++k) {
      REQUIRE(loop.tick() == 0);
      position ? loop.follow() : loop.step();
    }
  };
  move(500);
  CHECK(loop.answer.reason == HAMELIN_STOP_NONE);
  CHECK(std::string(loop.answer.cause).empty());
  REQUIRE(loop.v.norm() > 0.1);
  loop.require(hamelin_controller_resume(loop.controller, error, size));  // without effect
  std::thread([&] {
    loop.require(hamelin_controller_stop(loop.controller, "the door\nis open", error, size));
  }).join();
  move(1);
  CHECK(loop.answer.state == HAMELIN_CONTROL_STOPPING);
  CHECK(loop.answer.reason == HAMELIN_STOP_REQUEST);
  const std::string cause = loop.answer.cause;
  CHECK(cause == one_line("the door\nis open"));
  move(1500);
  CHECK(loop.v.lpNorm<Eigen::Infinity>() < 1e-3);
  CHECK(loop.answer.cause == cause);
  loop.require(hamelin_controller_resume(loop.controller, error, size));
  move(1);
  CHECK(loop.answer.state == HAMELIN_CONTROL_RUNNING);
  CHECK(loop.answer.reason == HAMELIN_STOP_NONE);
  CHECK(std::string(loop.answer.cause).empty());
  CHECK(loop.arrives(position));
}

TEST_CASE("in C, a long cause of a stop is cut", "[control][c]") {
  CLoop loop(c_document("hybrid"));
  loop.move(10);
  const std::string cause(2000, 'x');
  loop.require(hamelin_controller_stop(loop.controller, cause.c_str(), nullptr, 0));
  loop.move(1);
  CHECK(std::string(loop.answer.cause) == cause.substr(0, 511));
}

TEST_CASE("in C, an arm that servos cannot move is stopped, beyond the bound that was set",
          "[control][c]") {
  const std::vector<double> bound{0.03};
  CLoop loop(c_document("hybrid"), [&](hamelin_controller_options& options) {
    options.position = 1;
    options.tracking_max = bound.data();
    options.tracking_max_count = bound.size();
  });
  double farthest = 0.0;
  for (int k = 0; k < 20000 && loop.answer.state != HAMELIN_CONTROL_STOPPING; ++k) {
    REQUIRE(loop.tick() == 0);
    const VectorXd set_point = VectorXd::Map(loop.answer.q_next, 7);
    farthest = (set_point - loop.state.q).lpNorm<Eigen::Infinity>();
    loop.state.time_s = 0.001 * (k + 1);  // the brake is on
  }
  CHECK(loop.answer.reason == HAMELIN_STOP_TRACKING);
  CHECK_THAT(loop.answer.cause, Contains("expected at most 0.03 (tracking_max)"));
  CHECK(farthest < 0.05);
}

TEST_CASE("in C, an arm without measurements stops for that reason", "[control][c]") {
  CLoop loop(c_document("hybrid"));
  loop.move(100);
  const std::vector<double> nowhere(7, test::not_finite);
  REQUIRE(hamelin_controller_tick(loop.controller, loop.state.time_s, nowhere.data(), loop.v.data(),
                                  &loop.answer) == 0);
  CHECK(loop.answer.reason == HAMELIN_STOP_MEASUREMENT);
  CHECK_FALSE(std::string(loop.answer.cause).empty());
}

TEST_CASE("in C, torques stay finite where a measurement is lost after an absurd velocity",
          "[control][c]") {
  CLoop loop(c_document("hybrid"));
  loop.move(10);
  const std::vector<double> absurd(7, 1e6), nowhere(7, test::not_finite);
  for (int k = 0; k < 50; ++k) {
    loop.state.time_s += 0.001;
    REQUIRE(hamelin_controller_tick(loop.controller, loop.state.time_s,
                                    k == 0 ? loop.state.q.data() : nowhere.data(), absurd.data(),
                                    &loop.answer) == 0);
    REQUIRE(VectorXd::Map(loop.answer.torque, 7).allFinite());
  }
  CHECK(loop.answer.reason == HAMELIN_STOP_MEASUREMENT);
}

TEST_CASE("in C, a list of goals replaces others, and the goals are reached in order",
          "[control][c]") {
  CLoop loop(c_document("hybrid"), by_position);
  const Json near = {{"type", "joint"}, {"q", {0.1, -0.7, 0.1, -2.2, 0.0, 1.6, 0.8}}};
  const Json start = {{"type", "joint"}, {"q", loop.scene.start_q}};
  char* const error = loop.error.data();
  const std::size_t size = loop.error.size();
  std::uint64_t number = 0;
  loop.require(hamelin_controller_set_goals(
      loop.controller, Json::array({near, start}).dump().c_str(), nullptr, &number, error, size));
  CHECK(number == 1);
  std::vector<std::size_t> seen;
  for (int k = 0; k < 20000 && loop.answer.state != HAMELIN_CONTROL_REACHED; ++k) {
    REQUIRE(loop.tick() == 0);
    CHECK(loop.answer.goals == number);
    if (seen.empty() || seen.back() != loop.answer.goal_index)
      seen.push_back(loop.answer.goal_index);
    loop.follow();
  }
  CHECK(seen == std::vector<std::size_t>{0, 1, 2});
  CHECK((loop.state.q - loop.scene.start_q).lpNorm<Eigen::Infinity>() < 0.1);

  loop.require(hamelin_controller_set_goals(loop.controller, near.dump().c_str(), nullptr, &number,
                                            error, size));
  CHECK(number == 2);
  CHECK(loop.arrives(true));
  CHECK(loop.answer.goals == 2);
}

TEST_CASE("in C, an answer says whether its goal may touch something", "[control][c][touch]") {
  CLoop loop(c_document("hybrid"), by_position);
  Json near = {{"type", "joint"}, {"q", loop.scene.start_q}};
  near["q"][0] = 0.1;
  const auto set_goal = [&] {
    std::uint64_t number = 0;
    return hamelin_controller_set_goals(loop.controller, near.dump().c_str(), nullptr, &number,
                                        loop.error.data(), loop.error.size());
  };
  loop.move(1);
  CHECK(loop.answer.may_touch == 0);
  near["may_touch"] = {{"boxes_m", {{0.6, 0.3, 0.2, 0.8, 0.5, 0.4}}}};
  loop.require(set_goal());
  loop.move(1);
  CHECK(loop.answer.may_touch == 1);
  near["may_touch"] = {{"obstacles", {"nothing"}}};
  CHECK_THAT(loop.failure(set_goal()),
             Contains("goal 1: may_touch: obstacle 'nothing': there is none of this name"));
  loop.move(1);
  CHECK(loop.answer.may_touch == 1);
}

TEST_CASE("in C, files that goals name are searched for in a folder", "[control][c]") {
  CLoop loop(c_document("hybrid"));
  const test::TemporaryFolder other;
  const Json points = Json::array({{{"time_s", 0.0}, {"position_m", {0.5, 0.0, 0.6}}},
                                   {{"time_s", 2.0}, {"position_m", {0.5, 0.2, 0.6}}}});
  write_file_atomically(other.path() / "way.json", points.dump());
  const char* const goal =
      R"({"type": "follow", "motion": {"type": "waypoints", "file": "way.json"}})";
  std::uint64_t number = 0;
  const std::string missing = loop.failure(hamelin_controller_set_goals(
      loop.controller, goal, nullptr, &number, loop.error.data(), loop.error.size()));
  CHECK_THAT(missing, Contains((loop.folder.path() / "way.json").string()));
  CHECK(number == 0);
  loop.require(hamelin_controller_set_goals(loop.controller, goal, other.path().string().c_str(),
                                            &number, loop.error.data(), loop.error.size()));
  loop.move(1);
  CHECK(loop.answer.goals == 1);
  CHECK(loop.answer.target == HAMELIN_TARGET_FOLLOWED);
  CHECK(Eigen::Vector3d(loop.answer.target_position_m).isApprox(Eigen::Vector3d(0.5, 0.0, 0.6)));
}

TEST_CASE("in C, goals that are not valid are refused with their place", "[control][c]") {
  CLoop loop(c_document("hybrid"));
  const auto refusal = [&](const char* goals) {
    return loop.failure(hamelin_controller_set_goals(loop.controller, goals, nullptr, nullptr,
                                                     loop.error.data(), loop.error.size()));
  };
  CHECK_THAT(refusal("["), Contains("goals_json: "));
  CHECK_THAT(refusal("3"), Contains("goals: /goals"));
  CHECK_THAT(refusal("[]"), Contains("goal"));
  CHECK_THAT(refusal(R"([{"type": "joint", "q": "here"}])"), Contains("goals: /goals/0/q: "));
  CHECK_THAT(refusal(R"([{"type": "joint", "q": [0, 0]}])"),
             Contains("2 values given, expected 7"));
  CHECK_THAT(refusal(R"({"type": "join"})"), Contains("goals: /goals/0"));
}

TEST_CASE("in C, the reference of a trajectory is in the answer", "[control][c]") {
  CLoop loop(c_document("hybrid"), by_position);
  loop.move(1);
  CHECK(loop.answer.reference_q == nullptr);
  const std::array<double, 2> times{0.0, 2.0};
  VectorXd q(14), v = VectorXd::Zero(14);
  q << loop.state.q, loop.state.q;
  q[7] += 0.2;
  loop.require(hamelin_controller_set_trajectory(loop.controller, times.data(), q.data(), v.data(),
                                                 nullptr, 2, 0.0, nullptr, loop.error.data(),
                                                 loop.error.size()));
  loop.state = loop.integrator->start(loop.scene.start_q, VectorXd::Zero(7));
  loop.v.setZero();
  loop.require(hamelin_controller_reset(loop.controller, loop.error.data(), loop.error.size()));
  for (int k = 0; k < 1001; ++k) {
    REQUIRE(loop.tick() == 0);
    loop.follow();
  }
  REQUIRE(loop.answer.reference_q != nullptr);
  CHECK(loop.answer.reference_q[0] == Approx(0.1).margin(0.005));
  CHECK(loop.answer.reference_v[0] == Approx(0.15).margin(0.005));
}

TEST_CASE("in C, a planner's own figures have names and values", "[control][c]") {
  CLoop loop(c_document("reporting", {{"gain", 3.0}}));
  loop.move(1);
  REQUIRE(loop.answer.series_count == 6);
  double gain = 0.0;
  for (std::size_t i = 0; i < loop.answer.series_count; ++i)
    if (std::string(hamelin_controller_series_name(loop.controller, i)) == "gain")
      gain = loop.answer.series[i];
  CHECK(gain == 3.0);
  CHECK(hamelin_controller_series_name(loop.controller, 6) == nullptr);
  CHECK(hamelin_controller_series_name(nullptr, 0) == nullptr);
}
