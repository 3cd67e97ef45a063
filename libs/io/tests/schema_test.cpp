#include <fmt/format.h>

#include <catch2/catch.hpp>

#include "hamelin/core/error.hpp"
#include "hamelin/io/json.hpp"

using namespace hamelin;

namespace {

const Json schema = Json::parse(R"({
  "type": "object",
  "additionalProperties": false,
  "required": ["name", "arm"],
  "properties": {
    "name": {"type": "string"},
    "step_s": {"type": "number", "exclusiveMinimum": 0, "default": 0.001},
    "mode": {"type": "string", "enum": ["ideal", "sampled"], "default": "ideal"},
    "arm": {
      "type": "object",
      "additionalProperties": false,
      "required": ["file"],
      "properties": {
        "file": {"type": "string"},
        "scale": {"type": "number", "default": 1},
        "q": {"type": "array", "items": {"type": "number"}, "maxItems": 3}
      }
    }
  }
})");

std::string refusal(const std::string& document, const Json& by = schema) {
  try {
    check_schema(Json::parse(document), by, "a.json");
  } catch (const Error& error) {
    CHECK(error.code() == ErrorCode::invalid);
    CHECK(std::string(error.what()).find('\n') == std::string::npos);
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("a document that fits its schema passes", "[io][unit]") {
  CHECK(refusal(R"({"name": "a", "arm": {"file": "f", "q": [1, 2.5]}, "step_s": 1})").empty());
}

TEST_CASE("an unknown key is named with its place and the key that was probably meant",
          "[io][unit]") {
  CHECK(refusal(R"({"name": "a", "arm": {"file": "f"}, "stp_s": 1})") ==
        "a.json: /: unknown key 'stp_s'; did you mean 'step_s'?");
  CHECK(refusal(R"({"name": "a", "arm": {"file": "f", "scal": 1}})") ==
        "a.json: /arm: unknown key 'scal'; did you mean 'scale'?");
  CHECK_THAT(refusal(R"({"name": "a", "arm": {"file": "f", "colour": 1}})"),
             Catch::StartsWith("a.json: /arm: unknown key 'colour', expected one of ") &&
                 Catch::Contains("scale"));
}

TEST_CASE("a missing key is named with the object that lacks it", "[io][unit]") {
  CHECK(refusal(R"({"arm": {"file": "f"}})") == "a.json: /: key 'name' is missing");
  CHECK(refusal(R"({"name": "a", "arm": {}})") == "a.json: /arm: key 'file' is missing");
}

TEST_CASE("a wrong type or value is shown with what was expected", "[io][unit]") {
  CHECK(refusal(R"({"name": 7, "arm": {"file": "f"}})") ==
        "a.json: /name: 7 is not allowed, expected type string");
  CHECK(refusal(R"({"name": "a", "arm": {"file": "f"}, "step_s": 0})") ==
        "a.json: /step_s: 0 is not allowed, expected type number, above 0");
  CHECK_THAT(refusal(R"({"name": "a", "arm": {"file": "f"}, "mode": "idle"})"),
             Catch::StartsWith("a.json: /mode: \"idle\" is not allowed") &&
                 Catch::Contains(R"(["ideal","sampled"])"));
  CHECK_THAT(refusal(R"({"name": "a", "arm": {"file": "f", "q": [1, "x"]}})"),
             Catch::StartsWith("a.json: /arm/q/1: \"x\" is not allowed, expected type number"));
  CHECK_THAT(refusal(R"({"name": "a", "arm": {"file": "f", "q": [1, 2, 3, 4]}})"),
             Catch::StartsWith("a.json: /arm/q: "));
  CHECK_THAT(refusal("[]"),
             Catch::StartsWith("a.json: /: [] is not allowed, expected type object"));
}

TEST_CASE("an unknown key is named with its hint in a schema with references, too", "[io][unit]") {
  const Json referring = Json::parse(R"({
    "type": "object",
    "properties": {"links": {"type": "array", "items": {"$ref": "#/definitions/link"}}},
    "definitions": {"link": {"type": "object", "additionalProperties": false, "properties": {"mass_kg": {"type": "number"}}}}
  })");
  CHECK(refusal(R"({"links": [{"mass_kg": 1}, {"mas_kg": 1}]})", referring) ==
        "a.json: /links/1: unknown key 'mas_kg'; did you mean 'mass_kg'?");
}

TEST_CASE("the first fault of a long list is named at any position", "[io][unit]") {
  const Json numbers =
      Json::parse(R"({"type": "array", "items": {"type": "number"}, "maxItems": 100000})");
  for (const std::size_t at : {0U, 999U, 1000U, 4321U, 99999U}) {
    CAPTURE(at);
    Json list = std::vector<double>(100000, 0.5);
    list[at] = "x";
    list.back() = "y";
    const std::string value = at == 99999 ? "y" : "x";
    CHECK(refusal(list.dump(), numbers) ==
          fmt::format("a.json: /{}: \"{}\" is not allowed, expected type number", at, value));
  }
  CHECK_THAT(refusal(Json(std::vector<double>(100001, 0.5)).dump(), numbers),
             Catch::Contains("at most 100000 items"));
}

TEST_CASE("a schema compiled once checks many documents", "[io][unit]") {
  const Schema compiled(schema, "schema.json");
  const Schema copy = compiled;
  CHECK_NOTHROW(compiled.check(Json::parse(R"({"name": "a", "arm": {"file": "f"}})"), "a.json"));
  CHECK_THROWS_WITH(copy.check(Json::parse(R"({"name": "a"})"), "b.json"),
                    "b.json: /: key 'arm' is missing");
  CHECK_THROWS_WITH(Schema(Json::parse(R"({"type": 12})"), "s.json"),
                    Catch::StartsWith("s.json: its JSON Schema"));
}

TEST_CASE("a file of another kind is refused as such, whatever else is wrong", "[io][unit]") {
  CHECK_THROWS_WITH(
      check_shipped_schema({{"schema", "hamelin.scene/1"}, {"robot", {{"file", "a.urdf"}}}},
                           "problems", "shelf.json"),
      "shelf.json: /schema: \"hamelin.scene/1\" is not allowed, expected exactly "
      "hamelin.problems/1");
}

TEST_CASE("a long value is cut and one with line breaks stays on one line", "[io][unit]") {
  const std::string text = refusal(
      Json{{"name", Json::array({std::string(500, 'x') + "\n"})}, {"arm", {{"file", "f"}}}}.dump());
  CHECK_THAT(text, Catch::Contains("..."));
  CHECK(text.size() < 200);
}

TEST_CASE("an invalid schema is an error and does not end the program", "[io][unit]") {
  CHECK_THAT(refusal("{}", Json::parse(R"({"type": 12})")),
             Catch::Contains("its JSON Schema cannot be used"));
  CHECK_THAT(refusal("{}", Json::parse(R"({"properties": [1]})")),
             Catch::Contains("its JSON Schema cannot be used"));
  CHECK_THAT(refusal("{}", Json::parse(R"({"$ref": "#/nowhere"})")),
             Catch::Contains("its JSON Schema cannot be used"));
}

TEST_CASE("defaults are filled in at every depth and never replace given values", "[io][unit]") {
  const Json filled = with_defaults(
      Json::parse(R"({"name": "a", "arm": {"file": "f"}, "mode": "sampled"})"), schema);
  CHECK(filled["step_s"] == 0.001);
  CHECK(filled["mode"] == "sampled");
  CHECK(filled["arm"]["scale"] == 1);
  CHECK_FALSE(filled["arm"].contains("q"));
  CHECK(with_defaults(filled, schema) == filled);
  // "arm" has no default of its own.
  CHECK_FALSE(with_defaults(Json::parse(R"({"name": "a"})"), schema).contains("arm"));
}

TEST_CASE("the shipped schemas are found by name, and each is usable", "[io][unit]") {
  for (const char* name : {"scene", "robot", "integrator", "primitives", "result", "run"}) {
    CAPTURE(name);
    REQUIRE_FALSE(schema_text(name).empty());
    CHECK(shipped_schema(name)["$schema"] == "http://json-schema.org/draft-07/schema#");
    CHECK_THROWS_WITH(check_shipped_schema(Json(7), name, "a.json"),
                      Catch::StartsWith("a.json: /"));
  }
  CHECK(schema_text("nothing").empty());
  CHECK_THROWS_WITH(shipped_schema("nothing"), "no schema 'nothing' is shipped");
  CHECK_THROWS_AS(check_shipped_schema(Json::object(), "nothing", "a.json"), Error);
}
