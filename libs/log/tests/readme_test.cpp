#include <catch2/catch.hpp>
#include <filesystem>

#include "hamelin/log/provenance.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/log/result.hpp"
#include "hamelin/log/run_log.hpp"
#include "hamelin/test/readme.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;

TEST_CASE("the README's example writes a valid log", "[log][unit]") {
  const auto file = test::temporary("readme.jsonl");
  // clang-format off
  // [example]
{
  log::RunLog run(file);
  run.write("header", {{"program", "integrate"}, {"scene", "spring.json"}, {"every", 1},
                       {"joints", Json::array()}, {"config", {{"step_s", 0.001}}},
                       {"provenance", log::provenance({})}});
  run.write("event", {{"time_s", 0.0}, {"text", "a spring is attached"}});
  log::Result result;
  result.scene = "spring.json";
  result.integrator = "rk4";
  result.outcome = log::Outcome::stalled;
  run.write("result", log::to_json(result));
}
const log::LogSummary found = log::check_log(file);  // throws, naming the line, if it is not a log
const int code = log::exit_code(log::Outcome::stalled);
  // [example]
  // clang-format on
  CHECK(found.events == 1);
  CHECK(found.has_result);
  CHECK_FALSE(found.cut);
  CHECK(code == 1);
  test::check_readme_example("libs/log");
}
