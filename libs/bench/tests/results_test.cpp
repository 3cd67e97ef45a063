#include "hamelin/bench/results.hpp"

#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"

using namespace hamelin;
using namespace hamelin::bench;

namespace {

/// A problem that a planner ran with a part and without it; a time below zero stands for a failure.
struct Pair {
  double with_s, without_s;
  bool contact_without = false;
};

sweep::MergedRun run_of(int problem, const std::string& planner, double time_s, bool contact) {
  sweep::MergedRun merged;
  merged.run.scene = "scenes/p" + std::to_string(problem) + ".json";
  merged.run.id = merged.run.scene + "/" + planner;
  merged.run.labels = {{"family", "shelf"},
                       {"planner", planner},
                       {"problem", "p" + std::to_string(problem)},
                       {"seed", "1"}};
  merged.directory = "d";
  merged.facts.recorded = true;
  merged.facts.success = time_s > 0.0;
  merged.facts.outcome = merged.facts.success ? "reached" : "timeout";
  merged.facts.judge_saw_contact = contact;
  if (merged.facts.success) merged.facts.time_s = time_s;
  return merged;
}

Results results_of(const std::vector<Pair>& pairs) {
  sweep::Sweeps sweeps;
  int problem = 0;
  for (const auto& pair : pairs) {
    ++problem;
    sweeps.runs.push_back(run_of(problem, "p", pair.with_s, false));
    sweeps.runs.push_back(run_of(problem, "p:turn=false", pair.without_s, pair.contact_without));
  }
  sweeps.ablations = {{"p", "p:turn=false", "turn", false}};
  Results results{"set", std::string(64, '0'), {}, {"p", "p:turn=false"}, {}, {}, {}, {}};
  results.by_family = sweep::merge(std::move(sweeps), {"family", "planner"});
  results.by_planner = sweep::group(results.by_family.sweeps.runs, {"planner"});
  results.ablations = sweep::compare_ablations(results.by_family.sweeps);
  return results;
}

/// Both solve six problems, with the part 1, 2, … 6 s earlier; five are solved only with it, one
/// only without it, and two by none.
std::vector<Pair> study() {
  std::vector<Pair> pairs;
  for (int k = 1; k <= 6; ++k) pairs.push_back({2.0, 2.0 + k});
  for (int k = 0; k < 5; ++k) pairs.push_back({3.0, -1.0});
  pairs.push_back({-1.0, 4.0, true});
  pairs.push_back({-1.0, -1.0});
  pairs.push_back({-1.0, -1.0, true});
  return pairs;
}

}  // namespace

TEST_CASE("an ablation is tested by hand-counted pairs", "[bench][unit]") {
  const Results results = results_of(study());
  const Json document = to_json(results);
  check_shipped_schema(document, "benchmark", "made results");
  REQUIRE(document["ablations"].size() == 1);
  const Json& ablation = document["ablations"][0];
  CHECK(ablation["planner"] == "p");
  CHECK(ablation["without"] == "p:turn=false");
  CHECK(ablation["parameter"] == "turn");
  CHECK(ablation["value"] == false);
  CHECK(ablation["pairs"] == 14);
  CHECK(ablation["left_out"] == 0);
  const Json& reached = ablation["reached"];
  CHECK(reached["with"] == 11);
  CHECK(reached["without"] == 7);
  CHECK(reached["only_with"] == 5);
  CHECK(reached["only_without"] == 1);
  CHECK(reached["difference"] == Approx(4.0 / 14.0));
  // 2 (C(6,0) + C(6,1)) / 2^6
  CHECK(reached["p"].get<double>() == Approx(14.0 / 64.0));
  CHECK(reached["difference_interval"][0] < 4.0 / 14.0);
  CHECK(reached["difference_interval"][1] > 4.0 / 14.0);
  CHECK(ablation["contacts"] == Json{{"with", 0}, {"without", 2}});
  // of the differences -1, -2, … -6: all have the same sign, so Wilcoxon's p is 2 / 2^6
  const Json& arrival = ablation["arrival"];
  CHECK(arrival["pairs"] == 6);
  CHECK(arrival["difference_s"].get<double>() == Approx(-3.5));
  CHECK(arrival["difference_interval_s"][0].get<double>() == Approx(-6.0));
  CHECK(arrival["difference_interval_s"][1].get<double>() == Approx(-1.0));
  CHECK(arrival["p"].get<double>() == Approx(2.0 / 64.0));

  const std::string table = to_table(results, true);
  CHECK_THAT(table, Catch::Contains("\n\n| ablation of | part | with | without |"));
  CHECK_THAT(table, Catch::Contains("| p | turn=false | 11/14 | 7/14 | 5 | 1 | 0.22 | +28.6 | "));
  CHECK_THAT(table, Catch::Contains("| 0 | 2 | -3.50 | -6.00 to -1.00 |\n"));
  CHECK(harmful_parts(results).empty());
  CHECK(parts_without_effect(results).empty());
}

TEST_CASE("without discordant pairs Tango's interval has a closed form", "[bench][unit]") {
  const Results results = results_of(std::vector<Pair>(10, Pair{2.0, 2.0}));
  const Json ablation = to_json(results)["ablations"][0];
  const double z2 = 1.959964 * 1.959964;
  CHECK(ablation["reached"]["p"] == 1.0);
  CHECK(ablation["reached"]["difference"] == 0.0);
  CHECK(ablation["reached"]["difference_interval"][0].get<double>() ==
        Approx(-z2 / (10.0 + z2)).margin(1e-6));
  CHECK(ablation["reached"]["difference_interval"][1].get<double>() ==
        Approx(z2 / (10.0 + z2)).margin(1e-6));
  CHECK(ablation["arrival"]["p"].is_null());
  CHECK(parts_without_effect(results) ==
        std::vector<std::string>{
            "p: turn=false changes neither success nor arrival of any of 10 problems"});
  check_shipped_schema(to_json(results), "benchmark", "made results");
}

TEST_CASE("only a significant loss by a part is reported", "[bench][unit]") {
  // 5 of 5: p = 2 / 2^5 = 0.0625; 6 of 6: p = 2 / 2^6 = 0.03125
  std::vector<Pair> pairs(5, Pair{-1.0, 2.0});
  CHECK(harmful_parts(results_of(pairs)).empty());
  pairs.push_back({-1.0, 2.0});
  pairs.push_back({2.0, 2.0});
  const auto lines = harmful_parts(results_of(pairs));
  REQUIRE(lines.size() == 1);
  CHECK(lines[0] ==
        "p: reaches 1 of 7 goals, and 7 with turn=false (McNemar p = 0.031), expected "
        "no part to reduce success");
  for (auto& pair : pairs) std::swap(pair.with_s, pair.without_s);
  CHECK(harmful_parts(results_of(pairs)).empty());
}

TEST_CASE("results without ablations have no table of them", "[bench][unit]") {
  Results results = results_of(study());
  results.by_family.sweeps.ablations.clear();
  results.ablations.clear();
  CHECK(to_json(results)["ablations"] == Json::array());
  CHECK_THAT(to_table(results, false), !Catch::Contains("ablation"));
}
