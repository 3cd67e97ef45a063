#include <catch2/catch.hpp>
#include <filesystem>
#include <string>

#include "../program.hpp"

using namespace hamelin;
using Catch::Matchers::Contains;
using test::Sandbox;

TEST_CASE("a report is one self-contained file, small enough to send", "[end_to_end][report]") {
  test::require_pages();
  Sandbox sandbox;
  // This run takes the full 30 s, because apf as published does not reach the goal.
  REQUIRE(sandbox
              .run({"run", "data/scenes/shelf.json", "--planner", "apf", "--set",
                    "/planner/params/algorithm=published", "--log", "apf.jsonl.zst"})
              .exit_code == 1);
  REQUIRE(sandbox.run({"run", "data/scenes/shelf.json", "--log", "hybrid.jsonl"}).exit_code == 0);
  REQUIRE(sandbox.run({"report", "apf.jsonl.zst", "-o", "one.html"}).exit_code == 0);
  const auto both = sandbox.run({"report", "apf.jsonl.zst", "hybrid.jsonl", "-o", "both.html"});
  REQUIRE(both.exit_code == 0);
  CHECK_THAT(both.out,
             Contains("apf: timeout") && Contains("hybrid: reached") && Contains("both.html"));
  const std::string page = sandbox.text("one.html");
  CHECK(page.size() <= 1'500'000);
  // The page fetches nothing: its policy forbids it, and no element refers to another file.
  CHECK_THAT(page, Contains("default-src 'none'"));
  CHECK(page.find("<script src") == std::string::npos);
  CHECK(page.find("<link ") == std::string::npos);
  // The same logs give the same bytes.
  REQUIRE(sandbox.run({"report", "apf.jsonl.zst", "-o", "again.html"}).exit_code == 0);
  CHECK(sandbox.text("again.html") == page);
}

TEST_CASE("free motion and a truncated log can be reported", "[end_to_end][report]") {
  test::require_pages();
  Sandbox sandbox;
  REQUIRE(
      sandbox
          .run({"integrate", "data/robots/planar3.json", "--step", "0.01", "--log", "fall.jsonl"})
          .exit_code == 0);
  const std::string log = sandbox.text("fall.jsonl");
  sandbox.put("cut.jsonl", log.substr(0, log.size() / 2));
  const auto output = sandbox.run({"report", "fall.jsonl", "cut.jsonl", "-o", "fall.html"});
  CHECK(output.exit_code == 0);
  CHECK_THAT(output.out, Contains("completed") && Contains("unfinished"));
}

TEST_CASE("report refuses files that are not logs with one line, and writes no page",
          "[end_to_end][report]") {
  test::require_pages();
  Sandbox sandbox;
  sandbox.put("empty.jsonl", "");
  sandbox.put("noise.jsonl", "{\"type\":\"header\"}\n");
  REQUIRE(
      sandbox
          .run({"integrate", "data/robots/planar3.json", "--step", "0.01", "--log", "fall.jsonl"})
          .exit_code == 0);
  const std::vector<std::vector<std::string>> wrong = {
      {"data/scenes/shelf.json", "-o", "page.html"},
      {"data/maps/shelf.bt", "-o", "page.html"},
      {"empty.jsonl", "-o", "page.html"},
      {"noise.jsonl", "-o", "page.html"},
      {"absent.jsonl", "-o", "page.html"},
      {"fall.jsonl", "absent.jsonl", "-o", "page.html"},
      {"fall.jsonl", "-o", "absent/page.html"},
      {"fall.jsonl", "-o", "fall.jsonl"},
      {"fall.jsonl", "-o", "data"},
      {"fall.jsonl"}};
  const std::string log = sandbox.text("fall.jsonl");
  for (auto arguments : wrong) {
    arguments.insert(arguments.begin(), "report");
    CAPTURE(arguments);
    const auto output = sandbox.run(arguments);
    CHECK(output.exit_code == 2);
    CHECK(test::lines_of(output.err).size() == 1);
    CHECK_FALSE(sandbox.has("page.html"));
  }
  CHECK(sandbox.text("fall.jsonl") == log);
}
