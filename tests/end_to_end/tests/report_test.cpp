#include <catch2/catch.hpp>
#include <filesystem>
#include <string>

#include "../program.hpp"

using namespace hamelin;
using Catch::Matchers::Contains;
using test::Bench;

TEST_CASE("a report is one file that needs no other, small enough to send", "[end_to_end][report]") {
  if (!test::pages_were_built()) return;
  Bench bench;
  // 30 s, for apf does not arrive
  REQUIRE(bench.run({"run", "data/scenes/shelf.json", "--planner", "apf", "--log", "apf.jsonl.zst"}).exit_code == 1);
  REQUIRE(bench.run({"run", "data/scenes/shelf.json", "--log", "hybrid.jsonl"}).exit_code == 0);
  REQUIRE(bench.run({"report", "apf.jsonl.zst", "-o", "one.html"}).exit_code == 0);
  const auto both = bench.run({"report", "apf.jsonl.zst", "hybrid.jsonl", "-o", "both.html"});
  REQUIRE(both.exit_code == 0);
  CHECK_THAT(both.out, Contains("apf: timeout") && Contains("hybrid: reached") && Contains("both.html"));
  const std::string page = bench.text("one.html");
  CHECK(page.size() <= 1'500'000);
  // nothing is fetched: the browser is told so, and no element asks for it
  CHECK_THAT(page, Contains("default-src 'none'"));
  CHECK(page.find("<script src") == std::string::npos);
  CHECK(page.find("<link ") == std::string::npos);
  // same logs, same bytes
  REQUIRE(bench.run({"report", "apf.jsonl.zst", "-o", "again.html"}).exit_code == 0);
  CHECK(bench.text("again.html") == page);
}

TEST_CASE("free motion, and a log cut short, have a report too", "[end_to_end][report]") {
  if (!test::pages_were_built()) return;
  Bench bench;
  REQUIRE(bench.run({"integrate", "data/robots/planar3.json", "--step", "0.01", "--log", "fall.jsonl"}).exit_code == 0);
  const std::string log = bench.text("fall.jsonl");
  bench.put("cut.jsonl", log.substr(0, log.size() / 2));
  const auto output = bench.run({"report", "fall.jsonl", "cut.jsonl", "-o", "fall.html"});
  CHECK(output.exit_code == 0);
  CHECK_THAT(output.out, Contains("completed") && Contains("unfinished"));
}

TEST_CASE("report refuses what is no log with one line and leaves no page", "[end_to_end][report]") {
  if (!test::pages_were_built()) return;
  Bench bench;
  bench.put("empty.jsonl", "");
  bench.put("noise.jsonl", "{\"type\":\"header\"}\n");
  REQUIRE(bench.run({"integrate", "data/robots/planar3.json", "--step", "0.01", "--log", "fall.jsonl"}).exit_code == 0);
  const std::vector<std::vector<std::string>> wrong = {{"data/scenes/shelf.json", "-o", "page.html"},
                                                       {"data/maps/shelf.bt", "-o", "page.html"},
                                                       {"empty.jsonl", "-o", "page.html"},
                                                       {"noise.jsonl", "-o", "page.html"},
                                                       {"absent.jsonl", "-o", "page.html"},
                                                       {"fall.jsonl", "absent.jsonl", "-o", "page.html"},
                                                       {"fall.jsonl", "-o", "absent/page.html"},
                                                       {"fall.jsonl", "-o", "fall.jsonl"},
                                                       {"fall.jsonl", "-o", "data"},
                                                       {"fall.jsonl"}};
  const std::string log = bench.text("fall.jsonl");
  for (auto arguments : wrong) {
    arguments.insert(arguments.begin(), "report");
    CAPTURE(arguments);
    const auto output = bench.run(arguments);
    CHECK(output.exit_code == 2);
    CHECK(test::lines_of(output.err).size() == 1);
    CHECK_FALSE(bench.has("page.html"));
  }
  CHECK(bench.text("fall.jsonl") == log);
}
