#include "../program.hpp"

using namespace hamelin;
using test::lines_of;
using test::Sandbox;

namespace {

// The person of shelf_person.json reaches into the shelf, and the arm does not know.
void log_contact(Sandbox& sandbox, const std::string& log) {
  std::vector<std::string> command{"run", "data/scenes/shelf_person.json", "--log", log};
  const Json obstacles = sandbox.json("data/scenes/shelf_person.json")["obstacles"];
  for (std::size_t i = 0; i < obstacles.size(); ++i) {
    command.emplace_back("--set");
    command.push_back("/obstacles/" + std::to_string(i) + "/known=false");
  }
  REQUIRE(sandbox.run(command).exit_code == 1);
}

}  // namespace

TEST_CASE("explain says whether a contact was avoidable, as text and as JSON", "[explain]") {
  Sandbox sandbox;
  log_contact(sandbox, "run.jsonl.zst");
  const auto text = sandbox.run({"explain", "run.jsonl.zst"});
  CHECK(text.exit_code == 0);
#ifndef HAMELIN_SANITIZED  // a search that takes longer shows its progress
  CHECK(text.err == "");
#endif
  CHECK_THAT(text.out, Catch::StartsWith("verdict     avoidable_in_hindsight"));
  CHECK_THAT(text.out, Catch::Contains("known       never") &&
                           Catch::Contains("the obstacle was not known then"));
  CHECK(sandbox.run({"explain", "run.jsonl.zst"}).out == text.out);
  CHECK(sandbox.run({"explain", "run.jsonl.zst", "--seed", "2"}).out != text.out);

  const Json json = test::run_json(sandbox, {"explain", "run.jsonl.zst", "--motions", "500"});
  CHECK(json["verdict"] == "avoidable_in_hindsight");
  const std::string obstacle = json["mover_contact"]["obstacle"];
  CHECK((obstacle == "hand" || obstacle == "forearm"));
  CHECK_THAT(text.out, Catch::Contains("obstacle '" + obstacle + "'"));
  CHECK(json["search"]["motions_per_start"] == 500);
  sandbox.put("explanation.json", json.dump());
  CHECK(sandbox.run({"validate", "explanation.json"}).exit_code == 0);
}

TEST_CASE("explain says if there is nothing to explain, and refuses what is not a log",
          "[explain]") {
  Sandbox sandbox;
  REQUIRE(sandbox
              .run({"run", "data/scenes/shelf_person.json", "--duration", "0.1", "--log",
                    "short.jsonl"})
              .exit_code == 1);
  const auto nothing = sandbox.run({"explain", "short.jsonl"});
  CHECK(nothing.exit_code == 0);
  CHECK(nothing.out ==
        "short.jsonl: nothing to explain: the run ended without contact (timeout)\n");
  CHECK(test::run_json(sandbox, {"explain", "short.jsonl"})["verdict"].is_null());

  REQUIRE(sandbox
              .run({"integrate", "data/robots/planar3.json", "--duration", "0.1", "--log",
                    "free.jsonl"})
              .exit_code == 0);
  CHECK_THAT(sandbox.run({"explain", "free.jsonl"}).out, Catch::Contains("free motion"));

  for (const std::string file : {"data/scenes/shelf.json", "absent.jsonl"}) {
    const auto refused = sandbox.run({"explain", file});
    CHECK(refused.exit_code == 2);
    CHECK(lines_of(refused.err).size() == 1);
  }
}
