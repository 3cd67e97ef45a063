// The C interface: options, structs of earlier headers, and arguments that are null.
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cstddef>
#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "../c_loop.hpp"

using namespace hamelin;
using Catch::Contains;
using Eigen::VectorXd;
using test::c_document;
using test::CLoop;
using test::creation_failure;

namespace {

using Options = hamelin_controller_options;

/// The largest change of each joint's velocity per period, of an arm that is moved by position.
VectorXd largest_accelerations(CLoop& loop, int ticks) {
  VectorXd out = VectorXd::Zero(7);
  for (int k = 0; k < ticks; ++k) {
    REQUIRE(loop.tick() == 0);
    const VectorXd v = VectorXd::Map(loop.answer.v_next, 7);
    out = out.cwiseMax((v - loop.v).cwiseAbs() / 0.001);
    loop.follow();
  }
  return out;
}

/// The same scene as text.
CLoop::Change as_text(const std::string& text, const char* folder) {
  return [&text, folder](Options& options) {
    options.scene_file = nullptr;
    options.scene_json = text.c_str();
    options.scene_folder = folder;
  };
}

}  // namespace

TEST_CASE("in C, bounds of single joints are kept", "[control][c]") {
  const std::vector<double> acceleration{15.0, 15.0, 15.0, 0.5, 15.0, 15.0, 15.0};
  CLoop usual(c_document("hybrid"), [](Options& options) { options.position = 1; });
  CLoop bounded(c_document("hybrid"), [&](Options& options) {
    options.position = 1;
    options.joint_acceleration_max = acceleration.data();
    options.joint_acceleration_max_count = acceleration.size();
  });
  CHECK(largest_accelerations(usual, 1000)[3] > 1.0);
  CHECK(largest_accelerations(bounded, 1000)[3] <= 0.5 * 1.001);
}

TEST_CASE("in C, one bound that is a list is the same as a number", "[control][c]") {
  const double bound = 2.0;
  CLoop number(c_document("hybrid"), [](Options& options) {
    options.position = 1;
    options.acceleration_max = 2.0;
    options.jerk_max = 800.0;
  });
  const double jerk = 800.0;
  CLoop list(c_document("hybrid"), [&](Options& options) {
    options.position = 1;
    options.joint_acceleration_max = &bound;
    options.joint_jerk_max = &jerk;
    options.joint_acceleration_max_count = options.joint_jerk_max_count = 1;
  });
  const VectorXd of_number = largest_accelerations(number, 500);
  CHECK(of_number.maxCoeff() <= 2.0 * 1.001);
  CHECK(largest_accelerations(list, 500) == of_number);
}

TEST_CASE("in C, bounds that are not one per joint are refused with one line", "[control][c]") {
  const std::vector<double> three(3, 1.0), wrong{1, 1, 1, -1, 1, 1, 1};
  struct List {
    const char* name;
    const double* Options::*values;
    std::size_t Options::*count;
  };
  const auto list =
      GENERATE(List{"acceleration_max", &Options::joint_acceleration_max,
                    &Options::joint_acceleration_max_count},
               List{"jerk_max", &Options::joint_jerk_max, &Options::joint_jerk_max_count},
               List{"tracking_max", &Options::tracking_max, &Options::tracking_max_count});
  CAPTURE(list.name);
  const auto refusal = [&](const double* values, std::size_t count) {
    return creation_failure(c_document("hybrid"), [&](Options& options) {
      options.position = 1;
      options.*list.values = values;
      options.*list.count = count;
    });
  };
  CHECK_THAT(refusal(three.data(), 3), Contains(list.name) && Contains("3 values given, expected"));
  CHECK_THAT(refusal(wrong.data(), 7), Contains(list.name) && Contains("-1, expected positive"));
  CHECK_THAT(refusal(three.data(), 0), Contains(list.name) && Contains("0 values given"));
  CHECK_THAT(refusal(nullptr, 7), Contains(list.name) && Contains("is null"));
  CHECK_THAT(refusal(three.data(), SIZE_MAX), Contains(list.name) && Contains("values given"));
}

