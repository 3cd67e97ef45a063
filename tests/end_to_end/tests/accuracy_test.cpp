#include <algorithm>

#include "../program.hpp"

using namespace hamelin;
using test::Sandbox;

namespace {

const std::vector<std::string> measure = {"accuracy",      "data/robots/planar3.json",
                                          "--integrators", "hamel-variational,rk4,dop853",
                                          "--steps",       "0.1,0.05",
                                          "--rtol",        "1e-6",
                                          "--duration",    "1"};

std::vector<std::string> with(std::vector<std::string> command,
                              const std::vector<std::string>& more) {
  command.insert(command.end(), more.begin(), more.end());
  return command;
}

}  // namespace

TEST_CASE("accuracy writes a page and report combines several, or one line says why there is none",
          "[end_to_end]") {
  Sandbox sandbox;
  const auto measured = sandbox.run(with(measure, {"-o", "a.json", "--page", "a.html"}));
  CAPTURE(measured.err);
  if (!test::pages_were_built()) {
    CHECK(measured.exit_code == 2);
    CHECK(test::lines_of(measured.err).size() == 1);
    CHECK(measured.err.find("accuracy.html: is missing: the page was not built") !=
          std::string::npos);
    CHECK_FALSE(sandbox.has("a.json"));
    return;
  }
  CHECK(measured.exit_code == 0);
  const auto joined = sandbox.run({"report", "a.json", "a.json", "-o", "both.html"});
  CHECK(joined.exit_code == 0);
  for (const char* file : {"a.html", "both.html"}) {
    const std::string page = sandbox.text(file);
    CHECK(page.find("default-src 'none'") != std::string::npos);
    CHECK(page.find("<title>hamelin accuracy</title>") != std::string::npos);
    CHECK(page.find("<script src") == std::string::npos);
  }
  CHECK(sandbox.run({"report", "a.json", "data/scenes/shelf.json", "-o", "no.html"}).exit_code ==
        2);
}

TEST_CASE("accuracy prints and writes the same rows", "[end_to_end]") {
  Sandbox sandbox;
  const Json printed = test::run_json(sandbox, with(measure, {"-o", "a.json"}));
  CHECK(printed == sandbox.json("a.json"));
  REQUIRE(printed["rows"].size() == 7);
  for (const auto& row : printed["rows"]) {
    CHECK(row["outcome"] == "completed");
    CHECK(row["error_q"] < 0.1);
  }
  CHECK(sandbox.run({"validate", "a.json"}).out ==
        "a.json: ok (measurement of accuracy, 7 rows)\n");
  const auto table = sandbox.run(measure);
  CHECK(table.out.find("dop853, controlled") != std::string::npos);
  CHECK(sandbox.run(with(measure, {"--markdown"})).out.find("| hamel-variational") !=
        std::string::npos);
  CHECK(sandbox.run(with(measure, {"--markdown", "--json"})).exit_code == 2);
}

TEST_CASE("accuracy takes start, damping and duration of a scene, and notes what it ignores",
          "[end_to_end]") {
  Sandbox sandbox;
  const auto output = sandbox.run({"accuracy", "data/scenes/shelf.json", "--integrators", "rk4",
                                   "--steps", "0.01", "--duration", "0.1", "--json"});
  CHECK(output.exit_code == 0);
  CHECK(output.err.find("free motion ignores planner 'hybrid', the map") != std::string::npos);
}

TEST_CASE("accuracy refuses unusable options with one line", "[end_to_end]") {
  Sandbox sandbox;
  const std::vector<std::string> bare{"accuracy", "data/robots/planar3.json"};
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases{
      {{"--integrators", "rk5", "--steps", "0.1"}, "did you mean 'rk4'?"},
      {{"--integrators", "rk4"}, "neither --steps nor --rtol"},
      {{"--integrators", "", "--steps", "0.1"}, "--integrators"},
      {{"--integrators", "rk4", "--steps", ""}, "--steps: '' is not a number"},
      {{"--integrators", "rk4", "--steps", "0.3", "--duration", "1"},
       "not an integer multiple of the step 0.3 s"},
      {{"--integrators", "rk4", "--rtol", "1e-6"}, "has no step control"},
      {{"--integrators", "rk4:8", "--steps", "0.1"}, "'rk4' has one order"},
      {{"--integrators", "rk4", "--steps", "0.1", "--q0", "1,2"},
       "--q0: 2 values given, expected 3"},
      {{"--integrators", "rk4", "--steps", "0.1", "--page", "absent/a.html"}, "absent"},
      {{"--steps", "0.1"}, "--integrators"}};
  for (const auto& [arguments, expected] : cases) {
    CAPTURE(arguments);
    const auto output = sandbox.run(with(bare, arguments));
    CAPTURE(output.err);
    CHECK(output.exit_code == 2);
    CHECK(output.out.empty());
    CHECK(std::count(output.err.begin(), output.err.end(), '\n') == 1);
    CHECK(output.err.find(expected) != std::string::npos);
  }
}
