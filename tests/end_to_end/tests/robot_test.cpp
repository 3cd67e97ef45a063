#include <algorithm>
#include <cmath>
#include <iterator>
#include <sstream>

#include "../program.hpp"
#include "hamelin/test/scene_data.hpp"

using namespace hamelin;
using test::Sandbox;
namespace fs = std::filesystem;

namespace {

// An arm of primitives: a rotating drum, a rod on the drum and a box at the end of the rod.
constexpr const char* arm = R"(<robot name="drum">
 <link name="base"><collision><geometry><box size="0.2 0.2 0.05"/></geometry></collision></link>
 <link name="drum"><inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
  <collision><origin xyz="0 0 0.15"/><geometry><cylinder radius="0.06" length="0.2"/></geometry></collision></link>
 <link name="rod"><inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
  <collision><origin xyz="0 0 0.25"/><geometry><cylinder radius="0.04" length="0.5"/></geometry></collision></link>
 <link name="box"><inertial><mass value="1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
  <collision><origin xyz="0 0 0.1"/><geometry><box size="0.1 0.1 0.15"/></geometry></collision></link>
 <joint name="j1" type="revolute"><parent link="base"/><child link="drum"/><axis xyz="0 0 1"/>
  <limit lower="-3" upper="3" effort="50" velocity="2"/></joint>
 <joint name="j2" type="revolute"><origin xyz="0 0 0.25"/><parent link="drum"/><child link="rod"/><axis xyz="1 0 0"/>
  <limit lower="-2" upper="2" effort="50" velocity="2"/></joint>
 <joint name="j3" type="revolute"><origin xyz="0 0 0.5"/><parent link="rod"/><child link="box"/><axis xyz="1 0 0"/>
  <limit lower="0.5" upper="2.5" effort="50" velocity="2"/></joint>
</robot>)";

// Removes the list of disabled pairs from a sidecar.
void remove_disabled_pairs(Sandbox& sandbox, const std::string& sidecar) {
  Json document = sandbox.json(sidecar);
  REQUIRE(document.erase("self_collision_disabled") == 1);
  sandbox.put(sidecar, document.dump());
}

// arm6 makes a small motion near its rest pose, where the shapes over its joints overlap.
Json arm6_scene(const std::string& spheres) {
  return {{"schema", "hamelin.scene/1"},
          {"robot", {{"file", "data/robots/arm6.urdf"}, {"spheres", spheres}}},
          {"start", {{"q", {0.0, 0.3, 0.8, 0.2, 0.0, 0.0}}}},
          {"goals", {{{"type", "joint"}, {"q", {0.1, 0.35, 0.9, 0.2, 0.0, 0.1}}}}},
          {"model", {{"self_collision", true}}}};
}

bool one_line_error(const test::Output& output) {
  return output.exit_code == 2 && output.out.empty() && test::lines_of(output.err).size() == 1;
}

}  // namespace

TEST_CASE("robot fit covers primitives, and its sidecar is read by robot info and validate",
          "[end_to_end]") {
  Sandbox sandbox;
  sandbox.put("arm.urdf", arm);
  const Json made = test::run_json(sandbox, {"robot", "fit", "arm.urdf", "-o", "arm.spheres.json"});
  CHECK(made["fit"]["gap_bound_m"] == 0.0);
  CHECK(made["fit"]["excess_max_m"].get<double>() < 0.027);
  CHECK(made["fit"]["links"].size() == 4);
  const auto shapes = made["fit"]["shapes"].get<std::size_t>();
  const Json info =
      test::run_json(sandbox, {"robot", "info", "arm.urdf", "--spheres", "arm.spheres.json"});
  CHECK(info["spheres"].get<std::size_t>() + info["base_spheres"].get<std::size_t>() == shapes);
  CHECK(sandbox.run({"validate", "arm.spheres.json"}).exit_code == 0);
  // A second fit gives the same bytes.
  const std::string first = sandbox.text("arm.spheres.json");
  REQUIRE(sandbox.run({"robot", "fit", "arm.urdf", "-o", "again.json"}).exit_code == 0);
  CHECK((sandbox.text("again.json") == first));
  // Without spheres, the reader names the command that makes them.
  CHECK_THAT(sandbox.run({"robot", "info", "arm.urdf"}).out,
             Catch::Contains("`hamelin robot fit`"));
}