TEST_CASE("in C, a bound that is given twice is refused", "[control][c]") {
  const double bound = 1.0;
  CHECK_THAT(creation_failure(c_document("hybrid"),
                              [&](Options& options) {
                                options.jerk_max = 1.0;
                                options.joint_jerk_max = &bound;
                                options.joint_jerk_max_count = 1;
                              }),
             Contains("joint_jerk_max: is given in addition to jerk_max"));
}

TEST_CASE("in C, a scene is given as text, without a file", "[control][c]") {
  Json document = c_document("hybrid");
  const bool relative = GENERATE(false, true);
  const std::string folder = (test::data_folder / "scenes").string();
  if (relative) {
    document["robot"]["file"] = "../robots/arm7.urdf";
    document["map"]["file"] = "../maps/clutter.bt";
  }
  const std::string text = document.dump();
  CLoop from_file(c_document("hybrid"));
  CLoop from_text(c_document("hybrid"), as_text(text, relative ? folder.c_str() : nullptr));
  for (int k = 0; k < 300; ++k) {
    from_file.move(1);
    from_text.move(1);
    REQUIRE(
        std::equal(from_file.answer.torque, from_file.answer.torque + 7, from_text.answer.torque));
  }
}

TEST_CASE("in C, a small scene as text is enough", "[control][c]") {
  const std::string text = R"({"schema": "hamelin.scene/1", "robot": {"file": "arm7.urdf"},
    "goals": [{"type": "joint", "q": [0.1, 0.1, 0.1, -1, 0.1, 1, 0.1]}],
    "start": {"q": [0, 0, 0, -1.2, 0, 1, 0]}, "planner": {"name": "hybrid"}})";
  const std::string folder = (test::data_folder / "robots").string();
  CHECK(creation_failure(c_document("hybrid"), as_text(text, folder.c_str())) == "made");
}

TEST_CASE("in C, texts that are not a scene are refused with one line", "[control][c]") {
  const auto refusal = [](const std::string& text) {
    return creation_failure(c_document("hybrid"), as_text(text, nullptr));
  };
  CHECK_THAT(refusal(""), Contains("scene_json: "));
  CHECK_THAT(refusal("{"), Contains("scene_json: "));
  CHECK_THAT(refusal("[]"), Contains("scene_json: "));
  Json document = c_document("hybrid");
  document["planner"] = nullptr;
  CHECK_THAT(refusal(document.dump()), Contains("scene_json: /planner"));
  document = c_document("hybrid");
  document["goals"][0]["q"] = "there";
  CHECK_THAT(refusal(document.dump()), Contains("scene_json: /goals/0/q: "));
  const std::string text = c_document("hybrid").dump();
  CHECK_THAT(creation_failure(c_document("hybrid"),
                              [&](Options& options) { options.scene_json = text.c_str(); }),
             Contains("scene_json: is given in addition to scene_file"));
  CHECK_THAT(creation_failure(c_document("hybrid"),
                              [&](Options& options) { options.scene_file = nullptr; }),
             Contains("scene_file: is null"));
}

TEST_CASE("in C, the period, the clock and the certificate are chosen", "[control][c]") {
  static double now_s = 0.0;
  CLoop loop(c_document("hybrid"), [](Options& options) {
    options.period_s = 0.002;
    options.no_certificate = 1;
    options.fixed_world = 1;
    options.clock_s = [] { return now_s += 0.25; };
  });
  CHECK(hamelin_controller_period_s(loop.controller) == 0.002);
  REQUIRE(loop.tick() == 0);
  CHECK(loop.answer.planner_s == Approx(0.25));
  CHECK(loop.answer.overruns == 1);
  loop.state.time_s += 0.002;
  REQUIRE(loop.tick() == 0);
  CHECK(loop.answer.verdict == HAMELIN_VERDICT_NONE);
  CHECK(loop.answer.certified == 1);
  for (int k = 0; k < 50; ++k) REQUIRE(loop.tick() == 0);
  CHECK(loop.answer.state == HAMELIN_CONTROL_RUNNING);  // none of them is too late
  CHECK_THAT(
      creation_failure(c_document("hybrid"), [](Options& options) { options.period_s = 3.0; }),
      Contains("period"));
  for (double Options::*number :
       {&Options::period_s, &Options::acceleration_max, &Options::observation_noise_rad,
        &Options::observation_jerk_rad_s3, &Options::payload_reach_m})
    for (const double value : {-1.0, test::not_finite})
      CHECK_THAT(creation_failure(c_document("hybrid"),
                                  [&](Options& options) { options.*number = value; }),
                 Contains("expected a positive number, or 0 for the default"));
}

