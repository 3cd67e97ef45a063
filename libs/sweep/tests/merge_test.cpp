#include "hamelin/sweep/merge.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/sweep/records.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;
using namespace hamelin::sweep;

namespace {

/// A made-up run.
MergedRun made(const std::string& id, const std::string& planner, const Json& record,
               bool feasible = true) {
  MergedRun merged;
  merged.run.id = id;
  merged.run.scene = "scenes/a.json";
  merged.run.planner = planner;
  merged.run.labels = {{"planner", planner}, {"goal", "joint"}, {"problem", "a"}, {"seed", "1"}};
  merged.directory = "sweep";
  merged.feasible = feasible;
  if (!feasible) merged.reason = "goal 0: hand/1 in the map, 0.0010 m deep";
  merged.facts = facts_of(record);
  return merged;
}

Json record(const std::string& outcome, double clearance, double time_s, double p50,
            const Json& cause = nullptr) {
  Json closest{
      {"clearance_m", clearance}, {"time_s", 0.5}, {"sphere", "hand/3"}, {"other", "<can> & 'co'"}};
  return {{"outcome", outcome},
          {"cause", cause},
          {"result",
           {{"outcome", outcome},
            {"time_s", time_s},
            {"certified_share", 1.0 - 0.01 * p50},
            {"filter_work_J", -0.1 * p50},
            {"recovery_work_J", 0.5 * p50},
            {"escape", {{"count", 2}, {"strategy", "tree"}}},
            {"timing",
             {{"cpu_s", 0.1}, {"tick_us", {{"p50", p50}, {"p99", 2.0 * p50}, {"max", 90.0}}}}}}},
          {"judge",
           {{"contact", clearance <= 0.0},
            {"obstacles", closest},
            {"self", nullptr},
            {"configurations", 9}}}};
}

std::vector<MergedRun> hand_made() {
  const Json crashed{
      {"outcome", "crashed"}, {"cause", "signal 11"}, {"result", nullptr}, {"judge", nullptr}};
  return {
      made("1", "hybrid", record("reached", 0.02, 4.0, 5.0)),
      made("2", "hybrid", record("reached", 0.01, 6.0, 7.0)),
      made("3", "hybrid", record("reached", 0.03, 5.0, 6.0), false),
      made("4", "hybrid", record("stalled", 0.05, 9.0, 8.0, "joint limit")),
      made("5", "hybrid", crashed),
      made("6", "hybrid", Json()),
      made("7", "apf",
           record("collision", -0.004, 2.0, 1.0, "ran <into> it, 1.5e-3 m deep at 2 s, at link4")),
      made("8", "apf", record("stalled", 0.05, 9.0, 2.0, "joint limit")),
      made("9", "apf", record("stalled", 0.05, 9.0, 3.0, "joint limit"))};
}

/// Ends of the interval of shares p for which |p̂ − p| ≤ z √(p(1 − p)/n), by bisection.
double wilson_end(double hits, double n, double toward) {
  const double share = hits / n, z = 1.959963984540054;
  double inside = share, outside = toward;
  for (int i = 0; i < 200; ++i) {
    const double p = 0.5 * (inside + outside);
    (std::abs(share - p) <= z * std::sqrt(p * (1.0 - p) / n) ? inside : outside) = p;
  }
  return inside;
}

}  // namespace

TEST_CASE("Wilson's interval solves its defining inequality and agrees with published values",
          "[sweep][unit]") {
  for (const std::size_t n : {1U, 2U, 7U, 60U, 700U})
    for (const std::size_t hits : {std::size_t{0}, n / 3, n / 2, n - 1, n}) {
      CAPTURE(hits, n);
      const Interval interval = wilson_interval(hits, n);
      const double h = static_cast<double>(hits), all = static_cast<double>(n);
      CHECK(interval.low == Approx(hits == 0 ? 0.0 : wilson_end(h, all, 0.0)).margin(1e-12));
      CHECK(interval.high == Approx(hits == n ? 1.0 : wilson_end(h, all, 1.0)).margin(1e-12));
    }
  // Newcombe, Statistics in Medicine 17 (1998), table I, method 3: 81/263, 15/148, 0/20, 1/29
  const auto published = [](std::size_t hits, std::size_t n, double low, double high) {
    CHECK(wilson_interval(hits, n).low == Approx(low).margin(5e-5));
    CHECK(wilson_interval(hits, n).high == Approx(high).margin(5e-5));
  };
  published(81, 263, 0.2553, 0.3662);
  published(15, 148, 0.0624, 0.1605);
  published(0, 20, 0.0, 0.1611);
  published(1, 29, 0.0061, 0.1718);
  CHECK(wilson_interval(0, 0).low == 0.0);
  CHECK(wilson_interval(0, 0).high == 1.0);
}

