#include <catch2/catch.hpp>
#include <string>

#include "hamelin/core/error.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;

TEST_CASE("the README's example of a schema names the misspelt key", "[io][unit]") {
  // clang-format off
  // [example]
const Json schema = parse_json(
    R"({"type": "object", "additionalProperties": false,
        "properties": {"step_s": {"type": "number", "exclusiveMinimum": 0, "default": 0.001}}})",
    "schema");
std::string message;
try {
  check_schema(parse_json(R"({"stp_s": 0.01})", "scene.json"), schema, "scene.json");
} catch (const Error& error) {
  message = error.what();  // scene.json: /: unknown key 'stp_s'; did you mean 'step_s'?
}
const Json complete = with_defaults(Json::object(), schema);  // {"step_s": 0.001}
  // [example]
  // clang-format on
  CHECK(message == "scene.json: /: unknown key 'stp_s'; did you mean 'step_s'?");
  CHECK(complete.dump() == R"({"step_s":0.001})");
  test::check_readme_example("libs/io");
}