TEST_CASE("in C, a path that is longer than was said is refused", "[control][c]") {
  CLoop loop(c_document("hybrid"), [](Options& options) { options.path_points_max = 3; });
  const auto set_path = [&](int points) {
    Json path = Json::array();
    for (int i = 0; i < points; ++i) {
      path.push_back(loop.scene.start_q);
      path.back()[0] = 0.01 * i;
    }
    const Json goal = {{"type", "path"}, {"q", path}};
    return hamelin_controller_set_goals(loop.controller, goal.dump().c_str(), nullptr, nullptr,
                                        loop.error.data(), loop.error.size());
  };
  loop.require(set_path(3));
  CHECK_THAT(loop.failure(set_path(4)), Contains("expected at most 3"));
}

TEST_CASE("in C, structs of earlier headers are read and written up to their end", "[control][c]") {
  CLoop loop(c_document("hybrid"), [](Options& options) {
    options.struct_size = offsetof(Options, payload_reach_m);
    options.payload_reach_m = -1.0;  // this and what follows is beyond the end
    options.scene_json = "{";
    options.joint_jerk_max_count = 99;
    options.period_s = -1.0;
  });
  for (const std::size_t size :
       {offsetof(hamelin_answer, goals), offsetof(hamelin_answer, reason)}) {
    hamelin_answer answer;
    std::memset(&answer, 0x5a, sizeof answer);
    answer.struct_size = static_cast<std::uint32_t>(size);
    REQUIRE(hamelin_controller_tick(loop.controller, loop.state.time_s, loop.state.q.data(),
                                    loop.v.data(), &answer) == 0);
    CHECK(answer.struct_size == size);
    CHECK(answer.torque != nullptr);
    const auto* bytes = reinterpret_cast<const unsigned char*>(&answer);
    CHECK(std::all_of(bytes + size, bytes + sizeof answer, [](auto x) { return x == 0x5a; }));
  }
  hamelin_answer answer{};
  for (const std::size_t size : {std::size_t{0}, offsetof(hamelin_answer, goals) - 1}) {
    answer.struct_size = static_cast<std::uint32_t>(size);
    CHECK(hamelin_controller_tick(loop.controller, loop.state.time_s, loop.state.q.data(),
                                  loop.v.data(), &answer) == 1);
  }
}

TEST_CASE("in C, structs of later headers are written as far as they are known", "[control][c]") {
  CLoop loop(c_document("hybrid"));
  struct {
    hamelin_answer known{};
    std::array<unsigned char, 16> later{};
  } out;
  out.later.fill(0x5a);
  out.known.struct_size = sizeof out;
  REQUIRE(hamelin_controller_tick(loop.controller, loop.state.time_s, loop.state.q.data(),
                                  loop.v.data(), &out.known) == 0);
  CHECK(out.known.struct_size == sizeof out);
  CHECK(std::all_of(out.later.begin(), out.later.end(), [](auto x) { return x == 0x5a; }));
}

