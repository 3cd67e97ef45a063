#include "hamelin/sweep/compare.hpp"

#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/sweep/csv.hpp"
#include "hamelin/sweep/page.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;
using namespace hamelin::sweep;

namespace {

Json record(const std::string& outcome, double time_s) {
  return {
      {"outcome", outcome},
      {"cause", outcome == "reached" ? Json(nullptr) : Json("joint limit: joint 'a'")},
      {"result",
       {{"outcome", outcome},
        {"time_s", time_s},
        {"certified_share", 0.5},
        {"timing", {{"tick_us", {{"p50", 1.23456789}, {"p99", 4.0}}}}}}},
      {"judge",
       {{"contact", false},
        {"obstacles", {{"clearance_m", 0.01}, {"time_s", 1.0}, {"sphere", "a"}, {"other", "map"}}},
        {"self", nullptr}}}};
}

MergedRun made(const std::string& directory, const std::string& problem, const std::string& planner,
               const Json& record, bool feasible = true) {
  MergedRun merged;
  merged.run.id = problem + "/" + planner + "/s1";
  merged.run.scene = "scenes/" + problem + ".json";
  merged.run.planner = planner;
  merged.run.labels = {{"planner", planner}, {"problem", problem}, {"seed", "1"}};
  merged.directory = directory;
  merged.feasible = feasible;
  merged.facts = facts_of(record);
  return merged;
}

/// Eight scenes under two planners; p reaches all but two, q is 0.5 s later and reaches four.
std::vector<MergedRun> study() {
  std::vector<MergedRun> runs;
  for (int k = 0; k < 8; ++k) {
    const std::string problem = "s" + std::to_string(k);
    runs.push_back(made("d", problem, "p", record(k < 6 ? "reached" : "stalled", 1.0 + k)));
    runs.push_back(
        made("d", problem, "q", record(k % 2 == 0 ? "reached" : "stalled", 1.5 + 1.1 * k)));
  }
  return runs;
}

}  // namespace

TEST_CASE("planners are compared on the scenes that both ran", "[sweep][unit]") {
  auto runs = study();
  runs.push_back(made("d", "alone", "p", record("reached", 1.0)));
  runs.push_back(made("d", "unfeasible", "p", record("stalled", 1.0), false));
  runs.push_back(made("d", "unfeasible", "q", record("reached", 1.0), false));
  runs.push_back(made("d", "missing", "p", record("reached", 1.0)));
  runs.push_back(made("d", "missing", "q", Json()));
  const auto all = compare_values(runs);
  REQUIRE(all.size() == 1);
  const Comparison& c = all[0];
  CHECK(c.a == "p");
  CHECK(c.b == "q");
  CHECK(c.pairs == 8);
  CHECK(c.without == 4);
  CHECK(c.both == 3);    // 0, 2, 4
  CHECK(c.only_a == 3);  // 1, 3, 5
  CHECK(c.only_b == 1);  // 6
  CHECK(c.neither == 1);
  CHECK(c.difference() == 0.25);
  CHECK(c.reached_p == mcnemar_p(3, 1));
  CHECK(c.difference_interval.low == tango_interval(8, 3, 1).low);
  CHECK(c.times.used == 3);
  CHECK(c.times.p == Approx(0.25));
  CHECK(c.time_difference_s->estimate == Approx(-0.7));  // of -0.5, -0.7, -0.9
  const Json json = to_json(all);
  check_shipped_schema(json, "comparison", "compared");
  CHECK(json["comparisons"][0]["reached"]["only_a"] == 3);
  CHECK(json["comparisons"][0]["arrival"]["difference_interval_s"].is_null());
  CHECK_THAT(to_text(all), Catch::Contains("p against q: 8 pairs") &&
                               Catch::Contains("only p 3, only q 1, neither 1") &&
                               Catch::Contains("+25.0 %") && Catch::Contains("4 runs without"));
}

