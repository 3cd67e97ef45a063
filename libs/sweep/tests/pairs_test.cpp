#include "hamelin/sweep/pairs.hpp"

#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/test/errors.hpp"

using namespace hamelin;
using namespace hamelin::sweep;

namespace {

const std::filesystem::path source_dir = HAMELIN_SOURCE_DIR;

/// An arm of two links of 0.5 m that rotate about z by at most ±2 rad, with a ball of radius 0.05 m
/// at the end of each link, and a pillar of radius 0.1 m at (0.6, 0). pillar_clearance() computes
/// the clearance independently.
Json pillar_document() {
  const auto link = [](const char* name, const char* joint, double base_x) {
    return std::string("<link name='") + name +
           "'><inertial><origin xyz='0.25 0 0'/><mass value='1'/>" +
           "<inertia ixx='0.01' iyy='0.02' izz='0.02' ixy='0' ixz='0' iyz='0'/></inertial>" +
           "<collision><origin xyz='0.5 0 0'/><geometry><sphere "
           "radius='0.05'/></geometry></collision></link>" +
           "<joint name='" + joint + "' type='revolute'><parent link='" +
           (base_x > 0.0 ? "a" : "base") + "'/><child link='" + name + "'/><origin xyz='" +
           (base_x > 0.0 ? "0.5" : "0") +
           " 0 0'/><axis xyz='0 0 1'/><limit lower='-2' upper='2' effort='50' "
           "velocity='3'/></joint>";
  };
  const auto file = std::filesystem::path(HAMELIN_TEST_BINARY_DIR) / "sweep_pillar.urdf";
  write_file_atomically(file, "<robot name='two'><link name='base'/>" + link("a", "j1", 0.0) +
                                  link("b", "j2", 0.5) + "</robot>");
  return {{"schema", "hamelin.scene/1"},
          {"robot", {{"file", file.string()}}},
          {"obstacles",
           {{{"type", "cylinder"},
             {"radius_m", 0.1},
             {"length_m", 1.0},
             {"position_m", {0.6, 0.0, 0.0}}}}},
          {"planner", {{"name", "hybrid"}}},
          {"duration_s", 10}};
}

scene::Scene pillar() {
  return scene::scene_from_json(pillar_document(), source_dir, "pillar");
}

double pillar_clearance(const Eigen::VectorXd& q) {
  const Eigen::Vector2d elbow{0.5 * std::cos(q[0]), 0.5 * std::sin(q[0])};
  const Eigen::Vector2d tip =
      elbow + 0.5 * Eigen::Vector2d{std::cos(q[0] + q[1]), std::sin(q[0] + q[1])};
  const Eigen::Vector2d axis{0.6, 0.0};
  return std::min((elbow - axis).norm(), (tip - axis).norm()) - 0.15;
}

std::string message_of(const scene::Scene& scene, const PairOptions& options) {
  return test::error_of([&] { (void)draw_pairs(scene, options); });
}

}  // namespace

TEST_CASE("drawn pairs satisfy limits, clearance and distance", "[sweep][unit]") {
  PairOptions options;
  options.count = 200;
  const DrawnPairs drawn = draw_pairs(pillar(), options);
  REQUIRE(drawn.pairs.size() == 200);
  for (const Pair& pair : drawn.pairs) {
    for (const auto* q : {&pair.start, &pair.goal}) {
      CHECK(q->lpNorm<Eigen::Infinity>() <= 2.0);
      CHECK(pillar_clearance(*q) >= options.min_clearance_m - 1e-12);
    }
    CHECK((pair.goal - pair.start).norm() >= options.min_distance_rad);
  }
  CHECK(drawn.draws == 2 * drawn.pairs.size() + drawn.near_draws + drawn.close_goals);
  CHECK(drawn.near_draws > 0);
  CHECK(drawn.close_goals > 0);
}

TEST_CASE("the seed determines the pairs, and the first ones do not depend on their number",
          "[sweep][unit]") {
  PairOptions options;
  options.count = 12;
  const auto twelve = draw_pairs(pillar(), options).pairs;
  options.count = 5;
  const auto five = draw_pairs(pillar(), options).pairs;
  options.seed = 2;
  const auto other = draw_pairs(pillar(), options).pairs;
  for (std::size_t i = 0; i < five.size(); ++i) {
    CHECK(five[i].start == twelve[i].start);
    CHECK(five[i].goal == twelve[i].goal);
    CHECK(five[i].start != other[i].start);
  }
}

TEST_CASE("if no pairs can be found, the error names the reason", "[sweep][unit]") {
  PairOptions options;
  options.max_draws = 1000;
  options.min_distance_rad = 5.7;  // the limits' corners are 5.66 apart
  CHECK_THAT(message_of(pillar(), options),
             Catch::Contains("pillar: only 0 of 60 pairs found in 1000 draws") &&
                 Catch::Contains("goals nearer than 5.7 rad to their start"));
  options.min_distance_rad = 1.5;
  options.min_clearance_m = 3.0;  // farther than the arm reaches from the pillar
  CHECK_THAT(message_of(pillar(), options),
             Catch::Contains("1000 of them nearer than 3 m to something"));
  options.min_clearance_m = 0.0;
  CHECK_THAT(message_of(pillar(), options),
             Catch::Contains("smallest clearance 0 m, expected a positive number"));
  options = {};
  options.count = 0;
  CHECK_THAT(message_of(pillar(), options), Catch::Contains("0 pairs"));
}

