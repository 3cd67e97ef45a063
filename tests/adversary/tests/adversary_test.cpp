#include <algorithm>
#include <catch2/catch.hpp>

#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/log/read_log.hpp"
#include "hamelin/log/run_log.hpp"
#include "hamelin/simulation/run.hpp"

using namespace hamelin;
using log::Outcome;

namespace {

const std::vector<std::filesystem::path> plugins{HAMELIN_TEST_ONLY_PLUGIN_DIR,
                                                 HAMELIN_TEST_PLUGIN_DIR};

scene::Scene under_attack(const char* name, std::uint64_t seed) {
  scene::Scene scene =
      scene::read_scene(std::string(HAMELIN_SOURCE_DIR "/data/scenes/") + name + ".json");
  scene.planner = scene::Choice{"adversary", Json::object()};
  scene.model.joint_limits = scene.model.velocity_limits = true;
  scene.model.torque_limits = scene.model.self_collision = true;
  scene.stall.reset();
  scene.duration_s = 1.5;
  scene.seed = seed;
  return scene;
}

// What the shield promises of any planner.
void check_safe(const scene::Scene& scene, const log::Result& result) {
  CAPTURE(scene.name, scene.seed, result.cause);
  CHECK((result.outcome == Outcome::timeout || result.outcome == Outcome::defect ||
         result.outcome == Outcome::reached));
  REQUIRE(result.min_clearance_m);
  CHECK(*result.min_clearance_m > 0.0);
  CHECK(*result.min_self_clearance_m > 0.0);
  CHECK(result.position_excess == 0.0);
  REQUIRE(result.shield);
  CHECK(result.shield->strayed_share <= 1.0);
  CHECK(result.shield->overtaken == 0);
  if (result.outcome == Outcome::defect)  // a planner that fails leaves the arm at rest
    CHECK(result.v.lpNorm<Eigen::Infinity>() < 1e-2);
}

scene::Scene sampled(scene::Scene scene) {
  scene.actuation.type = scene::ActuationType::sampled;
  scene.actuation.control_period_s = 0.001;
  scene.actuation.delay_s = 0.001;
  scene.safety.torque_share = 0.8;
  return scene;
}

}  // namespace

TEST_CASE("whatever a planner does, the arm touches nothing and keeps its limits", "[adversary]") {
  long refused = 0, defects = 0;
  for (const char* name : {"clutter", "shelf"})
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      const scene::Scene scene = under_attack(name, seed);
      const log::Result result = simulation::run(scene, plugins, {});
      check_safe(scene, result);
      CHECK(result.certified_share == 1.0);
      CHECK(result.speed_excess == 0.0);
      refused += result.shield->refused;
      defects += result.outcome == Outcome::defect ? 1 : 0;
    }
  CHECK(refused > 1000);
  CHECK(defects > 0);
}

TEST_CASE("without the shield, the same planners touch", "[adversary]") {
  int contacts = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    scene::Scene scene = under_attack("clutter", seed);
    scene.safety.type = scene::SafetyType::certificate;
    contacts += simulation::run(scene, plugins, {}).outcome == Outcome::collision ? 1 : 0;
  }
  CHECK(contacts >= 5);
}

TEST_CASE(
    "late torques with friction, wrong masses and a limited rate are safe within stated bounds",
    "[adversary]") {
  for (const char* name : {"clutter", "shelf"})
    for (std::uint64_t seed = 1; seed <= 10; ++seed) {
      scene::Scene scene = sampled(under_attack(name, seed));
      scene.actuation.coulomb_friction_share = scene.safety.friction_share = 0.02;
      scene.actuation.planner_mass_scale = seed % 2 == 0 ? 0.95 : 1.05;
      scene.safety.mass_error = 0.05;
      scene.actuation.torque_rate_max_Nm_s = 1000.0;
      check_safe(scene, simulation::run(scene, plugins, {}));
    }
}

