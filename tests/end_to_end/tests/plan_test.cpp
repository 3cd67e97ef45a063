#include <cmath>

#include "../program.hpp"
#include "hamelin/search/search.hpp"

using namespace hamelin;
using test::Sandbox;

namespace {

const std::vector<std::string> plan_shelf{"plan", "data/scenes/shelf.json", "--guide",
                                          "rrt-connect"};

std::vector<std::string> plan_with(std::vector<std::string> command,
                                   const std::vector<std::string>& more) {
  command.insert(command.end(), more.begin(), more.end());
  return command;
}

}  // namespace

TEST_CASE("plan writes a path per goal, which a scene can use", "[plan]") {
  Sandbox sandbox;
  const auto text = sandbox.run(plan_with(plan_shelf, {"-o", "path.json"}));
  CHECK(text.exit_code == 0);
  CHECK(text.err == "");
  CHECK_THAT(text.out, Catch::StartsWith("guide       rrt-connect, seed 1\n") &&
                           Catch::Contains("goal 5      pose: path of length") &&
                           Catch::Contains("proved to keep"));
  CHECK(sandbox.run({"validate", "path.json"}).exit_code == 0);
  const Json file = sandbox.json("path.json");
  Json again = test::run_json(sandbox, plan_shelf);
  REQUIRE(again["paths"].size() == 5);
  for (std::size_t i = 0; i < 5; ++i) {
    CHECK(again["paths"][i]["q"] == file["paths"][i]["q"]);
    CHECK(again["paths"][i]["certificate"]["smallest_m"].get<double>() > 0.005);
  }
  CHECK(test::run_json(sandbox, plan_with(plan_shelf, {"--seed", "2"}))["paths"][0]["q"] !=
        file["paths"][0]["q"]);

  const std::string goals = R"(/goals=[{"type": "path", "file": ")" +
                            sandbox.path("path.json").string() + R"(", "index": 0}])";
  const Json result = test::run_json(sandbox, {"run", "data/scenes/shelf.json", "--set", goals});
  CHECK(result["goal"]["type"] == "path");
  const Json end = file["paths"][0]["q"].back();
  for (std::size_t i = 0; i < end.size(); ++i)
    CHECK(std::abs(result["q"][i].get<double>() - end[i].get<double>()) < 0.05);
}

TEST_CASE("a guided run is replayed to the byte", "[plan]") {
  Sandbox sandbox;
  const auto run = sandbox.run({"run", "data/scenes/shelf.json", "--guide", "rrt-connect", "--log",
                                "run.jsonl.zst", "--every", "100"});
  CHECK(run.exit_code == 0);
  CHECK(sandbox.run({"replay", "run.jsonl.zst", "--verify"}).exit_code == 0);
}

TEST_CASE("plan has exit code 1 where there is no path", "[plan]") {
  Sandbox sandbox;
  const std::string unreachable = R"(/goals=[{"type": "position", "position_m": [5.0, 0.0, 0.5]}])";
  const Json plan = test::run_json(sandbox, plan_with(plan_shelf, {"--set", unreachable}), 1);
  CHECK(plan["paths"][0]["found"] == false);
  CHECK(plan["paths"][0]["cause"] == "no clear configuration was found at the goal");
  CHECK(plan["paths"][0]["certificate"].is_null());
  CHECK(sandbox.run(plan_with(plan_shelf, {"--checks", "1"})).exit_code == 1);
}

TEST_CASE("bad input of plan and of paths ends in one line", "[plan]") {
  Sandbox sandbox;
  const auto error = [&](const std::vector<std::string>& command) {
    const auto output = sandbox.run(command);
    CHECK(output.exit_code == 2);
    CHECK(output.out == "");
    CHECK(test::lines_of(output.err).size() == 1);
    return output.err;
  };
  CHECK(error({"plan", "data/scenes/shelf.json", "--guide", "none"}) ==
        "hamelin: data/scenes/shelf.json: /planner/guide: is none, expected on-request or "
        "rrt-connect\n");
  CHECK_THAT(error({"plan", "data/scenes/shelf.json", "--guide", "rrt-conect"}),
             Catch::Contains("rrt-connect"));
  CHECK_THAT(error({"plan", "data/scenes/follow_shelf.json", "--guide", "rrt-connect"}),
             Catch::Contains("/goals/0: follows a target"));
  const auto path_goal = [&](const std::string& file, int index) {
    return std::vector<std::string>{"run", "data/scenes/shelf.json", "--set",
                                    R"(/goals=[{"type": "path", "file": ")" +
                                        sandbox.path(file).string() + R"(", "index": )" +
                                        std::to_string(index) + "}]"};
  };
  CHECK_THAT(error(path_goal("none.json", 0)), Catch::Contains("none.json: cannot be opened"));
  sandbox.put("path.json",
              R"({"schema": "hamelin.path/1", "joints": ["j"], "paths": [{"q": [[0, 0]]}]})");
  CHECK_THAT(error(path_goal("path.json", 3)),
             Catch::Contains("path.json: /paths/3: has no way-points, expected a path that was "
                             "found"));
  CHECK_THAT(error(path_goal("path.json", 0)), Catch::Contains("2 values given, expected 7"));
}
