#include <catch2/catch.hpp>

#include "hamelin/simulation/run.hpp"

using namespace hamelin;

namespace {

log::Result run(const std::string& name, const std::vector<std::string>& settings = {}) {
  const std::filesystem::path file =
      std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/scenes" / name;
  Json document = read_json(file);
  for (const auto& setting : settings) scene::set_pointer(document, setting);
  const auto scene = scene::scene_from_json(document, file.parent_path(), file.string());
  return simulation::run(scene, {HAMELIN_TEST_PLUGIN_DIR}, {});
}

}  // namespace

TEST_CASE(
    "hybrid reaches the goals in shelf and clutter, clear and certified, with correct accounts",
    "[hybrid][closed_loop]") {
  const auto scene = GENERATE(as<std::string>{}, "shelf.json", "clutter.json");
  CAPTURE(scene);
  const auto result = run(scene);
  CHECK(result.outcome == log::Outcome::reached);
  REQUIRE(result.min_clearance_m);
  CHECK(*result.min_clearance_m > 0.0);
  CHECK(result.certified_share == 1.0);
  CHECK(result.filter_work_J <= 1e-12);
  CHECK(result.recovery_work_J >= 0.0);
  CHECK(std::abs(result.gyroscopic_work_J) <= 1e-10);
  CHECK(result.energy_error_max_J < 1e-3);
}

TEST_CASE("hybrid gives up with a cause if it has no escape path", "[hybrid][closed_loop]") {
  // A goal inside the shelf's back wall: the margin keeps the arm away.
  const auto result =
      run("shelf.json", {R"(/goals=[{"type": "position", "position_m": [0.91, 0.25, 0.45]}])",
                         "/planner/params/escape=none"});
  CHECK(result.outcome == log::Outcome::stalled);
  CAPTURE(result.cause);
  const std::string kind = result.cause.substr(0, result.cause.find(':'));
  CHECK((kind == "force balance" || kind == "margin around the goal" ||
         kind == "unreachable goal" || kind.starts_with("joint limit") ||
         kind.starts_with("torque limit")));
  CHECK(*result.min_clearance_m > 0.0);
}

TEST_CASE("hybrid keeps clear with other seeds, integrators and steps", "[hybrid][closed_loop]") {
  const auto setting =
      GENERATE(as<std::string>{}, "/seed=2", "/step_s=0.002", "/integrator/name=rk4",
               "/integrator/name=semi-implicit-euler", "/integrator/name=hamel-midpoint");
  CAPTURE(setting);
  const auto result = run("shelf.json", {setting});
  CHECK(result.outcome == log::Outcome::reached);
  CHECK(*result.min_clearance_m > 0.0);
  CHECK(result.certified_share == 1.0);
}

TEST_CASE("an arm whose path is barred turns past what bars it, without a search",
          "[hybrid][closed_loop]") {
  const bool steering = GENERATE(false, true);
  const auto result = run(
      "shelf.json", {"/map=null", "/start/q=[-0.8, -0.4, 0, -2.0, 0, 1.571, 0.785]",
                     R"(/goals=[{"type": "path", "q": [[0, -0.4, 0, -2.0, 0, 1.571, 0.785],
                                          [0.8, -0.4, 0, -2.0, 0, 1.571, 0.785]]}])",
                     R"(/obstacles=[{"name": "post", "type": "sphere", "radius_m": 0.1,
                       "position_m": [0.45, 0, 0.55]}])",
                     R"(/planner={"name": "hybrid", "params": {"escape": "none", "steering": )" +
                         std::string(steering ? "true" : "false") + "}}"});
  CAPTURE(result.cause);
  CHECK((result.outcome == log::Outcome::reached) == steering);
  CHECK(*result.min_clearance_m > 0.0);
  CHECK(std::abs(result.gyroscopic_work_J) <= 1e-12);
}