TEST_CASE("robot fit makes fewer capsules than spheres, measures given shapes and prints a table",
          "[end_to_end]") {
  Sandbox sandbox;
  sandbox.put("arm.urdf", arm);
  const Json capsules =
      test::run_json(sandbox, {"robot", "fit", "arm.urdf", "--capsules", "-o", "c.json"});
  const Json spheres = test::run_json(sandbox, {"robot", "fit", "arm.urdf", "-o", "s.json"});
  CHECK(capsules["fit"]["gap_bound_m"] == 0.0);
  CHECK(capsules["fit"]["shapes"].get<int>() < spheres["fit"]["shapes"].get<int>());
  CHECK(sandbox.json("c.json").contains("capsules"));
  const Json compared =
      test::run_json(sandbox, {"robot", "fit", "arm.urdf", "--compare", "c.json"});
  CHECK(compared["compare"]["gap_bound_m"] == 0.0);
  CHECK(compared["compare"]["excess_max_m"] == capsules["fit"]["excess_max_m"]);
  sandbox.put("bad.json", R"({"links": {"rod": [{"center": [0, 0, 0.25], "radius": 0.1}]}})");
  const auto table = sandbox.run({"robot", "fit", "arm.urdf", "--compare", "bad.json"});
  CHECK(table.exit_code == 0);
  CHECK_THAT(table.out,
             Catch::Contains("rod") && Catch::Contains("link 'box' has geometry but no shapes"));
}

TEST_CASE("robot fit refuses bad input with one line and leaves no files behind", "[end_to_end]") {
  Sandbox sandbox;
  sandbox.put("arm.urdf", arm);
  const auto before = sandbox.files();
  const std::vector<std::vector<std::string>> commands = {
      {"robot", "fit", "absent.urdf", "-o", "s.json"},
      {"robot", "fit", "arm.urdf"},
      {"robot", "fit", "arm.urdf", "-o", "arm.urdf"},
      {"robot", "fit", "arm.urdf", "-o", "s.json", "--excess", "0"},
      {"robot", "fit", "arm.urdf", "-o", "s.json", "--excess", "nan"},
      {"robot", "fit", "arm.urdf", "-o", "s.json", "--total", "1"},
      {"robot", "fit", "arm.urdf", "-o", "s.json", "--package", "nothing"},
      {"robot", "fit", "arm.urdf", "-o", "s.json", "--srdf", "absent.srdf"},
      {"robot", "fit", "data/robots/planar3.json", "-o", "s.json"}};
  for (const auto& command : commands) {
    const auto output = sandbox.run(command);
    CAPTURE(command, output.err, output.out);
    CHECK(one_line_error(output));
  }
  CHECK(sandbox.files() == before);
  sandbox.put("mesh.urdf",
              "<robot name=\"m\"><link name=\"a\"><collision><geometry>\n<mesh "
              "filename=\"package://p/m.stl\"/>"
              "</geometry></collision></link></robot>");
  const auto output = sandbox.run({"robot", "fit", "mesh.urdf", "-o", "s.json"});
  CHECK(one_line_error(output));
  CHECK_THAT(output.err, Catch::Contains("mesh.urdf: line 2: link 'a'") &&
                             Catch::Contains("package://p/m.stl") && Catch::Contains("p/m.stl,"));
}

