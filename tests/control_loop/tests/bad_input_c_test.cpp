// The same as bad_input_test.cpp, through the interface in C.
#include <array>
#include <catch2/catch.hpp>
#include <cstddef>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "../c_loop.hpp"

using namespace hamelin;
using Catch::Contains;
using test::c_document;
using test::CLoop;

namespace {

constexpr std::array<double, 4> upright{1.0, 0.0, 0.0, 0.0};
constexpr std::array<double, 3> origin{0.0, 0.0, 0.0};

hamelin_obstacle c_ball() {
  hamelin_obstacle ball{};
  ball.struct_size = sizeof ball;
  ball.name = "ball";
  ball.shape = HAMELIN_SPHERE;
  ball.radius_m = 0.05;
  std::copy_n(std::array{0.6, 0.3, 0.9}.begin(), 3, ball.position_m);
  std::copy(upright.begin(), upright.end(), ball.quaternion_wxyz);
  return ball;
}

hamelin_observation c_observation(double time_s) {
  hamelin_observation seen{};
  seen.struct_size = sizeof seen;
  seen.time_s = time_s;
  const hamelin_obstacle ball = c_ball();
  std::copy_n(ball.position_m, 3, seen.position_m);
  std::copy(upright.begin(), upright.end(), seen.quaternion_wxyz);
  return seen;
}

struct BadCall {
  std::string message;  ///< that it must contain
  /// The call, with number, error and its size last.
  std::function<std::int32_t(hamelin_controller*, std::uint64_t*, char*, std::size_t)> make;
};

std::vector<BadCall> bad_obstacles() {
  static constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  static constexpr std::array<double, 3> nowhere{nan, 0.0, 0.0};
  return {
      {"obstacle 'crate': there is none of this name",
       [](auto* c, auto* number, char* error, std::size_t size) {
         return hamelin_controller_move_obstacle(c, "crate", origin.data(), upright.data(),
                                                 origin.data(), 0.0, number, error, size);
       }},
      {"obstacle 'crate': there is none of this name",
       [](auto* c, auto* number, char* error, std::size_t size) {
         return hamelin_controller_remove_obstacle(c, "crate", number, error, size);
       }},
      {"obstacle 'ball': its pose is not finite",
       [](auto* c, auto* number, char* error, std::size_t size) {
         return hamelin_controller_move_obstacle(c, "ball", nowhere.data(), upright.data(),
                                                 origin.data(), 0.0, number, error, size);
       }},
      {"obstacle: velocity_m_s: is null",
       [](auto* c, auto* number, char* error, std::size_t size) {
         return hamelin_controller_move_obstacle(c, "ball", origin.data(), upright.data(), nullptr,
                                                 0.0, number, error, size);
       }},
      {"obstacle 'ball': its pose is not finite",
       [](auto* c, auto* number, char* error, std::size_t size) {
         hamelin_obstacle ball = c_ball();
         ball.position_m[2] = nan;
         return hamelin_controller_set_obstacle(c, &ball, number, error, size);
       }},
      {"obstacle 'ball': its shape is unknown, expected a sphere, box, cylinder or capsule",
       [](auto* c, auto* number, char* error, std::size_t size) {
         hamelin_obstacle ball = c_ball();
         ball.shape = HAMELIN_CAPSULE + 1;
         return hamelin_controller_set_obstacle(c, &ball, number, error, size);
       }},
      {"obstacle 'ball': length_m of the capsule is 0, expected a number above 0",
       [](auto* c, auto* number, char* error, std::size_t size) {
         hamelin_obstacle ball = c_ball();
         ball.shape = HAMELIN_CAPSULE;
         return hamelin_controller_set_obstacle(c, &ball, number, error, size);
       }},
      {"quaternion_wxyz: the norm is",
       [](auto* c, auto* number, char* error, std::size_t size) {
         hamelin_obstacle ball = c_ball();
         ball.quaternion_wxyz[0] = nan;
         return hamelin_controller_set_obstacle(c, &ball, number, error, size);
       }},
  };
}

std::vector<BadCall> bad_observations() {
  static constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  static constexpr std::array<double, 3> nowhere{nan, 0.0, 0.0};
  const auto observe = [](const char* name, const hamelin_observation& seen) {
    return [name, seen](auto* c, auto* number, char* error, std::size_t size) {
      return hamelin_controller_observe_obstacle(c, name, &seen, number, error, size);
    };
  };
  hamelin_observation short_one = c_observation(3.0), unknown_velocity = c_observation(3.0),
                      no_rotation = c_observation(3.0);
  short_one.struct_size = 8;
  unknown_velocity.velocity_m_s = nowhere.data();
  no_rotation.quaternion_wxyz[0] = 0.5;
  return {
      {"observation: is null or its struct_size is too small", observe("ball", short_one)},
      {"obstacle: name: is null", observe(nullptr, c_observation(3.0))},
      {"obstacle 'crate': there is none of this name", observe("crate", c_observation(3.0))},
      {"obstacle 'ball': its time, velocity", observe("ball", c_observation(nan))},
      {"obstacle 'ball': its time, velocity", observe("ball", unknown_velocity)},
      {"quaternion_wxyz: the norm is", observe("ball", no_rotation)},
      {"obstacle 'crate': there is none of this name",
       [](auto* c, auto*, char* error, std::size_t size) {
         double time_s = 0.0;
         return hamelin_controller_last_observed(c, "crate", &time_s, error, size);
       }},
      {"obstacle 'ball': its prediction is unknown",
       [](auto* c, auto* number, char* error, std::size_t size) {
         hamelin_obstacle ball = c_ball();
         ball.prediction = HAMELIN_SPEED_BOUND + 1;
         return hamelin_controller_set_obstacle(c, &ball, number, error, size);
       }},
      {"obstacle 'ball': speed_max of the prediction of the sphere is 0, expected a number above 0",
       [](auto* c, auto* number, char* error, std::size_t size) {
         hamelin_obstacle ball = c_ball();
         ball.prediction = HAMELIN_SPEED_BOUND;
         return hamelin_controller_set_obstacle(c, &ball, number, error, size);
       }},
  };
}

std::vector<BadCall> bad_calls(const std::string& bad_map) {
  std::vector<BadCall> calls = bad_obstacles();
  for (auto& call : bad_observations()) calls.push_back(std::move(call));
  calls.push_back({bad_map, [bad_map](auto* c, auto* number, char* error, std::size_t size) {
                     return hamelin_controller_set_map(c, bad_map.c_str(), number, error, size);
                   }});
  calls.push_back(
      {"beyond a limit of joint", [](auto* c, auto* number, char* error, std::size_t size) {
         const std::vector<double> q(hamelin_controller_dof(c), 100.0);
         return hamelin_controller_set_joint_goal(c, q.data(), 0.0, number, error, size);
       }});
  calls.push_back({"time_s: is null", [](auto* c, auto* number, char* error, std::size_t size) {
                     return hamelin_controller_set_trajectory(c, nullptr, nullptr, nullptr, nullptr,
                                                              3, 0.0, number, error, size);
                   }});
  calls.push_back({"/points: 1 given, expected 2 or more",
                   [](auto* c, auto* number, char* error, std::size_t size) {
                     const double zero = 0.0;
                     const std::vector<double> q(hamelin_controller_dof(c), 0.0);
                     return hamelin_controller_set_trajectory(c, &zero, q.data(), q.data(), nullptr,
                                                              1, 0.0, number, error, size);
                   }});
  calls.push_back({"position_m: is null", [](auto* c, auto* number, char* error, std::size_t size) {
                     return hamelin_controller_set_pose_goal(c, nullptr, nullptr, 0.0, 0.0, number,
                                                             error, size);
                   }});
  calls.push_back({"unknown key 'cruise_sped'", [](auto* c, auto*, char* error, std::size_t size) {
                     return hamelin_controller_set_planner_params(c, R"({"cruise_sped": 1})", error,
                                                                  size);
                   }});
  const auto attach = [](auto* c, const hamelin_payload& payload, auto* number, char* error,
                         std::size_t size) {
    const std::vector<double> q(hamelin_controller_dof(c), 0.0);
    return hamelin_controller_attach(c, &payload, q.data(), number, error, size);
  };
  calls.push_back({"payload: is null or its struct_size is too small",
                   [=](auto* c, auto* number, char* error, std::size_t size) {
                     return attach(c, hamelin_payload{}, number, error, size);
                   }});
  calls.push_back({"payload: name: is null", [=](auto* c, auto* number, char* error, auto size) {
                     hamelin_payload payload{};
                     payload.struct_size = sizeof payload;
                     return attach(c, payload, number, error, size);
                   }});
  calls.push_back({"payload 'box': its mass is -1 kg",
                   [=](auto* c, auto* number, char* error, std::size_t size) {
                     hamelin_payload payload{};
                     payload.struct_size = sizeof payload;
                     payload.name = "box";
                     payload.mass_kg = -1.0;
                     return attach(c, payload, number, error, size);
                   }});
  calls.push_back(
      {"payload 'box': is not attached", [](auto* c, auto* number, char* error, std::size_t size) {
         const std::vector<double> q(hamelin_controller_dof(c), 0.0);
         return hamelin_controller_detach(c, "box", q.data(), number, error, size);
       }});
  calls.push_back({"params_json", [](auto* c, auto*, char* error, std::size_t size) {
                     return hamelin_controller_set_planner_params(c, "{", error, size);
                   }});
  return calls;
}

}  // namespace

