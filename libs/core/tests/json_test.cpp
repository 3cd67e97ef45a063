#include "hamelin/core/json.hpp"

#include <catch2/catch.hpp>

#include "hamelin/core/error.hpp"

using namespace hamelin;

namespace {

// The error's text, which must be one line and of that kind.
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

TEST_CASE("a parse error names file, line and column", "[core][unit]") {
  const auto parse = [](const std::string& text) {
    return refusal(ErrorCode::parse, [&] { (void)parse_json(text, "a.json"); });
  };
  CHECK_THAT(parse("{\n  \"a\": 1,\n  \"b\": ?\n}"), Catch::StartsWith("a.json: line 3, column 8: not JSON"));
  CHECK_THAT(parse("[1, 2"), Catch::StartsWith("a.json: line 1, column"));
  CHECK_THAT(parse(""), Catch::StartsWith("a.json: line 1, column 1: not JSON"));
  CHECK_THAT(parse("[1] ?"), Catch::StartsWith("a.json: line 1, column 5"));
  CHECK_THAT(parse("[1e400]"), Catch::StartsWith("a.json: not JSON"));
  CHECK_THAT(parse("{\"a\": \"\xff\"}"), Catch::StartsWith("a.json: line 1, column"));
}

TEST_CASE("a key given twice is refused at any depth, equal keys of different objects are not", "[core][unit]") {
  CHECK_THAT(refusal(ErrorCode::parse, [] { (void)parse_json(R"({"a": 1, "b": 2, "a": 3})", "a.json"); }),
             Catch::Contains("a.json: key 'a' is given twice"));
  CHECK_THAT(refusal(ErrorCode::parse, [] { (void)parse_json(R"([{"x": {"in": 1, "in": 1}}])", "a.json"); }),
             Catch::Contains("'in'"));
  CHECK_NOTHROW(parse_json(R"([{"a": {"a": 1}}, {"a": 2}])", "a.json"));
}

TEST_CASE("keys keep the order in which they were written", "[core][unit]") {
  CHECK(parse_json(R"({"z": 1, "a": 2, "m": 3})", "").dump() == R"({"z":1,"a":2,"m":3})");
}

TEST_CASE("the nearest name is one within a third of its letters, or none", "[core][unit]") {
  const std::vector<std::string> names{"duration_s", "step_s", "seed"};
  CHECK(nearest_name("duraton_s", names) == "duration_s");
  CHECK(nearest_name("sdee", {"sxex", "step_s"}).empty());  // two changes in four letters
  CHECK(nearest_name("sed", names) == "seed");
  CHECK(nearest_name("gravity", names).empty());
  CHECK(nearest_name("step_s", names) == "step_s");
  CHECK(nearest_name("", names).empty());
  CHECK(nearest_name("x", {}).empty());
}

TEST_CASE("two neighbours swapped are one slip, and capitals none", "[core][unit]") {
  CHECK(nearest_name("sede", {"seed", "step_s"}) == "seed");
  CHECK(nearest_name("rnu", {"run", "robot"}) == "run");
  CHECK(nearest_name("--setp", {"--set", "--step", "--seed"}) == "--set");  // one slip from both: the first
  CHECK(nearest_name("RK4", {"hamel", "rk4"}) == "rk4");
  CHECK(nearest_name("abcd", {"badc"}).empty());  // two swaps in four letters
}

TEST_CASE("no name is near that shares less than half of its letters", "[core][unit]") {
  CHECK(nearest_name("x", {"y"}).empty());
  CHECK(nearest_name("q0", {"v0"}).empty());
  CHECK(nearest_name("a", {"ab"}).empty());
  CHECK(nearest_name("rn", {"run"}) == "run");
}
