#include <cmath>

#include "../program.hpp"
#include "hamelin/test/damaged_maps.hpp"
#include "hamelin/test/scene_data.hpp"

using namespace hamelin;
using test::Sandbox;
namespace fs = std::filesystem;

TEST_CASE("every robot, map, file of way-points and scene of data/ validates", "[end_to_end]") {
  Sandbox sandbox;
  std::vector<std::string> command = {"validate"};
  for (const char* folder : {"robots", "maps", "paths", "scenes"})
    for (const auto& entry : fs::directory_iterator(fs::path(HAMELIN_SOURCE_DIR) / "data" / folder))
      if (entry.is_regular_file())
        command.push_back((fs::path("data") / folder / entry.path().filename()).string());
  REQUIRE(command.size() > 12);
  const auto output = sandbox.run(command);
  CAPTURE(output.err);
  CHECK(output.exit_code == 0);
  CHECK(test::lines_of(output.out).size() == command.size() - 1);
}

TEST_CASE("scene make builds the maps of data/ from their primitives, byte for byte",
          "[end_to_end]") {
  Sandbox sandbox;
  for (const std::string name : {"shelf", "clutter"}) {
    CAPTURE(name);
    const auto output = sandbox.run({"scene", "make", "--primitives",
                                     "data/maps/" + name + ".primitives.json", "-o", name + ".bt"});
    REQUIRE(output.exit_code == 0);
    CHECK((sandbox.text(name + ".bt") == sandbox.text("data/maps/" + name + ".bt")));
  }
}

TEST_CASE(
    "scene info reports the self-distance, and names contacts at the start and at joint goals",
    "[end_to_end]") {
  // The links of planar4 end in spheres of 2 cm radius. At goal 1 they form a closed square.
  Sandbox sandbox;
  const double right = 0.5 * std::acos(-1.0);
  Json scene = sandbox.json("data/scenes/paper_52_apf.json");
  scene["robot"]["file"] = "data/robots/planar4.json";
  scene["model"] = {{"self_collision", true}};
  scene["goals"] = {{{"type", "joint"}, {"q", {0.0, right, right, right}}},
                    {{"type", "position"}, {"position_m", {4.0, 0.0, 0.0}}},
                    {{"type", "joint"}, {"q", {0.0, 0.0, 0.0, 0.0}}}};
  Json ahead = {
      {"name", "ahead"}, {"type", "sphere"}, {"radius_m", 0.05}, {"position_m", {4.06, 0.0, 0.0}}};
  Json mover = {
      {"name", "mover"}, {"type", "sphere"}, {"radius_m", 0.05}, {"position_m", {0.5, 1.0, 0.0}}};
  mover["motion"] = {{"type", "sine"}, {"amplitude_m", {0.0, 0.0, 1.0}}, {"period_s", 2.0}};
  scene["obstacles"] = {ahead, mover};
  sandbox.put("scene.json", scene.dump());
  const Json info = test::run_json(sandbox, {"scene", "info", "scene.json"});
  CHECK(info["clearance_at_start_m"].get<double>() == Approx(-0.01));
  CHECK(info["self_clearance_at_start_m"].get<double>() == Approx(0.96));
  std::vector<std::string> notes = info["warnings"];
  REQUIRE_FALSE(notes.empty());
  CHECK_THAT(notes[0], Catch::Contains("link1-link2"));
  notes.erase(notes.begin());
  CHECK(notes ==
        std::vector<std::string>{
            "start: sphere 25 of link 'link4' is 10 mm inside obstacle 'ahead'; the exit direction "
            "is (-1, 0, 0)",
            "goal 1: the arm touches itself: 'link1' and 'link4' are 40 mm inside each other",
            "goal 3: sphere 25 of link 'link4' is 10 mm inside obstacle 'ahead'; the exit "
            "direction is (-1, 0, 0)"});

  scene["model"]["self_collision"] = false;
  scene["obstacles"] = Json::array();
  sandbox.put("scene.json", scene.dump());
  const Json plain = test::run_json(sandbox, {"scene", "info", "scene.json"});
  CHECK(plain["self_clearance_at_start_m"].is_null());
  CHECK(plain["warnings"].empty());
}

TEST_CASE("schema print prints the shipped schemas", "[end_to_end]") {
  Sandbox sandbox;
  int printed = 0;
  for (const auto& entry :
       fs::directory_iterator(fs::path(HAMELIN_SOURCE_DIR) / "docs" / "schema")) {
    const std::string file = entry.path().filename().string(),
                      name = file.substr(0, file.find('.'));
    CAPTURE(name);
    const auto output = sandbox.run({"schema", "print", name});
    CHECK(output.exit_code == 0);
    CHECK(parse_json(output.out, "standard output") == read_json(entry.path()));
    ++printed;
  }
  CHECK(printed >= 6);
}

TEST_CASE("the seed determines random clutter", "[end_to_end]") {
  Sandbox sandbox;
  const auto make = [&](const std::string& seed, const std::string& file) {
    REQUIRE(sandbox
                .run({"scene", "make", "--clutter", "6", "--seed", seed, "--resolution", "0.05",
                      "-o", file})
                .exit_code == 0);
    return sandbox.text(file);
  };
  const std::string first = make("7", "a.bt");
  CHECK((make("7", "b.bt") == first));
  CHECK((make("8", "c.bt") != first));
}

namespace {

void check_tip(const fs::path& file, const std::string& tip) {
  Sandbox sandbox;
  CAPTURE(file, tip);
  const auto with = sandbox.run({"robot", "info", file.string(), "--tip", tip});
  CAPTURE(with.err);
  CHECK(with.exit_code == 0);
  CHECK_THAT(with.out, Catch::Contains(tip));
  const auto without = sandbox.run({"robot", "info", file.string()});
  CHECK(without.exit_code == 2);
  CHECK(without.out.empty());
  CHECK(test::lines_of(without.err).size() == 1);
  CHECK_THAT(without.err, Catch::Contains("several leaves") && Catch::Contains(tip));
}

}  // namespace

TEST_CASE("the Panda's URDF loads with its tip and is refused without, listing the leaves",
          "[end_to_end]") {
  check_tip(test::third_party_robots / "panda.urdf", "panda_grasptarget");
}

TEST_CASE("the UR5's URDF loads with its tip and is refused without, listing the leaves",
          "[end_to_end]") {
  check_tip(fs::canonical(test::shared_data("robots")) / "ur5_robot.urdf", "tool0");
}

TEST_CASE("every damaged map is refused with one line, unusual maps are accepted with a note",
          "[end_to_end]") {
  Sandbox sandbox;
  for (const test::MapCase& map : test::map_cases()) {
    sandbox.put(map.name, map.bytes);
    const auto output = sandbox.run({"validate", map.name});
    CAPTURE(map.name, output.err);
    CHECK(output.exit_code == (map.accepted ? 0 : 2));
    CHECK_THAT(output.err, Catch::Contains(map.message));
    if (map.accepted && map.message.empty()) CHECK(output.err.empty());
    if (map.accepted) continue;
    CHECK(output.out.empty());
    CHECK(test::lines_of(output.err).size() == 1);
    CHECK_THAT(output.err, Catch::Contains(map.name));
  }
}