TEST_CASE("estimated velocities keep their limits, also where friction and masses are not known",
          "[adversary]") {
  for (const char* name : {"clutter", "shelf"})
    for (const std::uint64_t seed : {6U, 10U, 26U}) {
      scene::Scene scene = sampled(under_attack(name, seed));
      scene.safety.torque_share = 0.75;
      scene.actuation.coulomb_friction_share = scene.safety.friction_share = 0.05;
      scene.actuation.planner_mass_scale = 0.9;
      scene.safety.mass_error = 0.1;
      scene.actuation.estimates_velocity = true;
      scene.safety.joint_noise_rad = scene.actuation.joint_noise_rad = 1e-4;
      const log::Result result = simulation::run(scene, plugins, {});
      check_safe(scene, result);
      CHECK(result.speed_excess == 0.0);
    }
}

TEST_CASE("a bound that does not hold is noticed by what stops do, and named", "[adversary]") {
  struct Case {
    const char* what;
    void (*exceed)(scene::Scene&);
    void (*state)(scene::Scene&);
  };
  const Case cases[] = {
      {"friction", [](scene::Scene& scene) { scene.actuation.coulomb_friction_share = 0.05; },
       [](scene::Scene& scene) { scene.safety.friction_share = 0.05; }},
      {"masses", [](scene::Scene& scene) { scene.actuation.planner_mass_scale = 0.9; },
       [](scene::Scene& scene) { scene.safety.mass_error = 0.12; }},
      {"noise",
       [](scene::Scene& scene) {
         scene.actuation.joint_noise_rad = 5e-4;
         scene.safety.joint_noise_rad = 0.0;
       },
       [](scene::Scene& scene) { scene.safety.joint_noise_rad = 5e-4; }},
      {"tracking", [](scene::Scene& scene) { scene.safety.tracking_rad = 1e-7; },
       [](scene::Scene& scene) { scene.safety.tracking_rad = 2e-4; }}};
  for (const Case& one : cases) {
    CAPTURE(one.what);
    double exceeded = 0.0, stated = 0.0;
    int named = 0;
    for (std::uint64_t seed = 1; seed <= 4; ++seed) {
      scene::Scene scene = sampled(under_attack("shelf", seed));
      scene.actuation.delay_s = 0.0;
      one.exceed(scene);
      const log::Result result = simulation::run(scene, plugins, {});
      exceeded = std::max(exceeded, result.shield->strayed_share);
      const bool warned = std::any_of(
          result.warnings.begin(), result.warnings.end(), [](const std::string& warning) {
            return warning.find("the bounds of /safety do not hold: joint '") != std::string::npos;
          });
      CHECK(warned == (result.shield->strayed_share > 1.0));
      named += warned ? 1 : 0;
      one.state(scene);
      stated = std::max(stated, simulation::run(scene, plugins, {}).shield->strayed_share);
    }
    CHECK(exceeded > 1.0);
    CHECK(named > 0);
    CHECK(stated <= 1.0);
  }
}

TEST_CASE("after a planner has failed, the log has the stop that brings the arm to rest",
          "[adversary]") {
  const bool ideal = GENERATE(true, false);
  const auto file = std::filesystem::path(HAMELIN_TEST_BINARY_DIR) / "adversary_failed.jsonl";
  scene::Scene scene = under_attack("shelf", 1);
  scene.planner = scene::Choice{"breaking", {{"at_tick", 20}, {"how", "nan"}}};
  scene.start_v = Eigen::VectorXd::Constant(7, 0.2);
  if (!ideal) {
    scene = sampled(scene);
    scene.actuation.delay_s = 0.0;
  }
  {
    log::RunLog log(file);
    simulation::Watch watch;
    watch.log = &log;
    const log::Result result = simulation::run(scene, plugins, watch);
    CHECK(result.outcome == Outcome::defect);
    CHECK(result.v.lpNorm<Eigen::Infinity>() < 1e-2);
  }
  constexpr std::size_t step = 20;
  std::vector<Json> ticks;
  for (auto& line : log::read_log(file).lines)
    if (line["type"] == "tick") ticks.push_back(std::move(line));
  REQUIRE(ticks.size() > step + 4);
  for (std::size_t k = step; k + 1 < ticks.size(); ++k) {
    REQUIRE(ticks[k].contains("stop"));
    REQUIRE(ticks[k]["channels"]["stop"] == ticks[k]["tau"]);
  }
  CHECK(ticks[step]["tau"] != ticks[ticks.size() - 2]["tau"]);
}
