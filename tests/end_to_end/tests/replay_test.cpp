#include <signal.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <fstream>

#include "../program.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/core/rng.hpp"

using namespace hamelin;
using Catch::Matchers::Contains;
using test::Sandbox;

namespace {

std::string joined(const std::vector<std::string>& lines) {
  std::string text;
  for (const auto& line : lines) text += line + "\n";
  return text;
}

// The lines of a log of about a thousand ticks.
std::vector<std::string> short_log(Sandbox& sandbox) {
  REQUIRE(
      sandbox
          .run({"run", "data/scenes/paper_52_gyro.json", "--duration", "4", "--log", "run.jsonl"})
          .exit_code == 1);
  return test::lines_of(sandbox.text("run.jsonl"));
}

// What cameras see takes long to compute, and with a sanitizer everything does.
std::vector<std::string> duration_of(const Json& scene) {
  const bool cameras = scene.contains("sensors");
#ifdef HAMELIN_SANITIZED
  return {"--duration", cameras ? "0.2" : "2"};
#else
  if (cameras) return {"--duration", "2"};
  return {};
#endif
}

}  // namespace

TEST_CASE("every scene in data is repeated to the bit", "[end_to_end][replay]") {
  Sandbox sandbox;
  std::size_t scenes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(
           std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/scenes")) {
    const std::string scene = "data/scenes/" + entry.path().filename().string();
    CAPTURE(scene);
    const Json document = read_json(entry.path());
    const bool planned = !document.value("planner", Json()).is_null();
    // Every second log is compressed and has every seventh tick only.
    const bool thin = scenes++ % 2 == 1;
    const std::string log = thin ? "run.jsonl.zst" : "run.jsonl";
    std::vector<std::string> command{
        planned ? "run" : "integrate", scene, "--log", log, "--every", thin ? "7" : "1"};
    for (const std::string& word : duration_of(document)) command.push_back(word);
    const auto made = sandbox.run(command);
    REQUIRE((made.exit_code == 0 || made.exit_code == 1));
    const Json verdict = test::run_json(sandbox, {"replay", log, "--verify"});
    CHECK(verdict["to_the_bit"] == true);
    CHECK(verdict["tolerance"] == 0.0);
    CHECK(verdict["finished"] == true);
    CHECK(verdict["ticks"].get<long>() > 20);
  }
  CHECK(scenes >= 6);
}

TEST_CASE("an altered log is caught at the tick and field that was altered",
          "[end_to_end][replay]") {
  Sandbox sandbox;
  const auto lines = short_log(sandbox);
  Rng random(11);
  for (int i = 0; i < 12; ++i) {
    const auto at =
        1 + static_cast<std::size_t>(random.uniform(0.0, static_cast<double>(lines.size() - 2)));
    Json line = parse_json(lines[at], "line");
    if (line["type"] != "tick") continue;
    // A change by one unit in the last place, of a joint or of an energy.
    const std::string field = i % 2 == 0 ? "/q/" + std::to_string(i % 4) : "/energy/held_work_J";
    Json& number = line[Json::json_pointer(field)];
    number = std::nextafter(number.get<double>(), 10.0);
    auto altered = lines;
    altered[at] = line.dump();
    sandbox.put("altered.jsonl", joined(altered));
    const Json verdict = test::run_json(sandbox, {"replay", "altered.jsonl", "--verify"}, 1);
    CHECK(verdict["equal"] == false);
    CHECK(verdict["beyond_tolerance"]["k"] == line["k"]);
    CHECK(verdict["beyond_tolerance"]["line"] == at + 1);
    CHECK(verdict["beyond_tolerance"]["field"] == field);
    const auto printed = sandbox.run({"replay", "altered.jsonl", "--verify"});
    CHECK_THAT(printed.out, Contains("differs: tick " + line["k"].dump()) && Contains(field));
  }
}

