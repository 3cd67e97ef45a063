#include "hamelin/scene/joint_trajectory.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "hamelin/io/file.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/scene_data.hpp"
#include "hamelin/test/temporary.hpp"

namespace {

using namespace hamelin;
using Eigen::Index;
using Eigen::VectorXd;
using scene::JointTrajectory;

// Polynomials of some degree in time, whose values are known exactly.
struct Polynomials {
  int degree;
  double value(Index joint, double t, int derivative) const {
    double sum = 0.0;
    for (int k = derivative; k <= degree; ++k) {
      double factor = 0.3 + 0.1 * static_cast<double>(joint) - 0.07 * k * k;
      for (int d = 0; d < derivative; ++d) factor *= k - d;
      sum += factor * std::pow(t, k - derivative);
    }
    return sum;
  }
  JointTrajectory sampled(bool accelerations) const {
    JointTrajectory out;
    out.joints = {"first", "second"};
    out.time_s = VectorXd::Zero(4);
    out.time_s << 0.0, 0.3, 0.35, 1.1;
    out.q.resize(2, 4);
    out.v.resize(2, 4);
    if (accelerations) out.a.resize(2, 4);
    for (Index i = 0; i < 4; ++i)
      for (Index j = 0; j < 2; ++j) {
        out.q(j, i) = value(j, out.time_s[i], 0);
        out.v(j, i) = value(j, out.time_s[i], 1);
        if (accelerations) out.a(j, i) = value(j, out.time_s[i], 2);
      }
    return out;
  }
};

Json file_of_two_points() {
  return Json::parse(R"({"schema": "hamelin.trajectory/1", "joints": ["a", "b"], "points": [
    {"time_s": 0, "q": [0, 1], "v": [0, 0], "a": [0, 0], "tau": [1, 2]},
    {"time_s": 0.5, "q": [0.1, 1.2], "v": [0.25, 0], "a": [0, 0.5], "tau": [1, 2]}]})");
}

std::string refusal_of(const Json& document) {
  return test::error_of([&] { (void)scene::joint_trajectory_from_json(document, "file"); });
}

}  // namespace

TEST_CASE("a trajectory between its points is the polynomial that they determine",
          "[scene][trajectory]") {
  for (const bool accelerations : {true, false}) {
    const Polynomials motion{accelerations ? 5 : 3};
    const JointTrajectory trajectory = motion.sampled(accelerations);
    VectorXd q(2), v(2), a(2);
    Index point = 0;
    for (double t = 0.0; t <= 1.1; t += 0.01) {
      point = trajectory.at(t, q, v, a, point);
      CHECK(trajectory.time_s[point] <= t);
      for (Index j = 0; j < 2; ++j) {
        CHECK(q[j] == Approx(motion.value(j, t, 0)).margin(1e-12));
        CHECK(v[j] == Approx(motion.value(j, t, 1)).margin(1e-12));
        CHECK(a[j] == Approx(motion.value(j, t, 2)).margin(1e-10));
      }
    }
  }
}

TEST_CASE("times before a trajectory and after it are clamped", "[scene][trajectory]") {
  const JointTrajectory trajectory = Polynomials{5}.sampled(true);
  VectorXd q(2), v(2), a(2);
  CHECK(trajectory.at(-1.0, q, v, a) == 0);
  CHECK(q == trajectory.q.col(0));
  CHECK(v.isApprox(trajectory.v.col(0), 1e-14));
  CHECK(trajectory.at(7.0, q, v, a, 1) == 2);
  CHECK(q.isApprox(trajectory.q.col(3), 1e-14));
  CHECK(v.isApprox(trajectory.v.col(3), 1e-13));
}

TEST_CASE("a trajectory file is read, and written as it was", "[scene][trajectory]") {
  const JointTrajectory read = scene::joint_trajectory_from_json(file_of_two_points(), "file");
  CHECK(read.joints == std::vector<std::string>{"a", "b"});
  CHECK(read.duration_s() == 0.5);
  CHECK(read.q(1, 1) == 1.2);
  CHECK(read.a(1, 1) == 0.5);
  Json written = scene::to_json(read), expected = file_of_two_points();
  for (auto& point : expected["points"]) point.erase("tau");
  CHECK(written == expected);
}