TEST_CASE("robot check finds overlaps at rest, and the list that it writes resolves them",
          "[end_to_end]") {
  Sandbox sandbox;
  sandbox.put("arm.urdf", arm);
  REQUIRE(sandbox.run({"robot", "fit", "arm.urdf", "-o", "s.json"}).exit_code == 0);
  remove_disabled_pairs(sandbox, "s.json");
  // Any list of pairs replaces the default rule that neighbours may touch.
  sandbox.put("one.srdf",
              "<robot name=\"drum\"><disable_collisions link1=\"base\" link2=\"box\" "
              "reason=\"Never\"/></robot>");
  const Json strict = test::run_json(sandbox,
                                     {"robot", "check", "arm.urdf", "--spheres", "s.json", "--srdf",
                                      "one.srdf", "--samples", "500"},
                                     1);
  CHECK(strict["overlaps_at_rest"].size() >= 2);
  CHECK(strict["rest_q"][2].get<double>() == Approx(1.5));
  for (const Json& pair : strict["pairs"]) {
    const bool named = pair["parts"] == Json::array({"box", "base"}) ||
                       pair["parts"] == Json::array({"base", "box"});
    CHECK(pair["checked"].get<bool>() != named);
    if (named) CHECK(pair["reason"] == "Never");
  }
  CHECK(std::any_of(strict["odd_limits"].begin(), strict["odd_limits"].end(), [](const Json& line) {
    return line.get<std::string>().find("'j3': 0 is outside its limits") != std::string::npos;
  }));
  for (const char* file : {"list.srdf", "list.json"}) {
    CAPTURE(file);
    const auto written = sandbox.run({"robot", "check", "arm.urdf", "--spheres", "s.json", "--srdf",
                                      "one.srdf", "--samples", "500", "--write", file});
    CHECK(written.exit_code == 1);
    // Each pair that is not checked any more is named, with how often it is in contact.
    CHECK_THAT(written.out, Catch::Contains("wrote " + std::string(file)));
    for (const Json& overlap : strict["overlaps_at_rest"])
      CHECK_THAT(written.out,
                 Catch::Contains("added: " + overlap["parts"][0].get<std::string>() + " - " +
                                 overlap["parts"][1].get<std::string>() + ": "));
  }
  const Json by_srdf = test::run_json(
      sandbox, {"robot", "check", "arm.urdf", "--spheres", "s.json", "--srdf", "list.srdf"});
  const Json by_sidecar =
      test::run_json(sandbox, {"robot", "check", "arm.urdf", "--spheres", "list.json"});
  CHECK(by_srdf["overlaps_at_rest"].empty());
  CHECK(by_sidecar["overlaps_at_rest"].empty());
  // robot check and the simulation check the same pairs.
  const Json info =
      test::run_json(sandbox, {"robot", "info", "arm.urdf", "--spheres", "list.json"});
  const auto checked = std::count_if(by_sidecar["pairs"].begin(), by_sidecar["pairs"].end(),
                                     [](const Json& pair) { return pair["checked"].get<bool>(); });
  CHECK(info["self_collision_pairs"].get<std::ptrdiff_t>() == checked);
  CHECK(checked > 0);
}

TEST_CASE("robot check is clean for the robots of data/, and the same seed gives the same text",
          "[end_to_end]") {
  Sandbox sandbox;
  const std::vector<std::string> command = {
      "robot",     "check", "data/robots/arm7.urdf", "--spheres", "data/robots/arm7.spheres.json",
      "--samples", "300"};
  const auto first = sandbox.run(command);
  CAPTURE(first.err, first.out);
  CHECK(first.exit_code == 0);
  CHECK(sandbox.run(command).out == first.out);
  CHECK_THAT(first.out,
             Catch::Contains("neighbours, and no pair is listed") && Catch::Contains("clean"));
  CHECK(sandbox.run({"robot", "check", "data/robots/planar3.json", "--samples", "10"}).exit_code ==
        0);
}