TEST_CASE("removed, duplicated and added lines and a changed header are detected",
          "[end_to_end][replay]") {
  Sandbox sandbox;
  const auto lines = short_log(sandbox);
  const auto verdict_of = [&](const std::vector<std::string>& altered) {
    sandbox.put("altered.jsonl", joined(altered));
    return test::run_json(sandbox, {"replay", "altered.jsonl", "--verify"}, 1)["beyond_tolerance"];
  };
  auto without = lines;
  without.erase(without.begin() + 500);
  CHECK(verdict_of(without)["line"] == 501);
  auto twice = lines;
  twice.insert(twice.begin() + 500, lines[500]);
  CHECK(verdict_of(twice)["line"] == 502);
  auto more = lines;
  more.insert(more.end() - 1, R"({"type":"event","time_s":4.0,"text":"it never happened"})");
  CHECK(verdict_of(more)["line"] == lines.size());
  auto header = lines;
  Json altered = parse_json(lines[0], "header");
  altered["config"]["planner"]["params"]["k_p"] =
      altered["config"]["planner"]["params"]["k_p"].get<double>() * 1.001;
  header[0] = altered.dump();
  CHECK(verdict_of(header)["k"] == 0);  // the changed run differs from the first tick on
  auto result = lines;
  altered = parse_json(lines.back(), "result");
  altered["outcome"] = "reached";
  result.back() = altered.dump();
  CHECK(verdict_of(result)["field"] == "/outcome");
}

TEST_CASE("an unfinished log is compared up to its end", "[end_to_end][replay]") {
  Sandbox sandbox;
  const auto text = joined(short_log(sandbox));
  sandbox.put("cut.jsonl", text.substr(0, text.size() * 2 / 3));
  const Json verdict = test::run_json(sandbox, {"replay", "cut.jsonl", "--verify"});
  CHECK(verdict["to_the_bit"] == true);
  CHECK(verdict["finished"] == false);
  CHECK(verdict["ticks"].get<long>() > 200);
}