TEST_CASE("a trajectory of ROS 2 is read", "[scene][trajectory]") {
  const Json message = Json::parse(R"({"header": {"frame_id": ""}, "joint_names": ["a", "b"],
    "points": [
      {"positions": [0, 1], "velocities": [0, 0], "accelerations": [], "effort": [],
       "time_from_start": {"sec": 0, "nanosec": 0}},
      {"positions": [0.1, 1.2], "velocities": [0.25, 0], "accelerations": [], "effort": [],
       "time_from_start": {"sec": 1, "nanosec": 250000000}}]})");
  const JointTrajectory read = scene::joint_trajectory_from_json(message, "file");
  CHECK(read.time_s[1] == 1.25);
  CHECK(read.v(0, 1) == 0.25);
  CHECK(read.a.size() == 0);
  Json wrong = message;
  wrong["points"][1].erase("velocities");
  CHECK(refusal_of(wrong) == "file: /points/1/velocities: is missing, expected a list");
  wrong = message;
  wrong["points"][1]["time_from_start"].erase("nanosec");
  CHECK(refusal_of(wrong) ==
        "file: /points/1/time_from_start/nanosec: is missing, expected a number");
  wrong = message;
  wrong["points"] = 3;
  CHECK(refusal_of(wrong) == "file: /points: is wrong, expected a list");
  wrong = message;
  wrong["points"][0] = 3;
  CHECK(refusal_of(wrong) == "file: /points/0/time_from_start: is missing, expected an object");
}

TEST_CASE("wrong trajectories are refused in one line", "[scene][trajectory]") {
  const auto changed = [](const std::string& assignment) {
    Json document = file_of_two_points();
    const auto equals = assignment.find('=');
    document[Json::json_pointer(assignment.substr(0, equals))] =
        Json::parse(assignment.substr(equals + 1));
    return refusal_of(document);
  };
  CHECK(changed("/points/0/time_s=0.1") == "file: /points/0/time_s: is 0.1, expected 0");
  CHECK(changed("/points/1/time_s=0") ==
        "file: /points/1/time_s: 0 is not after the time before it, 0, expected times that "
        "increase");
  CHECK(changed("/points/1/q=[1]") ==
        "file: /points/1/q: 1 values given, expected 2 (one per joint of the trajectory)");
  CHECK_THAT(changed("/points/1/v=[1,null]"), Catch::Contains("/points/1/v/1"));
  CHECK(changed("/joints=[]") == "no error");
  CHECK_THAT(changed("/joints=[\"a\"]"),
             Catch::Contains("/points/0/q: 2 values given, expected 1"));
  Json document = file_of_two_points();
  document["points"][1].erase("a");
  CHECK(refusal_of(document) ==
        "file: /points/1/a: is missing, expected accelerations as at the first point");
  JointTrajectory infinite = scene::joint_trajectory_from_json(file_of_two_points(), "file");
  infinite.q(0, 1) = std::numeric_limits<double>::infinity();
  CHECK(test::error_of([&] { (void)scene::trajectory_goal(infinite); }) ==
        "trajectory: /points/1: is not finite, expected finite numbers");
}

TEST_CASE("a goal of type trajectory has a file or the motion itself", "[scene][trajectory]") {
  const test::TemporaryFolder folder;
  write_file_atomically(folder.path() / "motion.json", file_of_two_points().dump());
  Json document = Json::parse(R"({"schema": "hamelin.scene/1", "robot": {"file": "r.urdf"},
    "goals": [{"type": "trajectory", "file": "motion.json", "tolerance_rad": 0.01}]})");
  const auto read = [&] { return scene::scene_from_json(document, folder.path(), "scene"); };
  const scene::Scene from_file = read();
  const scene::Goal& goal = from_file.goals.at(0);
  CHECK(scene::type_name(goal) == "trajectory");
  CHECK(goal.type == scene::GoalType::joint);
  CHECK(goal.q == Eigen::Vector2d(0.1, 1.2));
  CHECK(goal.path.cols() == 2);
  CHECK(goal.tolerance_rad == 0.01);
  CHECK(scene::input_files(from_file).back() == folder.path() / "motion.json");

  document["goals"] = scene::resolved_json(from_file)["goals"];
  CHECK_FALSE(document["goals"][0].contains("file"));
  CHECK(scene::to_json(*read().goals.at(0).trajectory) == scene::to_json(*goal.trajectory));

  document["goals"][0]["file"] = "motion.json";
  CHECK(test::error_of(read) ==
        "scene: /goals/0/trajectory: is not allowed for a trajectory goal with a file");
  document["goals"][0] = {{"type", "trajectory"}};
  CHECK(test::error_of(read) ==
        "scene: /goals/0/trajectory: is missing, expected for a trajectory goal without a file");
  document["goals"][0] = {{"type", "trajectory"}, {"file", "motion.json"}, {"q", {0, 0}}};
  CHECK(test::error_of(read) == "scene: /goals/0/q: is not allowed for a trajectory goal");
}