TEST_CASE("in C, bad updates return one line and do not change the motion",
          "[control][bad_input]") {
  const test::TemporaryFolder folder;
  CLoop disturbed(c_document("hybrid")), undisturbed(c_document("hybrid"));
  const hamelin_obstacle ball = c_ball();
  for (CLoop* loop : {&disturbed, &undisturbed})
    REQUIRE(hamelin_controller_set_obstacle(loop->controller, &ball, nullptr, nullptr, 0) == 0);
  const std::string bad_map = (folder.path() / "no_map.bt").string();
  write_file_atomically(bad_map, "this is not a map");
  const auto calls = bad_calls(bad_map);
  for (std::size_t k = 0; k < 60 * calls.size(); ++k) {
    if (k % 50 == 25) {
      const BadCall& bad = calls[(k / 50) % calls.size()];
      std::uint64_t number = 77;
      CHECK(bad.make(disturbed.controller, &number, disturbed.error.data(),
                     disturbed.error.size()) != 0);
      const std::string message = disturbed.error.data();
      CHECK_THAT(message, Contains(bad.message));
      CHECK(message.find('\n') == std::string::npos);
      CHECK(number == 77);
    }
    disturbed.tick();
    undisturbed.tick();
    REQUIRE(std::equal(disturbed.answer.torque, disturbed.answer.torque + disturbed.v.size(),
                       undisturbed.answer.torque));
    CHECK(disturbed.answer.snapshot == 1);
    CHECK(disturbed.answer.goals == 0);
    disturbed.step();
    undisturbed.step();
  }
}

