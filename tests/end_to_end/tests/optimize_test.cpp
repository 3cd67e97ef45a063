#include <cmath>

#include "../program.hpp"
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

TEST_CASE("optimize has exit code 1 where there is no motion, and writes nothing", "[optimize]") {
  Sandbox sandbox;
  const auto none = sandbox.run({"optimize", pillar, "--duration", "0.2", "-o", "none.json"});
  CHECK(none.exit_code == 1);
  CHECK_THAT(none.out, Catch::Contains("no motion") && Catch::Contains("violated: "));
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
  CHECK_THAT(refused({"-o", pillar}), Contains(pillar));
  if (!optimal::has_ipopt())
    CHECK_THAT(refused({"--solver", "ipopt"}), Contains("coinor-libipopt-dev"));
}