TEST_CASE("a scene's robot.srdf reaches the run: its hash is logged and the log replays",
          "[end_to_end]") {
  Sandbox sandbox;
  sandbox.put("arm.urdf", arm);
  sandbox.put(
      "arm.srdf",
      "<robot name=\"drum\"><disable_collisions link1=\"base\" link2=\"drum\" reason=\"Adjacent\"/>"
      "<disable_collisions link1=\"drum\" link2=\"rod\" reason=\"Adjacent\"/>"
      "<disable_collisions link1=\"rod\" link2=\"box\" reason=\"Adjacent\"/></robot>");
  REQUIRE(sandbox.run({"robot", "fit", "arm.urdf", "-o", "s.json"}).exit_code == 0);
  const Json scene = {
      {"schema", "hamelin.scene/1"},
      {"robot", {{"file", "arm.urdf"}, {"spheres", "s.json"}, {"srdf", "arm.srdf"}}},
      {"start", {{"q", {0.0, 0.3, 1.0}}}},
      {"goals", {{{"type", "joint"}, {"q", {0.2, 0.4, 1.1}}}}},
      {"model", {{"self_collision", true}}}};
  sandbox.put("scene.json", scene.dump());
  const auto run = sandbox.run(
      {"run", "scene.json", "--planner", "apf", "--duration", "0.05", "--log", "log.jsonl"});
  CAPTURE(run.err, run.out);
  CHECK(run.exit_code <= 1);
  const Json header = parse_json(test::lines_of(sandbox.text("log.jsonl")).front(), "header");
  CHECK(header["config"]["robot"]["srdf"].get<std::string>().find("arm.srdf") != std::string::npos);
  CHECK(header["provenance"].dump().find("\"srdf\"") != std::string::npos);
  CHECK(sandbox.run({"replay", "log.jsonl", "--verify"}).exit_code == 0);
  sandbox.put("scene.json", [&] {
    Json wrong = scene;
    wrong["robot"]["srdf"] = "absent.srdf";
    return wrong.dump();
  }());
  const auto absent = sandbox.run({"run", "scene.json", "--planner", "apf"});
  CHECK(one_line_error(absent));
  CHECK_THAT(absent.err, Catch::Contains("absent.srdf"));
}

TEST_CASE(
    "an arm with shapes on some links only is fitted and runs, since touching pairs are listed",
    "[end_to_end]") {
  Sandbox sandbox;
  const Json made =
      test::run_json(sandbox, {"robot", "fit", "data/robots/arm6.urdf", "-o", "arm6.spheres.json"});
  const auto reason_of = [&](const std::string& a, const std::string& b) {
    for (const Json& pair : made["self_collision"]["pairs"])
      if (pair["links"] == Json::array({a, b})) return pair["reason"].get<std::string>();
    return std::string("none");
  };
  CHECK(reason_of("base", "link2") == "Adjacent");  // link1 between them has no shapes
  CHECK(reason_of("link2", "link3") == "Adjacent");
  CHECK(reason_of("link3", "link5") == "Adjacent");
  CHECK(reason_of("base", "link3") == "none");
  CHECK(reason_of("base", "link6") == "none");
  CHECK(made["self_collision"]["samples"] == 10000);
  CHECK(sandbox.json("arm6.spheres.json")["self_collision_disabled"].size() ==
        made["self_collision"]["pairs"].size());
  CHECK_THAT(sandbox.run({"robot", "fit", "data/robots/arm6.urdf", "-o", "again.json"}).out,
             Catch::Contains("pairs of links never count as colliding") &&
                 Catch::Contains("base - link2: Adjacent"));
  CHECK((sandbox.text("again.json") == sandbox.text("arm6.spheres.json")));

  sandbox.put("scene.json", arm6_scene("arm6.spheres.json").dump());
  const Json result =
      test::run_json(sandbox, {"run", "scene.json", "--planner", "hybrid", "--duration", "5"});
  CHECK(result["outcome"] == "reached");
  CHECK(result["min_self_clearance_m"].get<double>() > 0.0);
}