TEST_CASE("in C, obstacles have predictions, and poses of them are streamed",
          "[control][tracking]") {
  CLoop loop(c_document("reporting"),
             [](hamelin_controller_options& options) { options.observation_noise_m = 0.001; });
  hamelin_obstacle ball = c_ball();
  ball.prediction = HAMELIN_CONSTANT_VELOCITY;
  ball.speed_max_m_s = 0.5;
  const auto checked = [&](std::int32_t result) {
    INFO(loop.error.data());
    REQUIRE(result == 0);
  };
  char* const error = loop.error.data();
  const std::size_t size = loop.error.size();
  checked(hamelin_controller_set_obstacle(loop.controller, &ball, nullptr, error, size));
  double last_s = 0.0;
  checked(hamelin_controller_last_observed(loop.controller, "ball", &last_s, error, size));
  CHECK(last_s == -std::numeric_limits<double>::infinity());

  hamelin_observation seen{};
  std::uint64_t snapshot = 0;
  for (int k = 0; k < 60; ++k) {
    seen = c_observation(0.02 * k);
    seen.position_m[1] += 0.4 * seen.time_s;
    checked(hamelin_controller_observe_obstacle(loop.controller, "ball", &seen, &snapshot, error,
                                                size));
  }
  CHECK(snapshot == 61);
  checked(hamelin_controller_last_observed(loop.controller, "ball", &last_s, error, size));
  CHECK(last_s == seen.time_s);
  seen.time_s += 0.02;
  seen.position_m[1] += 0.1;
  CHECK(hamelin_controller_observe_obstacle(loop.controller, "ball", &seen, nullptr, error, size) !=
        0);
  CHECK_THAT(error, Contains("obstacle 'ball': moved 0.1 m in 0.02 s, expected at most 0.0185 m"));
  const std::array<double, 3> velocity{0.0, 0.0, 0.3};
  seen.position_m[1] -= 0.1;
  seen.velocity_m_s = velocity.data();
  checked(
      hamelin_controller_observe_obstacle(loop.controller, "ball", &seen, nullptr, error, size));
}

