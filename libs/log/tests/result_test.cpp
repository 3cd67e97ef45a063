#include "hamelin/log/result.hpp"

#include <catch2/catch.hpp>
#include <limits>

using namespace hamelin;
using log::Outcome;

namespace {

log::Result some_result() {
  log::Result result;
  result.scene = "scenes/a.json";
  result.integrator = "hamel-variational";
  result.q = Eigen::Vector2d(0.5, -1.0);
  result.v = Eigen::Vector2d(0.0, 0.25);
  result.solver.steps = 4;
  result.solver.updates = 10;
  result.solver.criterion = "|delta|_inf <= 1e-12";
  result.provenance = {{"host", nullptr}};
  return result;
}

}  // namespace

TEST_CASE(
    "a result has the keys of its schema in a fixed order, with null for keys that do not apply",
    "[log][unit]") {
  const Json document = log::to_json(some_result());
  CHECK_NOTHROW(check_shipped_schema(document, "result", "result"));
  std::vector<std::string> keys;
  for (const auto& [key, unused] : document.items()) keys.push_back(key);
  const std::vector<std::string> first = {"schema",     "version", "scene", "planner",
                                          "integrator", "outcome", "cause", "time_s"};
  REQUIRE(keys.size() > first.size());
  CHECK(std::vector<std::string>(keys.begin(), keys.begin() + static_cast<long>(first.size())) ==
        first);
  for (const char* key : {"planner", "cause", "min_clearance_m", "goal", "certified_share"}) {
    CAPTURE(key);
    CHECK(document[key].is_null());
  }
  CHECK(document["timing"]["tick_us"].is_null());
  CHECK(document["outcome"] == "completed");
  CHECK(document["q"] == Json({0.5, -1.0}));
  CHECK(document["solver"]["updates_mean"] == 2.5);
}

TEST_CASE("a full result fits its schema", "[log][unit]") {
  auto result = some_result();
  result.planner = "apf";
  result.outcome = Outcome::stalled;
  result.cause = "at rest";
  result.min_clearance_m = 0.01;
  result.goal = log::Result::Goal{"pose", 0, 1, 0.1, 0.2};
  result.certified_share = 1.0;
  result.tightest_step_m = 0.004;
  result.tick_us = log::Result::TickTime{1.0, 2.0, 3.0};
  log::Result::Following following;
  following.free = {9.0, 0.001, 0.002, 0.01, 0.02};
  following.resume_max_s = 0.5;
  result.following = following;
  const Json document = log::to_json(result);
  CHECK_NOTHROW(check_shipped_schema(document, "result", "result"));
  CHECK(document["goal"]["error_rad"] == 0.2);
  CHECK(document["cause"] == "at rest");
  CHECK(document["following"]["free"]["rms_m"] == 0.001);
  CHECK(document["following"]["resume_max_s"] == 0.5);
}

TEST_CASE("non-finite numbers become null and are named in the warnings", "[log][unit]") {
  auto result = some_result();
  result.q[1] = std::numeric_limits<double>::quiet_NaN();
  result.energy_final_J = std::numeric_limits<double>::infinity();
  const Json document = log::to_json(result);
  CHECK(document["q"][0] == 0.5);
  CHECK(document["q"][1].is_null());
  CHECK(document["energy_final_J"].is_null());
  REQUIRE(document["warnings"].size() == 2);
  CHECK(document["warnings"][0].get<std::string>().find("/q/1 is nan") != std::string::npos);
  CHECK(document["warnings"][1].get<std::string>().find("/energy_final_J is inf") !=
        std::string::npos);
  CHECK_NOTHROW(check_shipped_schema(document, "result", "result"));
}

TEST_CASE("a result before its first step has no mean", "[log][unit]") {
  log::Result result = some_result();
  result.solver = {};
  CHECK(log::to_json(result)["solver"]["updates_mean"].is_null());
}

TEST_CASE("outcomes have the documented exit codes", "[log][unit]") {
  CHECK(log::exit_code(Outcome::completed) == 0);
  CHECK(log::exit_code(Outcome::reached) == 0);
  CHECK(log::exit_code(Outcome::followed) == 0);
  CHECK(log::exit_code(Outcome::target_lost) == 1);
  CHECK(log::exit_code(Outcome::stalled) == 1);
  CHECK(log::exit_code(Outcome::collision) == 1);
  CHECK(log::exit_code(Outcome::timeout) == 1);
  CHECK(log::exit_code(Outcome::refused) == 2);
  CHECK(log::exit_code(Outcome::diverged) == 3);
  CHECK(log::exit_code(Outcome::defect) == 3);
  CHECK(log::exit_code(Outcome::interrupted) == 130);
}