TEST_CASE("a start refused for self-contact names a command that resolves it", "[end_to_end]") {
  Sandbox sandbox;
  REQUIRE(sandbox.run({"robot", "fit", "data/robots/arm6.urdf", "-o", "s.json"}).exit_code == 0);
  remove_disabled_pairs(sandbox, "s.json");
  sandbox.put("scene.json", arm6_scene("s.json").dump());
  const std::vector<std::string> command{"run",    "scene.json", "--planner",
                                         "hybrid", "--duration", "0.05"};
  const auto refused = sandbox.run(command);
  CHECK(refused.exit_code == 2);
  const std::string open = "`hamelin ", close = "`";
  const auto begin = refused.err.find(open) + open.size();
  CAPTURE(refused.err);
  REQUIRE(begin != std::string::npos);
  std::istringstream arguments(refused.err.substr(begin, refused.err.find(close, begin) - begin));
  const std::vector<std::string> remedy{std::istream_iterator<std::string>(arguments), {}};
  REQUIRE(remedy.size() > 4);
  CHECK(remedy[0] == "robot");
  CHECK(remedy[1] == "check");
  CHECK(sandbox.run(remedy).exit_code == 1);  // it finds the overlaps
  CHECK(sandbox.has(remedy.back()));
  sandbox.put("scene.json", arm6_scene(remedy.back()).dump());
  CHECK(sandbox.run(command).exit_code == 1);  // ran, but the time is too short
}

TEST_CASE("moments that violate the triangle inequality give warnings, and --strict refuses them",
          "[end_to_end]") {
  Sandbox sandbox;
  std::string text = arm;
  const std::string good = "izz=\"0.01\"";
  text.replace(text.find(good), good.size(), "izz=\"0.03\"");
  sandbox.put("arm.urdf", text);
  const std::string warning = "link 'drum': inertia breaks the triangle inequality";
  CHECK_THAT(sandbox.run({"robot", "info", "arm.urdf"}).out,
             Catch::Contains("\nwarning: " + warning));
  CHECK_THAT(sandbox.run({"robot", "check", "arm.urdf", "--samples", "10"}).out,
             Catch::Contains("\nwarning: " + warning));
  const auto valid = sandbox.run({"validate", "arm.urdf"});
  CHECK(valid.exit_code == 0);
  CHECK_THAT(valid.err, Catch::Contains("note: arm.urdf: " + warning));
  for (const auto& command :
       std::vector<std::vector<std::string>>{{"robot", "info", "arm.urdf", "--strict"},
                                             {"robot", "check", "arm.urdf", "--strict"},
                                             {"validate", "arm.urdf", "--strict"}}) {
    const auto output = sandbox.run(command);
    CAPTURE(command, output.err, output.out);
    CHECK(one_line_error(output));
    CHECK_THAT(output.err, Catch::Contains("arm.urdf: line 3: " + warning));
  }

  // The result of a run contains the warning.
  const auto fall =
      sandbox.run({"integrate", "arm.urdf", "--duration", "0.01", "--result", "fall.json"});
  CHECK(fall.exit_code == 0);
  CHECK_THAT(fall.err, Catch::Contains("note: arm.urdf: " + warning));
  CHECK_THAT(sandbox.json("fall.json")["warnings"].dump(), Catch::Contains(warning));
  const Json scene = {{"schema", "hamelin.scene/1"},
                      {"robot", {{"file", "arm.urdf"}}},
                      {"start", {{"q", {0.0, 0.3, 1.0}}}},
                      {"goals", {{{"type", "joint"}, {"q", {0.2, 0.4, 1.1}}}}}};
  sandbox.put("scene.json", scene.dump());
  const auto run = sandbox.run(
      {"run", "scene.json", "--planner", "hybrid", "--duration", "0.05", "--result", "run.json"});
  CAPTURE(run.err);
  CHECK(run.exit_code == 1);
  CHECK_THAT(sandbox.json("run.json")["warnings"].dump(), Catch::Contains(warning));
  CHECK(sandbox.run({"validate", "scene.json"}).exit_code == 0);
  CHECK(sandbox.run({"validate", "scene.json", "--strict"}).exit_code == 2);
}

TEST_CASE("the public Panda's SRDF and spheres are read together", "[end_to_end]") {
  Sandbox sandbox;
  const auto path = [&](const char* name) { return (test::third_party_robots / name).string(); };
  const Json info = test::run_json(
      sandbox, {"robot", "info", path("panda.urdf"), "--tip", "panda_grasptarget", "--spheres",
                path("panda_spheres.json"), "--srdf", path("panda.srdf")});
  CHECK(std::any_of(info["notes"].begin(), info["notes"].end(), [](const Json& note) {
    return note.get<std::string>().find("panda.srdf:") == 0;
  }));
}