TEST_CASE("in C, structs of callers that were built against earlier headers are accepted",
          "[control][tracking]") {
  CLoop loop(c_document("reporting"), [](hamelin_controller_options& options) {
    options.struct_size = offsetof(hamelin_controller_options, observation_noise_m);
    options.observation_noise_m = -1.0;  // beyond its end
  });
  hamelin_obstacle ball = c_ball();
  ball.struct_size = offsetof(hamelin_obstacle, prediction);
  ball.prediction = 99;  // beyond its end
  CHECK(hamelin_controller_set_obstacle(loop.controller, &ball, nullptr, nullptr, 0) == 0);
  ball.struct_size -= 8;
  CHECK(hamelin_controller_set_obstacle(loop.controller, &ball, nullptr, nullptr, 0) != 0);
}

TEST_CASE("in C, a body is attached to the arm and detached again", "[control][load]") {
  CLoop loop(c_document("hybrid"));
  const hamelin_payload_capsule small{{0.0, 0.0, 0.0}, {0.0, 0.0, 0.0}, 0.001};
  hamelin_payload body{};
  body.struct_size = sizeof body;
  body.name = "body";
  body.mass_kg = 0.1;
  for (int i = 0; i < 3; ++i) body.inertia_kg_m2[i] = 1e-4;
  char* const error = loop.error.data();
  const std::size_t size = loop.error.size();
  std::uint64_t load = 0;
  loop.tick();
  loop.step();
  body.shapes = &small;
  body.shape_count = 1;
  CHECK(hamelin_controller_attach(loop.controller, &body, loop.state.q.data(), &load, error,
                                  size) != 0);
  CHECK_THAT(error, Contains("extends 0.001 m beyond the tip, expected at most 0 m"));
  body.shape_count = 0;
  REQUIRE(hamelin_controller_attach(loop.controller, &body, loop.state.q.data(), &load, error,
                                    size) == 0);
  loop.tick();
  CHECK(loop.answer.load == load);
  CHECK(loop.answer.refused_load == 0);
  CHECK(std::string(loop.answer.load_refusal).empty());
  loop.step();
  REQUIRE(hamelin_controller_detach(loop.controller, "body", loop.state.q.data(), &load, error,
                                    size) == 0);
  loop.tick();
  CHECK(loop.answer.load == load);
}

TEST_CASE("in C, a planner that fails leaves the arm at rest and says why",
          "[control][bad_input]") {
  const auto [how, cause] =
      GENERATE(table<std::string, std::string>({{"throw", "out of ideas"}, {"nan", "not finite"}}));
  CLoop loop(c_document("breaking", {{"at_tick", 100}, {"how", how}}));
  for (int k = 0; k < 1500; ++k) {
    loop.tick();
    CHECK((loop.answer.state == HAMELIN_CONTROL_STOPPING) == (k >= 100));
    loop.step();
  }
  CHECK_THAT(loop.answer.cause, Contains(cause));
  CHECK(loop.v.lpNorm<Eigen::Infinity>() < 1e-4);
}

TEST_CASE("in C, late answers are counted and reported once, and then the arm is brought to rest",
          "[control][bad_input]") {
  CLoop loop(c_document("reporting", {{"sleep_s", 0.002}}),
             [](hamelin_controller_options& options) { options.late_answers_max = 30; });
  for (int k = 0; k < 400; ++k) {
    loop.tick();
    CHECK(loop.answer.overruns == static_cast<std::uint64_t>(std::min(k + 1, 30)));
    CHECK(loop.answer.state == (k < 29 ? HAMELIN_CONTROL_RUNNING : HAMELIN_CONTROL_STOPPING));
    loop.step();
  }
  CHECK(loop.answer.planner_s >= 0.002);
  REQUIRE(loop.lines.size() == 1);
  CHECK(loop.lines.front().level == HAMELIN_LOG_WARNING);
  CHECK_THAT(loop.lines.front().text, Contains("expected at most its deadline of 0.001 s"));
  CHECK_THAT(loop.answer.cause, Contains("the last 30 answers were late"));
  CHECK(loop.v.lpNorm<Eigen::Infinity>() < 1e-3);
}