TEST_CASE("ablations are compared in their own order, with contacts, and stand first on the page",
          "[sweep][unit]") {
  Sweeps sweeps;
  sweeps.runs = study();
  sweeps.runs[1].facts.judge_saw_contact = true;  // of q
  sweeps.ablations = {{"q", "p", "x", false}, {"p", "absent", "y", 0}};
  const auto all = compare_ablations(sweeps);
  REQUIRE(all.size() == 2);
  CHECK(all[0].a == "q");
  CHECK(all[0].pairs == 8);
  CHECK(all[0].only_a == 1);
  CHECK(all[0].only_b == 3);
  CHECK(all[0].contacts_a == 1);
  CHECK(all[0].contacts_b == 0);
  CHECK_THAT(to_text(all), Catch::Contains("contact     q 1, p 0"));
  CHECK(all[1].pairs == 0);
  CHECK(all[1].without == 8);
  check_shipped_schema(to_json(all), "comparison", "ablations");
  const auto shown = comparisons_of_page(sweeps);
  REQUIRE(shown.size() == 2);
  CHECK_THAT(shown[0].first, Catch::StartsWith("Ablations"));
  CHECK(shown[0].second.size() == 2);
  CHECK(shown[1].first == "Planners");
  sweeps.ablations.clear();
  CHECK(compare_ablations(sweeps).empty());
}

TEST_CASE("only so many values of a label are compared, and unknown labels are refused",
          "[sweep][unit]") {
  auto runs = study();
  for (int k = 0; k < 8; ++k)
    runs.push_back(made("d", "s" + std::to_string(k), "r", record("reached", 1.0)));
  CHECK(compare_values(runs).size() == 3);
  CHECK(compare_values(runs, {}, 2).size() == 1);
  CHECK_THROWS_WITH(
      compare_values(runs, {"colour", {}}),
      "--label colour: no run has that label, expected one of planner, problem, seed");
  CHECK_THROWS_WITH(compare_values(runs, {"planner", {"hue"}}),
                    "--ignore hue: no run has that label, expected one of planner, problem, seed");
  runs.push_back(made("d", "s0", "p", record("reached", 1.0)));
  CHECK_THROWS_WITH(compare_values(runs), Catch::Contains("have the same labels"));
}

TEST_CASE("two sweeps are compared run by run, also under different planners", "[sweep][unit]") {
  const test::TemporaryFolder folder;
  std::vector<MergedRun> runs;
  for (const char* side : {"a", "b"}) {
    Plan plan;
    const bool first = side[0] == 'a';
    for (const char* problem : {"s0", "s1", "s2"}) {
      const std::string digit =
          !first && std::string(problem) == "s2" ? "1" : "0";  // another scene
      plan.scenes.push_back(
          {std::string("scenes/") + problem + ".json", std::string(64, digit[0]), true, ""});
      auto run =
          made((folder.path() / side).string(), problem, first ? "old" : "new",
               record(first && problem[1] == '1' ? "stalled" : "reached", first ? 2.0 : 1.0));
      plan.runs.push_back(run.run);
      runs.push_back(std::move(run));
    }
    std::filesystem::create_directories(folder.path() / side);
    write_plan(plan, folder.path() / side);
  }
  const Comparison c = compare_sweeps(runs, folder.path() / "a", folder.path() / "b");
  CHECK(c.pairs == 3);
  CHECK(c.both == 2);
  CHECK(c.only_b == 1);
  CHECK(c.other_scenes == 1);
  CHECK(c.time_difference_s->estimate == 1.0);
  // with two planners in one sweep, runs of the same planner are paired
  runs.push_back(made((folder.path() / "a").string(), "s0", "new", record("reached", 1.0)));
  const Comparison same = compare_sweeps(runs, folder.path() / "a", folder.path() / "b");
  CHECK(same.pairs == 1);
  CHECK(same.without == 5);
}

TEST_CASE("the CSV has a line per run, with quoted fields", "[sweep][unit]") {
  Sweeps sweeps;
  Json stalled = record("stalled", 2.5);
  stalled["cause"] = "ran into \"it\",\ntwice";
  sweeps.runs.push_back(made("a dir", "s0", "p", stalled));
  sweeps.runs.push_back(made("a dir", "s1", "p", Json(), false));
  sweeps.runs[0].run.set = {"/duration_s=9", "/planner/params/x=1", "/planner/params/name=a, b"};
  sweeps.runs[0].run.labels["values"] = "/planner/params/x=1 /planner/params/name=a, b";
  sweeps.runs[0].run.gains = {{"k_p", 0.25}};
  sweeps.runs[1].reason = "start in the map";
  std::string csv;
  write_csv(sweeps, [&csv](std::string_view line) { csv += line; });
  CHECK(
      csv ==
      "id,directory,planner,problem,seed,values,/planner/params/name,/planner/params/x,k_p,"
      "feasible,reason,outcome,failure,cause,time_s,clearance_m,self_clearance_m,"
      "certified_share,tick_us_p50,tick_us_p99,judge\n"
      "s0/p/s1,a dir,p,s0,1,\"/planner/params/x=1 /planner/params/name=a, b\",\"a, b\",1,0.25,"
      "true,,stalled,\"stalled: ran into \"\"it\"\",\ntwice\",\"ran into \"\"it\"\",\ntwice\",2.5,"
      "0.01,,0.5,1.23456789,4,\n"
      "s1/p/s1,a dir,p,s1,1,,,,,false,start in the map,,,,,,,,,,\n");
}

