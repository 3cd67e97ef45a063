#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "../program.hpp"

// The contents of MCAP files are tested in tests/mcap, by readers of others.
using namespace hamelin;
using Catch::Matchers::Contains;
using test::Sandbox;

namespace {

const std::string magic("\x89MCAP0\r\n", 8);

// A log of a robot and a map that are copies, so that they can be changed.
void make_log(Sandbox& sandbox) {
  const std::filesystem::path data = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";
  for (const char* file :
       {"scenes/shelf.json", "maps/shelf.bt", "robots/arm7.urdf", "robots/arm7.spheres.json"})
    sandbox.put(std::filesystem::path("copy") / file, read_file(data / file));
  REQUIRE(sandbox
              .run({"run", "copy/scenes/shelf.json", "--planner", "apf", "--duration", "0.2",
                    "--log", "run.jsonl"})
              .exit_code <= 1);
}

std::vector<std::string> export_to(const std::string& log, const std::string& file) {
  return {"export", log, "--format", "mcap", "-o", file};
}

}  // namespace

TEST_CASE("an MCAP file is the same on standard output and each time", "[end_to_end][export]") {
  Sandbox sandbox;
  make_log(sandbox);
  const auto output = sandbox.run(export_to("run.jsonl", "a.mcap"));
  REQUIRE(output.exit_code == 0);
  CHECK_THAT(output.err, Contains("a.mcap: 201 samples, "));
  CHECK(output.out.empty());
  REQUIRE(sandbox.run(export_to("run.jsonl", "b.mcap")).exit_code == 0);
  const std::string bytes = sandbox.text("a.mcap");
  CHECK(bytes.substr(0, magic.size()) == magic);
  CHECK(bytes.substr(bytes.size() - magic.size()) == magic);
  CHECK(sandbox.text("b.mcap") == bytes);
  CHECK(sandbox.run({"export", "run.jsonl", "--format", "mcap"}).out == bytes);

  auto slower = export_to("run.jsonl", "c.mcap");
  slower.insert(slower.end(), {"--rate", "100"});
  CHECK_THAT(sandbox.run(slower).err, Contains("c.mcap: 21 samples, "));
}

TEST_CASE("a run without its map is exported with a note, and not without its robot",
          "[end_to_end][export]") {
  Sandbox sandbox;
  make_log(sandbox);
  std::filesystem::remove(sandbox.path("copy/maps/shelf.bt"));
  const auto output = sandbox.run(export_to("run.jsonl", "run.mcap"));
  CHECK(output.exit_code == 0);
  CHECK_THAT(output.err, Contains("without the map of the run the file has no map"));
  std::filesystem::remove(sandbox.path("copy/robots/arm7.urdf"));
  const auto refused = sandbox.run(export_to("run.jsonl", "other.mcap"));
  CHECK(refused.exit_code == 2);
  CHECK(test::lines_of(refused.err).size() == 1);
  CHECK_THAT(refused.err, Contains("arm7.urdf"));
  CHECK(!sandbox.has("other.mcap"));
}

TEST_CASE("a log that cannot be exported leaves no MCAP file, and keeps an older one",
          "[end_to_end][export]") {
  Sandbox sandbox;
  make_log(sandbox);
  const std::string log = sandbox.text("run.jsonl");
  const auto lines = test::lines_of(log);
  sandbox.put("header.jsonl", lines.front() + "\n");
  sandbox.put("damaged.jsonl", log + "{\"type\": \"tick\"}\n");
  sandbox.put("old.mcap", "as before");
  const auto before = sandbox.files();
  for (const char* file : {"header.jsonl", "damaged.jsonl", "copy/maps/shelf.bt", "absent.jsonl"})
    for (const char* target : {"new.mcap", "old.mcap"}) {
      CAPTURE(file, target);
      const auto output = sandbox.run(export_to(file, target));
      CHECK(output.exit_code == 2);
      CHECK(test::lines_of(output.err).size() == 1);
      CHECK_THAT(output.err, Contains(file));
      CHECK(sandbox.run({"export", file, "--format", "mcap"}).out.empty());
    }
  for (const char* rate : {"0", "-5", "nan", "1e12"}) {
    auto command = export_to("run.jsonl", "new.mcap");
    command.insert(command.end(), {"--rate", rate});
    const auto output = sandbox.run(command);
    CAPTURE(rate, output.err);
    CHECK(output.exit_code == 2);
    CHECK(test::lines_of(output.err).size() == 1);
  }
  CHECK(sandbox.run(export_to("run.jsonl", "run.jsonl")).exit_code == 2);
  CHECK(sandbox.text("run.jsonl") == log);
  CHECK(sandbox.text("old.mcap") == "as before");
  CHECK(sandbox.files() == before);
}

TEST_CASE("a log whose run was interrupted is exported up to its end", "[end_to_end][export]") {
  Sandbox sandbox;
  make_log(sandbox);
  const std::string log = sandbox.text("run.jsonl");
  sandbox.put("cut.jsonl", log.substr(0, log.size() / 2));
  const auto output = sandbox.run(export_to("cut.jsonl", "cut.mcap"));
  CHECK(output.exit_code == 0);
  CHECK_THAT(output.err, Contains("ends in the middle of a line"));
}
