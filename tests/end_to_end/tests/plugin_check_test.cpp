#include <string>

#include "../program.hpp"
#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using test::Sandbox;

namespace {

// The generous deadline keeps other programs on the machine out of the outcome.
Json checks_of(const std::string& plugin, const std::string& broken_rule, int exit_code,
               const std::string& deadline_s = "10", const std::string& timeout_s = "100") {
  const test::EnvironmentVariable variable("HAMELIN_TEST_BREAKS", broken_rule);
  Sandbox sandbox;
  return test::run_json(
      sandbox,
      {"plugins", "check", plugin, "--plugin-path", HAMELIN_TEST_ONLY_PLUGIN_DIR, "--deadline",
       deadline_s, "--timeout", timeout_s, "--scene", "data/scenes/paper_52_hybrid.json"},
      exit_code);
}

// The text of a check, by the beginning of its name. @return "" if it did not end with this outcome
std::string text_of(const Json& checks, const std::string& outcome, const std::string& name) {
  for (const auto& check : checks)
    if (check["check"].get<std::string>().starts_with(name) && check["outcome"] == outcome)
      return check["text"].is_null() ? "no text" : check["text"].get<std::string>();
  return "";
}

}  // namespace

TEST_CASE("plugins check passes for every planner of the project", "[end_to_end][plugins]") {
  Sandbox sandbox;
  for (const char* name : {"apf", "gyro", "hybrid", "template"}) {
    const auto output = sandbox.run({"plugins", "check", name, "--deadline", "10"});
    CAPTURE(name, output.out, output.err);
    CHECK(output.exit_code == 0);
    for (const char* line :
         {"ok       it loads: ", "ok       valid answers in the scene 'a pose goal'\n",
          "ok       valid answers in the scene 'shelf.json'\n",
          "ok       equal runs give equal answers\n", "ok       query handles are closed\n"})
      CHECK_THAT(output.out, Catch::Contains(line));
  }
}

TEST_CASE("plugins check passes for a planner that breaks no rule", "[end_to_end][plugins]") {
  for (const char* name : {"unruly", "unruly_declared"}) {
    const Json checks = checks_of(name, "none", 0);
    CAPTURE(checks.dump(1));
    CHECK_FALSE(text_of(checks, "ok", "valid answers in the scene 'paper_52_hybrid.json'").empty());
    // what was declared is not tested
    const std::string outcome = name == std::string("unruly") ? "ok" : "skipped";
    for (const char* check : {"equal runs give equal answers", "a reset repeats the run"})
      CHECK_FALSE(text_of(checks, outcome, check).empty());
  }
}

TEST_CASE("plugins check finds each broken rule", "[end_to_end][plugins]") {
  struct Case {
    const char *rule, *check, *text;
  };
  for (const Case& c : {
           Case{"description", "each parameter", "'gain' has no description, expected one"},
           {"type", "each parameter", "'gain' accepts any value, expected a type"},
           {"default", "the default parameters", "gain"},
           {"range", "it works with each parameter", "'gain' = 0: "},
           {"range of answers", "it works with each parameter", "tick 0: "},
           {"valid answers", "valid answers in the scene 'a joint goal'", "tick 0: "},
           {"valid answers", "it runs in at least one scene", "expected one"},
           {"scenes", "it runs in at least one scene", "expected one"},
           {"no crash", "valid answers in the scene 'a joint goal'", "signal 6"},
           {"no exit", "valid answers in the scene 'a joint goal'", "with exit code 0"},
           {"repetition", "equal runs", "two runs with the same seed"},
           {"reset", "a reset repeats the run", "after reset differ"},
           {"threads", "it starts no threads", "started 1 threads, expected none"},
           {"queries", "query handles are closed", "1 are open after its destruction"},
       }) {
    const Json checks = checks_of("unruly", c.rule, 1);
    CAPTURE(c.rule, checks.dump(1));
    CHECK_THAT(text_of(checks, "failed", c.check), Catch::Contains(c.text));
  }
}

TEST_CASE("plugins check finds threads that outlive the planner", "[end_to_end][plugins]") {
  CHECK_THAT(
      text_of(checks_of("unruly_declared", "end of threads", 1), "failed", "its threads end"),
      Catch::Contains("1 threads run on after its destruction"));
  CHECK_FALSE(text_of(checks_of("unruly_declared", "threads", 0), "ok", "its threads end").empty());
}

TEST_CASE("plugins check finds allocations in ticks that are not declared",
          "[end_to_end][plugins]") {
  test::require_allocation_count();
  CHECK_THAT(text_of(checks_of("unruly", "memory", 1), "failed", "ticks do not allocate"),
             Catch::Contains("the first in tick 0, expected none"));
  CHECK_FALSE(text_of(checks_of("unruly_declared", "memory", 0), "skipped", "ticks do not allocate")
                  .empty());
}

TEST_CASE("plugins check finds planners that are late or do not end", "[end_to_end][plugins]") {
  CHECK_THAT(text_of(checks_of("unruly", "deadline", 1, "0.005"), "failed", "ticks end before"),
             Catch::Contains("expected at most 5000 us"));
  CHECK_THAT(text_of(checks_of("unruly", "an end", 1, "10", "0.2"), "failed",
                     "valid answers in the scene 'a joint goal'"),
             Catch::Contains("did not end within 0.2 s"));
}

TEST_CASE("plugins check reports a plugin or a scene that cannot be read",
          "[end_to_end][plugins]") {
  Sandbox sandbox;
  sandbox.put("text.hamelin.so", "this is no library\n");
  sandbox.put("scene.json", "{}\n");
  for (const auto& arguments : {std::vector<std::string>{"plugins", "check", "./text.hamelin.so"},
                                {"plugins", "check", "gyro", "--scene", "scene.json"}}) {
    const auto output = sandbox.run(arguments);
    CAPTURE(output.err);
    CHECK(output.exit_code == 2);
    CHECK(test::lines_of(output.err).size() == 1);
    CHECK(output.out.empty());
  }
}