TEST_CASE("varied values are those of the label, and none if they do not end the settings",
          "[sweep][unit]") {
  PlannedRun run;
  run.set = {"/a=1", "/b=x y", "/c=2"};
  CHECK(varied_values(run).empty());
  run.labels["values"] = "/b=x y /c=2";
  CHECK(varied_values(run) ==
        std::vector<std::pair<std::string, std::string>>{{"/b", "x y"}, {"/c", "2"}});
  run.labels["values"] = "/other=1";
  CHECK(varied_values(run).empty());
}

TEST_CASE("the page's JSON has all runs in columns", "[sweep][unit]") {
  Merged merged{{study(), {}, {}, {}, 0, {}, {}}, {"planner"}, {}, {}, {"a <note>"}};
  merged.groups = group(merged.sweeps.runs, merged.by);
  merged.sweeps.runs[2].run.gains = {{"k_p", 0.123456789}};
  merged.sweeps.runs[3].run.set = {"/planner/params/escape=it's"};
  merged.sweeps.runs[3].run.labels["values"] = "/planner/params/escape=it's";
  merged.sweeps.runs[4].facts = {};
  PageExtras extras;
  extras.replays[1] = {"pages/x.html", 1.5};
  extras.comparisons = comparisons_of_page(merged.sweeps);
  const Json page = page_json(merged, extras);
  CHECK(page["format"] == "hamelin.sweep-page/2");
  CHECK(page["directories"] == Json{"d"});
  CHECK(page["planned"] == 16);
  CHECK(page["recorded"] == 15);
  CHECK(page["summary"] == to_json(merged));
  const Json& runs = page["runs"];
  CHECK(runs["count"] == 16);
  CHECK(runs["id"][1] == "s0/q/s1");
  const auto text = [&](const char* kind, const char* name, std::size_t i) {
    const Json& column = runs[kind][name];
    const int at = column["index"][i];
    return at < 0 ? "" : column["values"][static_cast<std::size_t>(at)].get<std::string>();
  };
  CHECK(runs["texts"]["outcome"]["values"] == Json{"reached", "stalled"});
  CHECK(text("texts", "failure", 3) == "stalled: joint limit: joint '*'");
  CHECK(text("texts", "cause", 3) == "joint limit: joint 'a'");
  CHECK(text("texts", "outcome", 4).empty());
  CHECK(text("labels", "planner", 3) == "q");
  CHECK(text("texts", "scene", 3) == "d/scenes/s1.json");
  CHECK(text("texts", "arguments", 3) ==
        "--planner q --set '/planner/params/escape=it'\\''s' --seed 1");
  CHECK(text("varied", "/planner/params/escape", 3) == "it's");
  CHECK(text("varied", "/planner/params/escape", 2).empty());
  CHECK(runs["varied"]["/planner/params/escape"]["index"].size() == 16);
  CHECK(runs["gains"]["k_p"].size() == 16);
  CHECK(runs["gains"]["k_p"][2] == 0.123457);
  CHECK(runs["gains"]["k_p"][1].is_null());
  CHECK(runs["figures"]["time_s"][2] == 2.0);
  CHECK(runs["figures"]["time_s"][4].is_null());
  CHECK(runs["figures"]["tick_us_p50"][0] == 1.23457);
  CHECK(page["replays"] == Json{{"1", {{"file", "pages/x.html"}, {"time_s", 1.5}}}});
  CHECK(page["comparisons"][0]["title"] == "Planners");
  CHECK(page["comparisons"][0]["items"].size() == 1);
}
