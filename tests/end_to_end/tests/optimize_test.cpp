#include <cmath>

#include "../program.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/optimal/solve.hpp"

using namespace hamelin;
using test::Sandbox;

namespace {

const std::string pillar = "data/scenes/pillar.json";

}  // namespace

TEST_CASE("optimize writes a trajectory that validates, and exports", "[optimize]") {
  Sandbox sandbox;
  const auto text = sandbox.run({"optimize", pillar, "-o", "calm.json"});
  CHECK(text.exit_code == 0);
  CHECK(text.err == "");
  CHECK_THAT(text.out, Catch::StartsWith("goal 1      ") && Catch::Contains("proved to keep"));
  CHECK(sandbox.run({"validate", "calm.json"}).exit_code == 0);
  const Json file = sandbox.json("calm.json"), scene = sandbox.json(pillar);
  CHECK(file["points"].size() == 51);
  const Json begin = file["points"][0], end = file["points"].back();
  for (std::size_t j = 0; j < 7; ++j) {
    CHECK(begin["q"][j].get<double>() ==
          Approx(scene["start"]["q"][j].get<double>()).margin(1e-12));
    CHECK(end["q"][j].get<double>() ==
          Approx(scene["goals"][0]["q"][j].get<double>()).margin(1e-12));
    CHECK(std::abs(end["v"][j].get<double>()) < 1e-10);
  }
  CHECK(file["goals"][0]["certified"] == true);
  CHECK(test::run_json(sandbox, {"optimize", pillar}) == file);

  const auto csv = sandbox.run({"optimize", pillar, "--minimize", "time", "--rate", "100",
                                "--format", "csv", "-o", "f.csv"});
  CHECK(csv.exit_code == 0);
  CHECK_THAT(sandbox.text("f.csv"), Catch::StartsWith("time_s,q_"));
  CHECK(sandbox.run({"optimize", pillar, "--format", "ros", "-o", "f.json"}).exit_code == 0);
  CHECK(sandbox.json("f.json")["joint_names"].size() == 7);
}

TEST_CASE("an optimised motion is run in time, logged, replayed and reported", "[optimize]") {
  Sandbox sandbox;
  REQUIRE(sandbox
              .run({"optimize", pillar, "--limit-share", "0.8", "--acceleration", "10", "--margin",
                    "0.008", "-o", "calm.json"})
              .exit_code == 0);
  const auto run = sandbox.run({"run", pillar, "--trajectory", "calm.json", "--log", "run.jsonl",
                                "--result", "result.json"});
  CHECK(run.exit_code == 0);
  CHECK_THAT(run.out, Catch::Contains("trajectory  ") && Catch::Contains("s long, took"));
  const Json result = sandbox.json("result.json"), file = sandbox.json("calm.json");
  CHECK(file["goals"][0]["margin_m"].get<double>() >= 0.008);
  const Json& followed = result["trajectory"];
  CHECK(followed["duration_s"] == file["points"].back()["time_s"]);
  CHECK(followed["time_s"].get<double>() < followed["duration_s"].get<double>() + 0.01);
  CHECK(followed["error_max"].get<double>() < 0.03);
  CHECK(result["goal"]["type"] == "trajectory");
  CHECK(sandbox.run({"validate", "result.json"}).exit_code == 0);
  CHECK(sandbox.run({"validate", "run.jsonl"}).exit_code == 0);
  // the log has the motion, so a replay needs no file
  std::filesystem::remove(sandbox.path("calm.json"));
  CHECK(sandbox.run({"replay", "run.jsonl"}).exit_code == 0);
  CHECK(sandbox.run({"report", "run.jsonl", "-o", "run.html"}).exit_code == 0);
}

TEST_CASE("trajectories that do not fit are refused in one line", "[optimize]") {
  Sandbox sandbox;
  write_file_atomically(sandbox.path("motion.json"),
                        R"({"schema": "hamelin.trajectory/1", "joints": ["a"], "points": [
                    {"time_s": 0, "q": [0], "v": [0]}, {"time_s": 1, "q": [1], "v": [0]}]})");
  const auto other = sandbox.run({"run", pillar, "--trajectory", "motion.json"});
  CHECK(other.exit_code == 2);
  CHECK_THAT(other.err, Catch::Contains("/goals/0: 1 joints, expected 7 (those of '"));
  CHECK(std::count(other.err.begin(), other.err.end(), '\n') == 1);
  CHECK(sandbox.run({"run", pillar, "--trajectory", "none.json"}).exit_code == 2);
}