TEST_CASE("a run stopped by Ctrl-C closes its log, and is repeated to the same end",
          "[end_to_end][replay]") {
  for (const std::string log : {"run.jsonl", "run.jsonl.zst"}) {
    CAPTURE(log);
    Sandbox sandbox;
    const auto child =
        sandbox.start({"integrate", "data/robots/planar3.json", "--duration", "100000", "--step",
                       "0.01", "--every", "13", "--log", log, "--result", "result.json"});
    while (!sandbox.has(log) || std::filesystem::file_size(sandbox.path(log)) < 50'000)
      ::usleep(1000);
    ::kill(child, SIGINT);
    const auto output = sandbox.finish(child);
    CHECK(output.exit_code == 130);
    CHECK(sandbox.json("result.json")["outcome"] == "interrupted");
    CHECK(sandbox.run({"validate", log}).exit_code == 0);
    const Json verdict = test::run_json(sandbox, {"replay", log, "--verify"});
    CHECK(verdict["to_the_bit"] == true);
    CHECK(verdict["finished"] == true);
  }
}

TEST_CASE("a run that is killed leaves a log that is read, verified and reported as unfinished",
          "[end_to_end][replay]") {
  for (const std::string log : {"run.jsonl", "run.jsonl.zst"}) {
    CAPTURE(log);
    Sandbox sandbox;
    const auto child = sandbox.start({"integrate", "data/robots/planar3.json", "--duration",
                                      "100000", "--step", "0.01", "--log", log});
    while (!sandbox.has(log) || std::filesystem::file_size(sandbox.path(log)) < 200'000)
      ::usleep(1000);
    ::kill(child, SIGKILL);
    CHECK(sandbox.finish(child).exit_code == -SIGKILL);
    const auto checked = sandbox.run({"validate", log});
    CHECK(checked.exit_code == 0);
    CHECK_THAT(checked.out, Contains("no result: unfinished"));
    const Json verdict = test::run_json(sandbox, {"replay", log, "--verify"});
    CHECK(verdict["to_the_bit"] == true);
    CHECK(verdict["finished"] == false);
    if (log.ends_with(".zst")) CHECK(verdict["ticks"].get<long>() % 256 == 0);
  }
}

TEST_CASE("replay finds the inputs of a moved log, and names an input that has changed",
          "[end_to_end][replay]") {
  Sandbox sandbox;
  sandbox.put("in/robot.json",
              read_file(std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/robots/planar3.json"));
  REQUIRE(sandbox.run({"integrate", "in/robot.json", "--duration", "1", "--log", "in/run.jsonl"})
              .exit_code == 0);
  std::filesystem::create_directory(sandbox.path("elsewhere"));
  std::filesystem::rename(sandbox.path("in"), sandbox.path("elsewhere/in"));
  CHECK(test::run_json(sandbox, {"replay", "elsewhere/in/run.jsonl", "--verify"})["to_the_bit"] ==
        true);

  sandbox.put("elsewhere/in/robot.json", sandbox.text("elsewhere/in/robot.json") + "\n");
  const auto changed = sandbox.run({"replay", "elsewhere/in/run.jsonl", "--verify"});
  CHECK(changed.exit_code == 2);
  CHECK_THAT(changed.err, Contains("robot.json: has changed since the log was written"));
  std::filesystem::remove(sandbox.path("elsewhere/in/robot.json"));
  const auto missing = sandbox.run({"replay", "elsewhere/in/run.jsonl", "--verify"});
  CHECK(missing.exit_code == 2);
  CHECK_THAT(missing.err, Contains("robot.json: is missing"));
}

TEST_CASE("files of way-points are inputs of a run: found when moved, named when changed",
          "[end_to_end][replay]") {
  Sandbox sandbox;
  const std::filesystem::path data = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";
  Json scene = read_json(data / "scenes/paper_52_apf.json");
  scene["robot"]["file"] = (data / "robots/planar4.json").string();
  scene["duration_s"] = 0.02;
  scene["obstacles"] = {{{"name", "walker"},
                         {"type", "sphere"},
                         {"radius_m", 0.1},
                         {"motion", {{"type", "waypoints"}, {"file", "walk.csv"}}}}};
  sandbox.put("in/scene.json", scene.dump());
  sandbox.put("in/walk.csv", "time_s,x_m,y_m,z_m\n0,2,2,2\n1,2,2,3\n");
  const auto valid = sandbox.run({"validate", "in/scene.json", "in/walk.csv"});
  CHECK(valid.exit_code == 0);
  CHECK_THAT(valid.out, Contains("walk.csv: ok (way-points, 2, up to 1.5 m/s and 0 rad/s)"));
  REQUIRE(sandbox.run({"run", "in/scene.json", "--log", "in/run.jsonl"}).exit_code == 1);
  std::filesystem::rename(sandbox.path("in"), sandbox.path("moved"));
  CHECK(test::run_json(sandbox, {"replay", "moved/run.jsonl", "--verify"})["to_the_bit"] == true);
  sandbox.put("moved/walk.csv", sandbox.text("moved/walk.csv") + "2,2,2,4\n");
  const auto changed = sandbox.run({"replay", "moved/run.jsonl", "--verify"});
  CHECK(changed.exit_code == 2);
  CHECK_THAT(changed.err, Contains("walk.csv: has changed since the log was written"));
  sandbox.put("moved/walk.csv", "time_s,x_m,y_m,z_m\n0,2,2,2\n1,2,2\n");
  const auto refused = sandbox.run({"validate", "moved/scene.json"});
  CHECK(refused.exit_code == 2);
  CHECK_THAT(refused.err, Contains("scene.json: /obstacles/0/motion/file: ") &&
                              Contains("walk.csv: line 3: 3 cells, expected 4"));
}

TEST_CASE("a log of another build is compared within a tolerance, with a note",
          "[end_to_end][replay]") {
  Sandbox sandbox;
  auto lines = short_log(sandbox);
  Json header = parse_json(lines[0], "header");
  header["provenance"]["build"]["id"] = "0123456789012345678901234567890123456789";
  header["provenance"]["isa"] = "v9";
  lines[0] = header.dump();
  sandbox.put("other.jsonl", joined(lines));
  const auto same = sandbox.run({"replay", "other.jsonl", "--verify"});
  CHECK(same.exit_code == 0);
  CHECK_THAT(same.err, Contains("build: 0123456789") && Contains("instruction set: v9 in the log"));
  CHECK_THAT(same.out, Contains("equal to the bit"));
  header = parse_json(test::lines_of(sandbox.text("run.jsonl"))[0], "header");
  for (auto& input : header["provenance"]["inputs"])
    if (input["role"] == "plugin") input["sha256"] = std::string(64, '0');
  auto with_other_plugin = lines;
  with_other_plugin[0] = header.dump();
  sandbox.put("plugin.jsonl", joined(with_other_plugin));
  CHECK_THAT(sandbox.run({"replay", "plugin.jsonl", "--verify"}).err,
             Contains("planner 'gyro': SHA-256 000000000000"));

  Json tick = parse_json(lines[300], "tick");
  tick["q"][1] = tick["q"][1].get<double>() + 1e-9;
  lines[300] = tick.dump();
  sandbox.put("other.jsonl", joined(lines));
  Json verdict = test::run_json(sandbox, {"replay", "other.jsonl", "--verify"});
  CHECK(verdict["equal"] == true);
  CHECK(verdict["to_the_bit"] == false);
  CHECK(verdict["tolerance"] == 1e-6);
  CHECK(verdict["first_difference"]["k"] == tick["k"]);
  CHECK(verdict["largest_difference"].get<double>() == Approx(1e-9).epsilon(0.01));
  verdict =
      test::run_json(sandbox, {"replay", "other.jsonl", "--verify", "--tolerance", "1e-10"}, 1);
  CHECK(verdict["beyond_tolerance"]["field"] == "/q/1");
}

TEST_CASE("a run that branches is reported with its first tick, its size and both outcomes",
          "[end_to_end][replay]") {
  Sandbox sandbox;
  auto lines = short_log(sandbox);
  Json header = parse_json(lines[0], "header");
  header["provenance"]["isa"] = "v9";
  lines[0] = header.dump();
  for (const std::size_t at : {200, 300}) {
    Json tick = parse_json(lines[at], "tick");
    tick["q"][1] = tick["q"][1].get<double>() + (at == 200 ? 1e-9 : 0.25);
    lines[at] = tick.dump();
  }
  const Json branch = parse_json(lines[300], "tick");
  sandbox.put("other.jsonl", joined(lines));
  const Json verdict = test::run_json(sandbox, {"replay", "other.jsonl", "--verify"}, 1);
  CHECK(verdict["beyond_tolerance"]["k"] == branch["k"]);
  CHECK(verdict["beyond_tolerance"]["field"] == "/q/1");
  CHECK(verdict["beyond_tolerance"]["difference"].get<double>() == Approx(0.25).epsilon(0.25));
  CHECK(verdict["first_difference"]["difference"].get<double>() == Approx(1e-9).epsilon(0.01));
  CHECK(verdict["largest_difference"].get<double>() == Approx(1e-9).epsilon(0.01));
  CHECK(verdict["outcome_logged"] == "timeout");
  CHECK(verdict["outcome_replayed"] == "timeout");
  const auto text = sandbox.run({"replay", "other.jsonl", "--verify"});
  CHECK(text.exit_code == 1);
  CHECK_THAT(text.out, Contains("differs: tick " + branch["k"].dump()) && Contains(", by 0.2") &&
                           Contains("equal within 1e-06 before, largest difference 1e-09") &&
                           Contains("outcome logged timeout, replayed timeout"));
  CHECK_THAT(text.err, Contains("instruction set: v9 in the log") &&
                           Contains("may differ from a decision on that depends on rounding"));
}

// What docs/logs.md says of logs from another instruction set, for each pair of sets.
TEST_CASE("a log is verified across all instruction sets of the machine", "[end_to_end][replay]") {
  std::vector<std::string> available;
  std::string missing;
  for (const Isa isa : {Isa::baseline, Isa::v3, Isa::v4})
    if (is_available(isa))
      available.emplace_back(name_of(isa));
    else
      missing += " " + std::string(name_of(isa));
  Sandbox sandbox;
  for (const auto& here : available) {
    const test::EnvironmentVariable logged("HAMELIN_ISA", here);
    for (const char* scene : {"paper_52_gyro", "clutter", "shelf"})
      REQUIRE(sandbox
                  .run({"run", "data/scenes/" + std::string(scene) + ".json", "--log",
                        here + scene + ".jsonl.zst"})
                  .exit_code == 0);
  }
  for (const auto& here : available)
    for (const auto& there : available) {
      CAPTURE(here, there);
      const test::EnvironmentVariable repeated("HAMELIN_ISA", there);
      const auto verdict_on = [&](const char* scene, int exit_code) {
        return test::run_json(sandbox, {"replay", here + scene + ".jsonl.zst", "--verify"},
                              exit_code);
      };
      if (here == there) {
        CHECK(verdict_on("shelf", 0)["to_the_bit"] == true);
        continue;
      }
      // Runs whose decisions do not depend on rounding agree to their end.
      for (const char* scene : {"paper_52_gyro", "clutter"}) {
        const Json verdict = verdict_on(scene, 0);
        CHECK(verdict["other_build"].size() == 1);
        CHECK(verdict["finished"] == true);
        CHECK(verdict["largest_difference"].get<double>() < 1e-7);
      }
      // This run may branch. Until then it agrees, and from then on it is a run of its own.
      const auto output = sandbox.run({"replay", here + "shelf.jsonl.zst", "--verify", "--json"});
      const Json verdict = parse_json(output.out, "standard output");
      CHECK(verdict["largest_difference"].get<double>() <= 1e-6);
      CHECK(verdict["ticks"].get<long>() > 200);
      CHECK(verdict["outcome_replayed"] == "reached");
      CHECK((output.exit_code == 0) == verdict["beyond_tolerance"].is_null());
    }
  test::skip_unless(missing.empty(), "this machine is without" + missing);
}

TEST_CASE("texts of another build may be worded differently, those of the same build may not",
          "[end_to_end][replay]") {
  Sandbox sandbox;
  auto lines = short_log(sandbox);
  Json header = parse_json(lines[0], "header");
  header["robot_notes"] = {"a note in other words"};
  lines[0] = header.dump();
  sandbox.put("same_build.jsonl", joined(lines));
  const Json same =
      test::run_json(sandbox, {"replay", "same_build.jsonl", "--verify"}, 1)["beyond_tolerance"];
  CHECK(same["field"] == "/robot_notes");

  header["provenance"]["build"]["id"] = "0123456789012345678901234567890123456789";
  lines[0] = header.dump();
  Json result = parse_json(lines.back(), "result");
  result["cause"] = "a cause in other words";
  lines.back() = result.dump();
  sandbox.put("other_build.jsonl", joined(lines));
  const Json other = test::run_json(sandbox, {"replay", "other_build.jsonl", "--verify"});
  CHECK(other["equal"] == true);
  CHECK(other["to_the_bit"] == false);
  CHECK(other["first_difference"]["field"] == "/robot_notes");
}

TEST_CASE("replay without --verify writes the same log again", "[end_to_end][replay]") {
  Sandbox sandbox;
  const auto lines = short_log(sandbox);
  REQUIRE(sandbox.run({"replay", "run.jsonl", "--log", "again.jsonl"}).exit_code == 1);
  const auto again = test::lines_of(sandbox.text("again.jsonl"));
  REQUIRE(again.size() == lines.size());
  const auto reproducible_part = [](const std::string& text) {
    Json line = parse_json(text, "line");
    line.erase("timing");
    line.erase("provenance");
    return line;
  };
  for (std::size_t i = 0; i < lines.size(); i += 97)
    CHECK(reproducible_part(lines[i]) == reproducible_part(again[i]));
}

TEST_CASE("replay and export refuse files that are not logs with one line",
          "[end_to_end][replay]") {
  Sandbox sandbox;
  sandbox.put("empty.jsonl", "");
  sandbox.put("header.jsonl", "{\"type\":\"header\",\"schema\":\"hamelin.run/1\"}\n");
  sandbox.put("noise.jsonl.zst", "\x28\xb5\x2f\xfdnoise and more noise");
  for (const char* file : {"data/scenes/shelf.json", "data/maps/shelf.bt", "empty.jsonl",
                           "header.jsonl", "noise.jsonl.zst", "absent.jsonl"})
    for (const char* command : {"replay", "export"}) {
      CAPTURE(file, command);
      const auto output = sandbox.run({command, file});
      CHECK(output.exit_code == 2);
      CHECK(test::lines_of(output.err).size() == 1);
      CHECK_THAT(output.err, Contains(file));
      CHECK(output.out.empty());
    }
}

TEST_CASE("the motion in a log is exported as CSV and as a ROS trajectory",
          "[end_to_end][export]") {
  Sandbox sandbox;
  const Json result = test::run_json(
      sandbox, {"run", "data/scenes/clutter.json", "--every", "10", "--log", "run.jsonl.zst"});
  REQUIRE(sandbox.run({"export", "run.jsonl.zst", "-o", "run.csv"}).exit_code == 0);
  const auto rows = test::lines_of(sandbox.text("run.csv"));
  CHECK_THAT(rows[0], Contains("time_s,q_joint1,"));
  // A row for every tenth step, including step 0, and for the last step.
  const auto steps = result["steps"].get<std::size_t>();
  CHECK(rows.size() == 1 + 1 + (steps + 9) / 10);
  REQUIRE(
      sandbox.run({"export", "run.jsonl.zst", "--format", "ros", "--rate", "50", "-o", "run.json"})
          .exit_code == 0);
  const Json message = sandbox.json("run.json");
  CHECK(message["joint_names"].size() == 7);
  CHECK(message["points"][1]["time_from_start"]["nanosec"] == 20000000);
  // An input is never overwritten.
  CHECK(sandbox.run({"export", "run.jsonl.zst", "-o", "run.jsonl.zst"}).exit_code == 2);
  CHECK(sandbox.run({"validate", "run.jsonl.zst"}).exit_code == 0);
}

TEST_CASE("no output replaces a file that the scene needs", "[end_to_end][files]") {
  Sandbox sandbox;
  sandbox.put("maps/shelf.bt",
              read_file(std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/maps/shelf.bt"));
  const std::string map = sandbox.text("maps/shelf.bt");
  for (const char* option : {"--log", "--result"}) {
    const auto output = sandbox.run({"run", "data/scenes/shelf.json", "--set",
                                     "/map/file=" + sandbox.path("maps/shelf.bt").string(), option,
                                     "maps/shelf.bt"});
    CHECK(output.exit_code == 2);
    CHECK_THAT(output.err, Contains("maps/shelf.bt: is an input"));
  }
  CHECK(sandbox.text("maps/shelf.bt") == map);
}

TEST_CASE(
    "for any content of a log, replay, report, export and validate exit with 0, 1, or 2 and one "
    "line",
    "[end_to_end][replay]") {
  Sandbox sandbox;
  REQUIRE(
      sandbox
          .run({"run", "data/scenes/paper_52_gyro.json", "--duration", "0.2", "--log", "run.jsonl"})
          .exit_code == 1);
  const auto lines = test::lines_of(sandbox.text("run.jsonl"));
  const std::vector<Json> values = {nullptr,       true,           -1,        1e308, "", "x",
                                    Json::array(), Json::object(), Json({1}), 1.5};
  Rng random(29);
  const auto pick = [&](std::size_t count) {
    return static_cast<std::size_t>(random.uniform(0.0, static_cast<double>(count)));
  };
  for (int i = 0; i < 60; ++i) {
    const std::size_t at = i % 2 == 0 ? 0 : pick(lines.size());
    Json document = parse_json(lines[at], "line");
    // Descend to a random place and write another value there.
    Json* place = &document;
    while (place->is_structured() && !place->empty() && (place == &document || pick(4) != 0)) {
      auto next = place->begin();
      std::advance(next, static_cast<std::ptrdiff_t>(pick(place->size())));
      place = &*next;
    }
    *place = values[pick(values.size())];
    auto altered = lines;
    altered[at] = document.dump();
    sandbox.put("altered.jsonl", joined(altered));
    const std::vector<std::vector<std::string>> commands = {
        {"replay", "altered.jsonl", "--verify"},
        {"report", "altered.jsonl", "-o", "altered.html"},
        {"export", "altered.jsonl"},
        {"export", "altered.jsonl", "--format", "mcap", "-o", "altered.mcap"},
        {"validate", "altered.jsonl"}};
    for (const auto& command : commands) {
      CAPTURE(command, altered[at]);
      const auto output = sandbox.run(command);
      CHECK(output.exit_code >= 0);
      CHECK(output.exit_code <= 2);
      if (output.exit_code != 2) continue;
      const auto messages = test::lines_of(output.err);
      CHECK(std::count_if(messages.begin(), messages.end(), [](const std::string& line) {
              return line.find("note:") == line.npos;
            }) == 1);
    }
  }
}
