#include <catch2/catch.hpp>
#include <string>

#include "hamelin/core/error.hpp"
#include "hamelin/core/json.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;

TEST_CASE("the README's example names the misspelt key", "[core][unit]") {
  // clang-format off
  // [example]
const Json schema = parse_json(R"({"type": "object", "additionalProperties": false,
    "properties": {"step_s": {"type": "number", "exclusiveMinimum": 0, "default": 0.001}}})", "schema");
std::string message;
try {
  check_schema(parse_json(R"({"stp_s": 0.01})", "scene.json"), schema, "scene.json");
} catch (const Error& error) {
  message = error.what();  // scene.json: /: unknown key 'stp_s', expected 'step_s'?
}
const Json complete = with_defaults(Json::object(), schema);  // {"step_s": 0.001}
Rng rng(1);
const double x = rng.uniform(-1.0, 1.0);  // 0.6232243177637695 everywhere
  // [example]
  // clang-format on
  CHECK(message == "scene.json: /: unknown key 'stp_s', expected 'step_s'?");
  CHECK(complete.dump() == R"({"step_s":0.001})");
  CHECK(x == 0.6232243177637695);
  test::check_readme_example("libs/core");
}