TEST_CASE("optimize has exit code 1 where there is no motion, and writes nothing", "[optimize]") {
  Sandbox sandbox;
  const auto none = sandbox.run({"optimize", pillar, "--duration", "0.2", "-o", "none.json"});
  CHECK(none.exit_code == 1);
  CHECK_THAT(none.out, Catch::Contains("no motion") && Catch::Contains("violated: "));
  CHECK_FALSE(std::filesystem::exists(sandbox.path("none.json")));
}

TEST_CASE("the least time to a goal at the start is the least duration", "[optimize]") {
  Sandbox sandbox;
  const auto found = sandbox.run({"optimize", pillar, "--minimize", "time", "--set",
                                  "/goals/0/q=[-0.8,0.6,0.0,-1.6,0.0,2.0,0.0]", "--format", "ros",
                                  "-o", "f.json"});
  CHECK(found.exit_code == 0);
  const Json points = sandbox.json("f.json")["points"];
  const auto time_s = [](const Json& point) {
    const Json& time = point["time_from_start"];
    return time["sec"].get<double>() + 1e-9 * time["nanosec"].get<double>();
  };
  for (std::size_t k = 1; k < points.size(); ++k) CHECK(time_s(points[k]) > time_s(points[k - 1]));
  CHECK(time_s(points.back()) == Approx(optimal::least_duration_s).epsilon(1e-3));
}

TEST_CASE("optimize has exit code 1 where the margin is not proved", "[optimize]") {
  Sandbox sandbox;
  const std::string ball =
      R"({"name": "ball", "type": "sphere", "radius_m": 0.4, "position_m": [0.45, 1.4, 0.45],
          "motion": {"type": "linear", "velocity_m_s": [0, -1, 0]}})";
  Json scene = sandbox.json(pillar);
  scene["obstacles"].push_back(Json::parse(ball));
  for (const char* key : {"file", "spheres"})
    scene["robot"][key] =
        "data/robots/" +
        std::filesystem::path(scene["robot"][key].get<std::string>()).filename().string();
  write_file_atomically(sandbox.path("scene.json"), scene.dump());
  const auto found = sandbox.run({"optimize", "scene.json", "-o", "none.json"});
  CHECK(found.exit_code == 1);
  CHECK_THAT(found.out, Catch::Contains("no motion") && Catch::Contains("violated: clearance") &&
                            Catch::Contains("expected the margin 0.005 m"));
  CHECK_FALSE(std::filesystem::exists(sandbox.path("none.json")));
}

TEST_CASE("optimize refuses bad input in one line", "[optimize]") {
  Sandbox sandbox;
  const auto refused = [&](std::vector<std::string> more) {
    std::vector<std::string> command{"optimize", pillar};
    command.insert(command.end(), more.begin(), more.end());
    const auto result = sandbox.run(command);
    CHECK(result.exit_code == 2);
    CHECK(std::count(result.err.begin(), result.err.end(), '\n') == 1);
    return result.err;
  };
  using Catch::Contains;
  CHECK_THAT(refused({"--intervals", "3"}), Contains("--intervals"));
  CHECK_THAT(refused({"--duration", "-1"}), Contains("--duration"));
  CHECK_THAT(refused({"--set", "/goals/0/q/3=2"}), Contains("joint 4") || Contains("joint4"));
  CHECK_THAT(refused({"--set", "/model/friction=0.1"}), Contains("damping or friction"));
  CHECK_THAT(refused({"--set", "/obstacles/0/position_m=[0.38,-0.4,0.3]"}),
             Contains("start: the clearance is"));
  CHECK_THAT(refused({"--margin", "0.01"}),
             Contains("start: the clearance is 0.00902") && Contains("the margin 0.01 m"));
  CHECK_THAT(refused({"-o", pillar}), Contains(pillar));
  CHECK_THAT(refused({"--solver", "ipopt"}), Contains("--solver"));
}