TEST_CASE("contacts that a plant counts itself are counted apart from the judge's",
          "[sweep][unit]") {
  auto runs = hand_made();
  for (std::size_t i = 0; i < 3; ++i) runs[i].facts.plant_contacts = i == 1 ? 1.0 : 0.0;
  Merged merged;
  merged.by = {"planner"};
  merged.groups = group(runs, merged.by);
  CHECK(merged.groups[0].plant_runs == 0);
  CHECK(merged.groups[1].plant_runs == 3);
  CHECK(merged.groups[1].plant_contacts == 1);
  CHECK(merged.groups[1].contacts == 0);
  const Json json = to_json(merged);
  CHECK_FALSE(json["groups"][0].contains("plant_runs"));
  CHECK(json["groups"][1]["plant_contacts"] == 1);
  check_shipped_schema(json, "summary", "merged");
  CHECK_THAT(
      to_table(merged),
      Catch::Contains("hybrid: the plant's own collision detection counted contact in 1 of 3 "
                      "runs") &&
          !Catch::Contains("apf: the plant's own"));
}

TEST_CASE("changes of the torque are averaged where torques are sampled", "[sweep][unit]") {
  auto runs = hand_made();
  runs[0].facts.torque_change_mean = 0.25;
  runs[1].facts.torque_change_mean = 0.5;
  Merged merged;
  merged.by = {"planner"};
  merged.groups = group(runs, merged.by);
  CHECK(merged.groups[1].torque_change_mean == 0.375);
  CHECK_FALSE(merged.groups[0].torque_change_mean.has_value());
  const Json json = to_json(merged);
  CHECK(json["groups"][0]["torque_change_mean"].is_null());
  check_shipped_schema(json, "summary", "merged");
  CHECK_THAT(to_table(merged), Catch::Contains("dtau") && Catch::Contains("0.375"));
}

TEST_CASE("made-up records are grouped and counted", "[sweep][unit]") {
  const auto groups = group(hand_made(), {"planner"});
  REQUIRE(groups.size() == 2);
  const Group &apf = groups[0], &hybrid = groups[1];
  CHECK(hybrid.key == std::vector<std::string>{"hybrid"});
  CHECK(hybrid.planned == 6);
  CHECK(hybrid.runs == 5);
  CHECK(hybrid.feasible == 4);
  CHECK(hybrid.reached == 2);
  CHECK(hybrid.reached_all == 3);
  CHECK(hybrid.reached_interval.low == wilson_interval(2, 4).low);
  CHECK(hybrid.outcomes ==
        std::map<std::string, std::size_t>{{"crashed", 1}, {"reached", 3}, {"stalled", 1}});
  CHECK(hybrid.judged == 4);
  CHECK(hybrid.contacts == 0);
  CHECK(hybrid.min_clearance_m == 0.01);
  CHECK_FALSE(hybrid.min_self_clearance_m.has_value());
  CHECK(*hybrid.certified_share_mean == Approx(1.0 - 0.01 * 6.5));
  CHECK(*hybrid.certified_share_min == Approx(0.92));
  CHECK(hybrid.reached_time_s_median == 5.0);
  CHECK(hybrid.tick_us_p50_median == 6.0);  // the lower of 6 and 7
  CHECK(hybrid.tick_us_p99_median == 12.0);
  CHECK(hybrid.filter_work_J_max == Approx(-0.5));
  CHECK(*hybrid.recovery_work_J_median == 3.0);
  CHECK(hybrid.escapes == std::map<std::string, double>{{"count", 8.0}});
  CHECK(hybrid.causes ==
        std::map<std::string, std::size_t>{{"crashed: signal 11", 1}, {"stalled: joint limit", 1}});
  CHECK(apf.contacts == 1);
  CHECK(apf.min_clearance_m == -0.004);
  CHECK(apf.causes.at("stalled: joint limit") == 2);
  CHECK(apf.causes.count("collision: ran <into> it, N m deep at N s, at link N") == 1);
  CHECK_FALSE(apf.reached_time_s_median.has_value());
}

TEST_CASE("a target that was followed to the end is a success, and one that was lost is not",
          "[sweep][unit]") {
  const std::vector<MergedRun> runs{made("1", "p", record("followed", 0.02, 30.0, 5.0)),
                                    made("2", "p", record("target_lost", 0.02, 9.0, 5.0))};
  const Group all = group(runs, {"planner"}).at(0);
  CHECK(all.reached == 1);
  CHECK(all.causes == std::map<std::string, std::size_t>{{"target_lost", 1}});
}