namespace {

using NullCall = std::function<std::int32_t(hamelin_controller*, char*, std::size_t)>;

/// Calls with nothing but null, which all must fail, also with a controller.
std::vector<NullCall> null_calls() {
  return {
      [](auto* c, char* e, std::size_t n) { return hamelin_controller_stop(c, nullptr, e, n); },
      [](auto* c, char* e, std::size_t n) { return hamelin_controller_shield(c, nullptr, e, n); },
      [](auto* c, char* e, std::size_t n) { return hamelin_controller_guide(c, nullptr, e, n); },
      [](auto* c, char* e, std::size_t n) {
        return hamelin_controller_set_goals(c, nullptr, nullptr, nullptr, e, n);
      },
      [](auto* c, char* e, std::size_t n) {
        return hamelin_controller_planner_params(c, nullptr, 9, nullptr, e, n);
      },
      [](auto* c, char* e, std::size_t n) {
        return hamelin_controller_attached(c, nullptr, 9, nullptr, e, n);
      },
      [](auto* c, char* e, std::size_t n) {
        return hamelin_controller_change_map(c, nullptr, nullptr, nullptr, e, n);
      },
      [](auto* c, char* e, std::size_t n) {
        return hamelin_controller_attach(c, nullptr, nullptr, nullptr, e, n);
      },
  };
}

/// Calls that succeed with nothing but a controller.
std::vector<NullCall> calls_without_values() {
  return {
      [](auto* c, char* e, std::size_t n) { return hamelin_controller_resume(c, e, n); },
      [](auto* c, char* e, std::size_t n) { return hamelin_controller_reset(c, e, n); },
      [](auto* c, char* e, std::size_t n) { return hamelin_controller_run_guide(c, e, n); },
      [](auto* c, char* e, std::size_t n) {
        return hamelin_controller_planner_params(c, nullptr, 0, nullptr, e, n);
      },
      [](auto* c, char* e, std::size_t n) {
        return hamelin_controller_attached(c, nullptr, 0, nullptr, e, n);
      },
      [](auto* c, char* e, std::size_t n) {
        return hamelin_controller_set_map_json(c, nullptr, nullptr, nullptr, nullptr, e, n);
      },
  };
}

}  // namespace

TEST_CASE("in C, arguments that are null give one line and no crash", "[control][c]") {
  CLoop loop(c_document("hybrid"));
  char* const error = loop.error.data();
  const std::size_t size = loop.error.size();
  for (const NullCall& call : null_calls()) {
    CHECK_THAT(loop.failure(call(loop.controller, error, size)), Contains("is null"));
    CHECK(loop.failure(call(nullptr, error, size)) == "controller: is null, expected its value");
    CHECK(call(loop.controller, nullptr, 0) == 1);
    CHECK(call(loop.controller, nullptr, size) == 1);
    CHECK(call(loop.controller, error, 0) == 1);
    CHECK(error[0] == '\0');
  }
  for (const NullCall& call : calls_without_values()) {
    loop.require(call(loop.controller, error, size));
    CHECK(loop.failure(call(nullptr, error, size)) == "controller: is null, expected its value");
  }
  CHECK(hamelin_controller_create(nullptr, error, size) == nullptr);
  CHECK_THAT(loop.failure(1), Contains("options: is null"));
  CHECK(hamelin_controller_tick(nullptr, 0.0, nullptr, nullptr, nullptr) == 1);
  CHECK(hamelin_controller_tick(nullptr, 0.0, nullptr, nullptr, &loop.answer) == 1);
  CHECK(loop.answer.state == HAMELIN_CONTROL_STOPPING);
  CHECK(hamelin_controller_tick(loop.controller, 0.0, nullptr, loop.v.data(), &loop.answer) == 1);
  CHECK_THAT(loop.answer.cause, Contains("q: is null"));
  CHECK(loop.answer.torque == nullptr);
}

TEST_CASE("in C, a list of plugin folders with null entries is refused", "[control][c]") {
  const std::array<const char*, 2> folders{HAMELIN_TEST_PLUGIN_DIR, nullptr};
  CHECK_THAT(
      creation_failure(c_document("hybrid"),
                       [&](Options& options) { options.plugin_directories = folders.data(); }),
      Contains("plugin_directories: is null"));
  CHECK_THAT(creation_failure(c_document("hybrid"),
                              [&](Options& options) { options.plugin_directories = nullptr; }),
             Contains("plugin_directories: is null"));
}
