#include "../program.hpp"

using namespace hamelin;
using test::Sandbox;

namespace {

/// A replacement in the text of a file of data/. JSON is edited as text, because some cases are not
/// valid JSON.
struct Change {
  std::string from, to;  ///< replaces the first occurrence; if empty, the whole text
};

struct Case {
  std::string name;
  std::string file, original;  ///< file to write from data/original; if empty, none
  std::vector<Change> changes;
  std::vector<std::string> command;
  std::vector<std::string> expected;  ///< parts of the line on stderr
};

// Scenes in data/scenes name files relative to that folder; from the working directory they are
// under data/.
const Change robot_path{"\"../", "\"data/"};
const std::string planar = "robots/planar3.json", scene52 = "scenes/paper_52_hybrid.json";
const std::string scene = "data/scenes/paper_52_hybrid.json", robot = "data/robots/planar3.json";

Case robot_case(const std::string& name, const Change& change,
                const std::vector<std::string>& expected) {
  return {name,
          "bad.json",
          planar,
          {change},
          {"integrate", "bad.json", "--result", "r.json", "--log", "l.jsonl"},
          expected};
}

Case scene_case(const std::string& name, const Change& change,
                const std::vector<std::string>& expected) {
  return {name,
          "bad.json",
          scene52,
          {robot_path, change},
          {"run", "bad.json", "--result", "r.json", "--log", "l.jsonl"},
          expected};
}

Case flag_case(const std::string& name, const std::vector<std::string>& command,
               const std::vector<std::string>& expected) {
  return {name, "", "", {}, command, expected};
}

Case map_case(const std::string& name, const std::string& text,
              const std::vector<std::string>& expected) {
  return {name, "bad.bt", "maps/shelf.bt", {{"", text}}, {"scene", "info", "bad.bt"}, expected};
}

Case urdf_case(const std::string& name, const std::string& body,
               const std::vector<std::string>& expected) {
  const std::string inertial =
      "<inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\" ixy=\"0\" ixz=\"0\" "
      "iyz=\"0\"/></inertial>";
  std::string text = "<robot name=\"r\"><link name=\"base\"/>";
  for (const char* link : {"a", "b"})
    text += std::string("<link name=\"") + link + "\">" + inertial + "</link>";
  return {name,
          "bad.urdf",
          planar,
          {{"", text + body + "</robot>"}},
          {"integrate", "bad.urdf", "--result", "r.json"},
          expected};
}

std::string joint(const std::string& name, const std::string& parent, const std::string& child,
                  const std::string& more = "") {
  return "<joint name=\"" + name + "\" type=\"continuous\"><parent link=\"" + parent +
         "\"/><child link=\"" + child + "\"/><axis xyz=\"0 0 1\"/>" + more + "</joint>";
}

// A valid map with one occupied cell below the root.
std::string one_cell_map(const std::string& resolution) {
  return "# Octomap OcTree binary file\nid OcTree\nsize 2\nres " + resolution + "\ndata\n\x02" +
         std::string(1, '\0');
}

std::vector<Case> cases() {
  const std::string mass = "\"mass_kg\": 1";
  return {
      // robots
      robot_case("a cut file", {"", "{\"schema\": \"hamelin.robot/1\",\n"},
                 {"bad.json", "line 2", "not JSON"}),
      robot_case("an unknown key", {mass, mass + ", \"damp\": 1"},
                 {"bad.json", "/links/0", "unknown key 'damp'"}),
      robot_case("a misspelt key", {"\"velocity_max\"", "\"velocty_max\""},
                 {"bad.json", "'velocity_max'?"}),
      robot_case("a key given twice", {mass, mass + ", \"mass_kg\": 2"},
                 {"bad.json", "'mass_kg' is given twice"}),
      robot_case("a negative mass", {mass, "\"mass_kg\": -1"},
                 {"bad.json", "/links/0/mass_kg", "-1"}),
      robot_case("an inertia that is not positive",
                 {"\"inertia_kg_m2\": [\n    1,", "\"inertia_kg_m2\": [\n    -1,"},
                 {"bad.json", "link1", "not positive definite"}),
      robot_case("NaN", {mass, "\"mass_kg\": NaN"}, {"bad.json", "line", "not JSON"}),
      robot_case("a number beyond double", {mass, "\"mass_kg\": 1e999"}, {"bad.json", "1e999"}),
      robot_case("a branch", {"\"parent\": 0", "\"parent\": 7"}, {"bad.json", "link2", "parent"}),
      robot_case("an unknown joint type", {"\"revolute\"", "\"ball\""},
                 {"bad.json", "/links/0/joint/type", "prismatic"}),
      robot_case("an unknown schema", {"hamelin.robot/1", "hamelin.robot/9"},
                 {"bad.json", "/schema", "hamelin.robot/9"}),
      urdf_case("a URDF with several leaves", joint("j1", "base", "a") + joint("j2", "base", "b"),
                {"bad.urdf", "several leaves", "a, b"}),
      urdf_case("a URDF whose moving joint mimics",
                joint("j1", "base", "a") + joint("j2", "a", "b", "<mimic joint=\"j1\"/>"),
                {"bad.urdf", "j2", "mimic"}),
      urdf_case("a URDF that is not XML", "<joint", {"bad.urdf"}),
      // scenes
      scene_case("a missing robot", {"planar4.json", "planar9.json"},
                 {"planar9.json", "cannot be opened"}),
      scene_case("an unknown key in an obstacle", {"\"radius_m\"", "\"radus_m\""},
                 {"bad.json", "/obstacles/0", "'radius_m'?"}),
      scene_case("a start of the wrong length", {"\"q\": [", "\"q\": [0,"},
                 {"bad.json", "/start/q", "5 values"}),
      scene_case("an unknown planner", {"\"hybrid\"", "\"warp\""},
                 {"'warp'", "searched for warp.hamelin.so", "hybrid"}),
      scene_case("a parameter out of its range", {"\"margin_m\": 0.05", "\"margin_m\": -1"},
                 {"'hybrid'", "/margin_m", "-1"}),
      scene_case("an unknown parameter", {"\"margin_m\"", "\"marginn_m\""},
                 {"'hybrid'", "'marginn_m'", "'margin_m'?"}),
      scene_case("a negative step", {"\"step_s\": 0.004", "\"step_s\": -0.004"},
                 {"bad.json", "/step_s", "above 0"}),
      scene_case("a duration that is not a multiple of the step",
                 {"\"duration_s\": 40", "\"duration_s\": 0.0055"},
                 {"duration 0.0055 s", "integer multiple of the step"}),
      // maps
      map_case("a truncated map",
               "# Octomap OcTree binary file\nid OcTree\nsize 9\nres 0.1\ndata\n\xff",
               {"bad.bt", "byte"}),
      map_case("an empty map", "", {"bad.bt", "empty"}),
      map_case("a map in millimetres", one_cell_map("50"), {"bad.bt", "resolution 50", "scale"}),
      map_case("a map that is text", "hello\n", {"bad.bt", "header line 1"}),
      // files and flags
      flag_case("a missing file", {"run", "nofile.json"}, {"nofile.json", "No such file"}),
      flag_case("a directory as file", {"validate", "data"}, {"data", "directory"}),
      flag_case("a robot where a scene is wanted", {"run", robot},
                {robot, "is a robot, expected a scene"}),
      flag_case("--set of an unknown pointer", {"run", scene, "--set", "/plannr/name=apf"},
                {"/plannr/name=apf", "'planner'"}),
      flag_case("--set of an unknown parameter", {"run", scene, "--set", "/planner/params/nope=1"},
                {"'nope'", "margin_m"}),
      flag_case("--set without a value", {"run", scene, "--set", "nonsense"},
                {"nonsense", "/json/pointer=VALUE"}),
      flag_case("a result in a missing folder", {"run", scene, "--result", "none/r.json"},
                {"none/r.json", "cannot be written"}),
      flag_case("a log in a missing folder", {"run", scene, "--log", "none/l.jsonl"},
                {"none/l.jsonl", "cannot be written"}),
      flag_case("a folder as result", {"run", scene, "--result", "data"},
                {"data", "not a regular file"}),
      flag_case("the input as result", {"run", scene, "--result", scene}, {scene, "is an input"}),
      flag_case("a misspelt flag", {"run", scene, "--planer", "apf"}, {"--planer", "'--planner'?"}),
      flag_case("a misspelt command", {"intgrate", robot}, {"intgrate", "'integrate'?"}),
      flag_case("a step that is not a number", {"run", scene, "--step", "abc"}, {"--step", "abc"}),
      flag_case("a seed below zero", {"run", scene, "--seed", "-1"},
                {"--seed", "-1 not in range 0"}),
      flag_case("a clutter seed below zero",
                {"scene", "make", "--clutter", "3", "--seed", "-1", "-o", "x.bt"},
                {"--seed", "-1 not in range 0"}),
      flag_case("an unknown integrator", {"integrate", robot, "--integrator", "warp"},
                {"'warp'", "hamel-variational"}),
      flag_case("an alpha beyond 1", {"integrate", robot, "--integrator", "hamel", "--alpha", "2"},
                {"/alpha", "at most 1"}),
      flag_case("q0 of the wrong length", {"integrate", robot, "--q0", "1,2"},
                {"--q0", "expected 3"}),
      flag_case("q0 that is not a list", {"integrate", robot, "--q0", "1,x,2"}, {"--q0", "'x'"}),
      flag_case("a step of zero", {"integrate", robot, "--step", "0"}, {"step 0", "positive"}),
      flag_case("a duration between steps",
                {"integrate", robot, "--step", "0.01", "--duration", "0.015"},
                {"duration 0.015", "integer multiple of the step"}),
      flag_case("an unknown axis",
                {"robot", "make-chain", "--links", "3", "--axes", "x,q", "-o", "x.json"},
                {"axes", "'q'"}),
      flag_case("a map from a scene's file", {"scene", "make", "--primitives", scene, "-o", "x.bt"},
                {scene, "hamelin.primitives/1"}),
      flag_case("an unknown planner to check", {"plugins", "check", "nope"},
                {"'nope'", "searched for"}),
      flag_case("an unknown schema to print", {"schema", "print", "nope"}, {"'nope'", "scene"}),
      // plugins
      {"a planner that is text",
       "warp.hamelin.so",
       planar,
       {{"", "hello\n"}},
       {"run", scene, "--planner", "./warp.hamelin.so", "--result", "r.json"},
       {"warp.hamelin.so", "cannot be loaded"}},
      {"a text to check as a planner",
       "warp.hamelin.so",
       planar,
       {{"", "hello\n"}},
       {"plugins", "check", "./warp.hamelin.so"},
       {"warp.hamelin.so", "cannot be loaded"}},
  };
}

}  // namespace

TEST_CASE("bad input gives exit code 2 and one clear line, and leaves no files behind",
          "[end_to_end]") {
  const auto table = cases();
  REQUIRE(table.size() >= 20);
  for (const Case& bad : table) {
    CAPTURE(bad.name);
    Sandbox sandbox;
    if (!bad.file.empty()) {
      std::string text = sandbox.text("data/" + bad.original);
      for (const Change& change : bad.changes) {
        if (change.from.empty()) {
          text = change.to;
          continue;
        }
        const auto at = text.find(change.from);
        REQUIRE(at != std::string::npos);
        text.replace(at, change.from.size(), change.to);
      }
      sandbox.put(bad.file, text);
    }
    const auto before = sandbox.files();
    const auto output = sandbox.run(bad.command);
    CAPTURE(output.err);
    CHECK(output.exit_code == 2);
    CHECK(output.out.empty());
    CHECK(test::lines_of(output.err).size() == 1);
    CHECK_THAT(output.err, Catch::StartsWith("hamelin: "));
    for (const auto& keyword : bad.expected) CHECK_THAT(output.err, Catch::Contains(keyword));
    CHECK(sandbox.files() == before);
  }
}