TEST_CASE("grouping by a label that no run has is refused with the list of labels",
          "[sweep][unit]") {
  CHECK_THROWS_WITH(
      group(hand_made(), {"colour"}),
      "--by colour: no run has that label, expected one of goal, planner, problem, seed");
}

TEST_CASE(
    "gain sets are counted among those that reach the goal without the obstacle and those with "
    "which apf stalls",
    "[sweep][unit]") {
  std::vector<MergedRun> runs;
  const auto add = [&](const std::string& set, const std::string& planner,
                       const std::string& problem, const std::string& outcome) {
    MergedRun run = made(set + planner, planner,
                         record(outcome, outcome == "collision" ? -0.1 : 0.1, 1.0, 1.0));
    run.run.labels["gains"] = set;
    run.run.labels["problem"] = problem;
    run.run.gains = {{"k_p", 1.0}, {"eta", 1.0}, {"k_obs", 1.0}};
    runs.push_back(run);
  };
  const std::vector<std::array<std::string, 4>> sets{{"g1", "reached", "stalled", "reached"},
                                                     {"g2", "reached", "reached", "reached"},
                                                     {"g3", "timeout", "stalled", "reached"},
                                                     {"g4", "reached", "stalled", "collision"}};
  for (const auto& [set, reference, apf, gyro] : sets) {
    add(set, "apf without the obstacle", no_obstacle, reference);
    add(set, "apf", "obstacle", apf);
    add(set, "gyro", "obstacle", gyro);
  }
  const auto gains = group_gains(runs);
  REQUIRE(gains.size() == 2);
  CHECK(gains[0].planner == "apf");
  CHECK(gains[0].reached == 1);
  CHECK(gains[0].reference == 3);
  CHECK(gains[0].reached_of_reference == 1);
  CHECK(gains[1].planner == "gyro");
  CHECK(gains[1].sets == 4);
  CHECK(gains[1].reached == 3);
  CHECK(gains[1].contacts == 1);
  CHECK(gains[1].reached_of_reference == 2);
  CHECK(gains[1].interval.high == wilson_interval(2, 3).high);
  CHECK(gains[1].apf_stalled == 3);
  CHECK(gains[1].reached_of_apf_stalled == 2);
}

TEST_CASE("a merge reports missing runs and records from several builds", "[sweep][unit]") {
  const test::TemporaryFolder folder;
  const std::filesystem::path& directory = folder.path();
  Plan plan;
  plan.scenes.push_back({"a.json", std::string(64, '0'), true, ""});
  for (const char* id : {"1", "2", "3"}) {
    PlannedRun run;
    run.id = id;
    run.scene = "a.json";
    run.labels = {{"planner", "p"}};
    plan.runs.push_back(run);
  }
  write_plan(plan, directory);
  std::ofstream out(records_file(directory));
  for (const char* id : {"1", "2"}) {
    Json line{{"schema", "hamelin.record/1"}, {"plan", plan.sha256}, {"id", id}};
    line.update(record("reached", 0.1, 1.0, 1.0));
    line["result"]["planner"] = "p";
    line["result"]["provenance"] = {
        {"build", {{"id", "b"}}},
        {"inputs", {{{"role", "plugin"}, {"path", "p"}, {"sha256", id}}}}};
    out << line.dump() << "\n";
  }
  out.close();
  const Merged merged = merge(read_sweeps({directory}), {"planner"});
  CHECK(merged.groups.at(0).planned == 3);
  CHECK(merged.groups.at(0).reached == 2);
  CHECK(merged.notes == std::vector<std::string>{"1 of 3 runs have no record yet",
                                                 "the records come from 2 builds of planner p"});
}

TEST_CASE("the summary's JSON has the values of the groups", "[sweep][unit]") {
  Merged merged{{hand_made(), {}, {}, {}, 0, {}, {}}, {"planner"}, {}, {}, {}};
  merged.groups = group(merged.sweeps.runs, merged.by);
  const Json summary = to_json(merged);
  CHECK(summary["groups"][1]["labels"] == Json{{"planner", "hybrid"}});
  CHECK(summary["groups"][1]["reached"] == 2);
  CHECK(summary["groups"][1]["reached_share_interval"][1] == wilson_interval(2, 4).high);
  CHECK(summary["groups"][0]["min_clearance_m"] == -0.004);
}
