#include "hamelin/sweep/ablation.hpp"

#include <catch2/catch.hpp>
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/core/error.hpp"

using namespace hamelin;
using namespace hamelin::sweep;

namespace {

const std::vector<std::filesystem::path> plugin_directories{HAMELIN_TEST_PLUGIN_DIR};

Ablation made(const std::string& planner, const std::string& part) {
  return make_ablation(planner, part, plugin_directories);
}

}  // namespace

TEST_CASE("a boolean is negated, a number becomes 0, and others get their value", "[sweep][unit]") {
  const Ablation number = made("hybrid", "repulsion_speed_m_s");
  CHECK(number.planner == "hybrid");
  CHECK(number.without == "hybrid:repulsion_speed_m_s=0");
  CHECK(number.value == 0);
  CHECK(part_of(number) == "repulsion_speed_m_s=0");
  CHECK(made("apf", "gravity_compensation").without == "apf:gravity_compensation=false");
  // the value as given is negated, replaced, or kept beside the part
  CHECK(made("apf:gravity_compensation=false", "gravity_compensation").without ==
        "apf:gravity_compensation=true");
  CHECK(
      made("hybrid+rrt-connect:repulsion_speed_m_s=3,escape=none", "repulsion_speed_m_s").without ==
      "hybrid+rrt-connect:escape=none,repulsion_speed_m_s=0");
  const Ablation named = made("hybrid", "escape=none");
  CHECK(named.without == "hybrid:escape=none");
  CHECK(named.value == "none");
  CHECK(made("hybrid", "k_p=4").without == "hybrid:k_p=4");
}

TEST_CASE("parts that a planner does not have, or not as asked, are refused", "[sweep][unit]") {
  CHECK_THROWS_WITH(made("apf", "steering"),
                    "--ablate steering: planner 'apf' has no parameter 'steering', expected one of "
                    "algorithm=VALUE, eta, k_p, k_v, joint_damping, mapping=VALUE, law=VALUE, "
                    "gravity_compensation");
  CHECK_THROWS_WITH(
      made("hybrid", "cruise_speed"),
      Catch::StartsWith("--ablate cruise_speed: 'cruise_speed' of planner 'hybrid' can be "
                        "neither 0 nor negated, expected cruise_speed=VALUE or one of "));
  CHECK_THROWS_WITH(made("hybrid", "escape"), Catch::Contains("expected escape=VALUE or one of"));
  CHECK_THROWS_WITH(made("hybrid", "escape=nowhere"),
                    Catch::StartsWith("--ablate escape=nowhere: parameters of planner 'hybrid': "
                                      "/escape"));
  CHECK_THROWS_WITH(made("hybrid", "joint_damping"),
                    "--ablate joint_damping: planner 'hybrid' has joint_damping=0 already, "
                    "expected another value");
  CHECK_THROWS_WITH(made("hybrid", "=3"), Catch::StartsWith("--ablate =3: no parameter"));
  CHECK_THROWS_WITH(made("python:mine.py:Mine", "k_p"), Catch::Contains("written in Python"));
  CHECK_THROWS_AS(made("absent", "k_p"), Error);
}

TEST_CASE("ablated planners stand behind their planners, and none is planned twice or overridden",
          "[sweep][unit]") {
  PlanOptions options;
  options.planners = {"apf", "gyro"};
  options.plugin_directories = plugin_directories;
  const PlanOptions before = options;
  add_ablations(options, {"joint_damping", "gravity_compensation"});
  CHECK(options.planners == std::vector<std::string>{
                                "apf", "apf:joint_damping=0", "apf:gravity_compensation=false",
                                "gyro", "gyro:joint_damping=0", "gyro:gravity_compensation=false"});
  REQUIRE(options.ablations.size() == 4);
  CHECK(options.ablations[3].planner == "gyro");
  CHECK(options.ablations[3].without == "gyro:gravity_compensation=false");

  options = before;
  CHECK_THROWS_WITH(add_ablations(options, {"joint_damping", "joint_damping=0"}),
                    "--ablate joint_damping=0: 'apf:joint_damping=0' is planned already, expected "
                    "each part once");
  for (const char* overriding : {"/planner/params/joint_damping=1", "/planner/params={}"}) {
    options = before;
    options.set = {"/planner/params/k_p=3", overriding};
    CHECK_THROWS_WITH(add_ablations(options, {"joint_damping"}),
                      Catch::Contains(std::string("--set ") + overriding));
  }
}