TEST_CASE("a joint without limits is refused by name", "[sweep][unit]") {
  Json document = pillar_document();
  const auto unlimited = std::filesystem::path(HAMELIN_TEST_BINARY_DIR) / "sweep_unlimited.urdf";
  std::string text = read_file(document["robot"]["file"].get<std::string>());
  const std::string second = "<joint name='j2' type='revolute'>";
  text.replace(text.find(second), second.size(), "<joint name='j2' type='continuous'>");
  write_file_atomically(unlimited, text);
  document["robot"]["file"] = unlimited.string();
  CHECK_THAT(message_of(scene::scene_from_json(document, source_dir, "pillar"), {}),
             Catch::Contains("pillar: /robot: joint 'j2' has no position limits"));
}

TEST_CASE("results come in the order of the pairs and do not depend on the number of threads",
          "[sweep][unit]") {
  scene::Scene scene = pillar();
  scene.obstacles.clear();  // each run reaches its own goal
  PairOptions options;
  options.count = 6;
  const auto pairs = draw_pairs(scene, options).pairs;
  PairRuns runs;
  runs.plugin_directories = {HAMELIN_TEST_PLUGIN_DIR};
  const auto alone = run_pairs(scene, pairs, runs);
  runs.jobs = 3;
  std::vector<std::size_t> reported;
  runs.on_result = [&](std::size_t index, const log::Result&) { reported.push_back(index); };
  const auto threaded = run_pairs(scene, pairs, runs);
  CHECK(reported == std::vector<std::size_t>{0, 1, 2, 3, 4, 5});
  REQUIRE(alone.size() == pairs.size());
  REQUIRE(threaded.size() == pairs.size());
  const auto comparable = [](const log::Result& result) {
    Json document = log::to_json(result);
    document.erase("timing");
    document.erase("provenance");
    return document;
  };
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    CHECK(comparable(alone[i]) == comparable(threaded[i]));
    CHECK(alone[i].outcome == log::Outcome::reached);
    CHECK((alone[i].q - pairs[i].goal).lpNorm<Eigen::Infinity>() < 0.05);
  }
}

TEST_CASE("no run is started once the stop flag is set", "[sweep][unit]") {
  const scene::Scene scene = pillar();
  const std::atomic<bool> stop = true;
  PairRuns runs;
  runs.plugin_directories = {HAMELIN_TEST_PLUGIN_DIR};
  runs.stop = &stop;
  CHECK(run_pairs(scene, draw_pairs(scene, {}).pairs, runs).empty());
}

TEST_CASE("an error of a run reaches the caller", "[sweep][unit]") {
  scene::Scene scene = pillar();
  const auto pairs = draw_pairs(scene, {}).pairs;
  scene.planner->name = "no_such_planner";
  PairRuns runs;
  runs.plugin_directories = {HAMELIN_TEST_PLUGIN_DIR};
  runs.jobs = 2;
  CHECK_THROWS_WITH(run_pairs(scene, pairs, runs), Catch::Contains("no_such_planner"));
}

TEST_CASE("a summary has counts, medians, smallest and largest values", "[sweep][unit]") {
  std::vector<log::Result> results(4);
  const std::vector<log::Outcome> outcomes{log::Outcome::reached, log::Outcome::reached,
                                           log::Outcome::stalled, log::Outcome::reached};
  const std::vector<double> times{3.0, 1.0, 9.0, 2.0}, clearances{0.05, 0.02, 0.01, 0.03},
      shares{1.0, 1.0, 0.5, 1.0};
  for (std::size_t i = 0; i < results.size(); ++i) {
    results[i].outcome = outcomes[i];
    results[i].time_s = times[i];
    results[i].min_clearance_m = clearances[i];
    results[i].certified_share = shares[i];
    results[i].cpu_s = 0.25;
    results[i].tick_us = log::Result::TickTime{times[i], 2.0 * times[i], 100.0};
  }
  const Summary summary = summarize(results);
  CHECK(summary.runs == 4);
  CHECK(summary.count(log::Outcome::reached) == 3);
  CHECK(summary.count(log::Outcome::stalled) == 1);
  CHECK(summary.count(log::Outcome::collision) == 0);
  CHECK(summary.min_clearance_m == 0.01);
  CHECK(summary.certified_share_mean == 0.875);
  CHECK(summary.certified_share_min == 0.5);
  CHECK(summary.reached_time_s_median == 2.0);
  CHECK(summary.reached_time_s_max == 3.0);
  CHECK(summary.time_s == 15.0);
  CHECK(summary.tick_us_p50_median == 2.0);  // the lower of 2 and 3
  CHECK(summary.tick_us_p99_max == 18.0);
  CHECK(summary.cpu_s == 1.0);

  const Json nothing = to_json(summarize({}));
  CHECK(nothing["runs"] == 0);
  CHECK(nothing["min_clearance_m"].is_null());
  CHECK(nothing["outcomes"]["reached"] == 0);
}
