#include "hamelin/io/json.hpp"

#include <catch2/catch.hpp>
#include <iterator>

#include "hamelin/core/error.hpp"

using namespace hamelin;

namespace {

// The message of the error, which must be one line and have that code.
template <class F>
std::string refusal(ErrorCode code, F&& f) {
  try {
    f();
  } catch (const Error& error) {
    CHECK(error.code() == code);
    CHECK(std::string(error.what()).find('\n') == std::string::npos);
    return error.what();
  }
  FAIL("nothing was thrown");
  return "";
}

}  // namespace

TEST_CASE("a parse error names file, line and column", "[io][unit]") {
  const auto parse = [](const std::string& text) {
    return refusal(ErrorCode::parse, [&] { (void)parse_json(text, "a.json"); });
  };
  CHECK_THAT(parse("{\n  \"a\": 1,\n  \"b\": ?\n}"),
             Catch::StartsWith("a.json: line 3, column 8: not JSON"));
  CHECK_THAT(parse("[1, 2"), Catch::StartsWith("a.json: line 1, column"));
  CHECK_THAT(parse(""), Catch::StartsWith("a.json: line 1, column 1: not JSON"));
  CHECK_THAT(parse("[1] ?"), Catch::StartsWith("a.json: line 1, column 5"));
  CHECK_THAT(parse("[1e400]"), Catch::StartsWith("a.json: not JSON"));
  CHECK_THAT(parse("{\"a\": \"\xff\"}"), Catch::StartsWith("a.json: line 1, column"));
}

TEST_CASE("a text that need not be JSON is tried without an error", "[io][unit]") {
  CHECK(try_parse_json("{\"a\": 1}")["a"] == 1);
  CHECK(try_parse_json("null").is_null());
  CHECK(try_parse_json("planner died").is_discarded());
  CHECK(try_parse_json("").is_discarded());
}

TEST_CASE("a key given twice is refused at any depth, equal keys of different objects are not",
          "[io][unit]") {
  CHECK_THAT(
      refusal(ErrorCode::parse, [] { (void)parse_json(R"({"a": 1, "b": 2, "a": 3})", "a.json"); }),
      Catch::Contains("a.json: key 'a' is given twice"));
  CHECK_THAT(refusal(ErrorCode::parse,
                     [] { (void)parse_json(R"([{"x": {"in": 1, "in": 1}}])", "a.json"); }),
             Catch::Contains("'in'"));
  CHECK_NOTHROW(parse_json(R"([{"a": {"a": 1}}, {"a": 2}])", "a.json"));
}

TEST_CASE("lists and objects nested deeper than a hundred are refused", "[io][unit]") {
  const auto nested = [](std::size_t depth, std::size_t closed) {
    return std::string(depth, '[') + std::string(closed, ']');
  };
  CHECK_NOTHROW(parse_json(nested(100, 100), "a.json"));
  CHECK_THAT(refusal(ErrorCode::parse, [&] { (void)parse_json(nested(101, 101), "a.json"); }),
             Catch::StartsWith("a.json: lists and objects nest deeper than 100"));
  CHECK_THAT(refusal(ErrorCode::parse, [&] { (void)parse_json(nested(1000000, 0), "a.json"); }),
             Catch::Contains("nest deeper"));
}

// If time grew with the square of these sizes, this test would not end.
TEST_CASE("long lists of objects and objects of many keys are read", "[io][unit]") {
  constexpr std::size_t count = 200000;
  std::string list = "[{}", object = "{\"k\": 0";
  for (std::size_t i = 1; i < count; ++i) {
    list += ",{}";
    object += ",\"k" + std::to_string(i) + "\":" + std::to_string(i);
  }
  CHECK(parse_json(list + "]", "a.json").size() == count);
  const Json read = parse_json(object + "}", "a.json");
  REQUIRE(read.size() == count);
  CHECK(std::prev(read.end()).key() == "k199999");
  CHECK_THAT(refusal(ErrorCode::parse, [&] { (void)parse_json(object + ",\"k7\":0}", "a.json"); }),
             Catch::Contains("key 'k7' is given twice"));
}

TEST_CASE("numbers, literals, strings and empty containers are read unchanged", "[io][unit]") {
  const char* text =
      R"({"a":[1,-2,18446744073709551615,0.5,true,false,null,"x",[],{}],"b":{"c":{}}})";
  CHECK(parse_json(text, "a.json").dump() == text);
  CHECK(parse_json("7", "a.json") == 7);
}

TEST_CASE("keys keep the order in which they were written", "[io][unit]") {
  CHECK(parse_json(R"({"z": 1, "a": 2, "m": 3})", "").dump() == R"({"z":1,"a":2,"m":3})");
}
