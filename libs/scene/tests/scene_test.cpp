#include "hamelin/scene/scene.hpp"

#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/test/scene_data.hpp"
#include "hamelin/test/temporary.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;
using Eigen::Vector3d;

// A document with every kind of value of the format.
Json full_document() {
  return Json::parse(R"({
    "schema": "hamelin.scene/1",
    "robot": {"file": "../robots/arm7.urdf", "tip": "flange", "spheres": "../robots/arm7.spheres.json"},
    "base": {"position_m": [0.1, 0, 0.2], "quaternion_wxyz": [0.7071067811865476, 0, 0, 0.7071067811865476]},
    "gravity_m_s2": [0, 0, -9.81],
    "start": {"q": [0, -0.785, 0, -2.356, 0, 1.571, 0.785], "v": [0, 0, 0, 0, 0, 0, 0]},
    "goals": [
      {"type": "joint", "q": [0.4, 0.5, 0, -1.8, 0, 2.2, 0.785]},
      {"type": "position", "position_m": [0.5, 0.1, 0.4]},
      {"type": "pose", "position_m": [0.5, 0.1, 0.4], "quaternion_wxyz": [0, 1, 0, 0], "tolerance_m": 0.02}
    ],
    "map": {"file": "shelf.bt", "position_m": [1, 0, 0], "quaternion_wxyz": [1, 0, 0, 0], "scale": 1,
            "occupancy_threshold": 0.7, "unknown": "block", "keep_out_radius_m": 0.1,
            "self_filter": {"padding_m": 0.015},
            "changes": [{"time_s": 1.5, "file": "later.bt"},
                        {"time_s": 2, "free_boxes_m": [[0, 0, 0, 1, 1, 1]], "occupied_boxes_m": [[0, 0, 0, 0.5, 1, 1]]}]},
    "obstacles": [
      {"name": "ball", "type": "sphere", "radius_m": 0.06, "position_m": [0.5, 0, 0.5],
       "motion": {"type": "sine", "amplitude_m": [0.25, 0, 0], "period_s": 6},
       "known": false, "visible_within_m": 0.15, "appears_s": 2, "judge_only": false},
      {"name": "can", "type": "cylinder", "radius_m": 0.06, "length_m": 0.2, "position_m": [0.5, 0, 0.5], "judge_only": true},
      {"type": "box", "size_m": [0.1, 0.2, 0.3], "position_m": [0.5, 0, 0.5]},
      {"type": "sphere", "radius_m": 0.1, "position_m": [0.5, 0, 0.5],
       "motion": {"type": "linear", "velocity_m_s": [0, 0.1, 0], "start_s": 2}}
    ],
    "model": {"joint_damping": [0.1, 0.2], "joint_limits": true, "torque_limits": false, "payload": {"mass_kg": 0.5, "inertia_kg_m2": [1, 2, 3, 0.1, 0.2, 0.3]}},
    "actuation": {"type": "sampled", "control_period_s": 0.002, "delay_s": 0.001, "joint_noise_rad": 1e-4, "planner_mass_scale": 1.1},
    "planner": {"name": "hybrid", "params": {"escape": "none"}},
    "integrator": {"name": "hamel-variational", "params": {"tolerance": 1e-12}},
    "stall": {"hold_s": 2},
    "step_s": 0.001, "duration_s": 30, "seed": 9007199254740991
  })");
}

Json small_document() {
  return Json::parse(R"({"schema": "hamelin.scene/1", "robot": {"file": "r.json"}})");
}

std::string refusal(const Json& document) {
  try {
    (void)scene_from_json(document, ".", "x.json");
    return {};
  } catch (const Error& e) {
    return e.what();
  }
}

std::string set_refusal(const std::string& assignment) {
  Json document = full_document();
  const Json before = document;
  try {
    set_pointer(document, assignment);
    return {};
  } catch (const Error& e) {
    CHECK(document == before);
    return e.what();
  }
}

}  // namespace

TEST_CASE("a full scene is read field by field", "[scene][unit]") {
  const std::filesystem::path data = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";
  const Scene scene = scene_from_json(full_document(), data / "scenes", "data/scenes/full.json");
  CHECK(scene.name == "data/scenes/full.json");
  CHECK(scene.robot.file == data / "robots/arm7.urdf");
  CHECK(scene.robot.spheres == data / "robots/arm7.spheres.json");
  CHECK(scene.robot.tip == "flange");
  CHECK((scene.base * Vector3d(1.0, 0.0, 0.0) - Vector3d(0.1, 1.0, 0.2)).norm() < 1e-15);
  CHECK(scene.gravity_m_s2 == Vector3d(0.0, 0.0, -9.81));
  CHECK(scene.start_q[3] == -2.356);
  CHECK(scene.start_v.size() == 7);
  REQUIRE(scene.goals.size() == 3);
  CHECK(scene.goals[0].type == GoalType::joint);
  CHECK(scene.goals[0].q[5] == 2.2);
  CHECK(scene.goals[0].tolerance_rad == 0.05);
  CHECK(scene.goals[0].speed_max == 0.05);
  CHECK(scene.goals[1].type == GoalType::position);
  CHECK(scene.goals[1].tolerance_m == 0.02);
  CHECK(std::isinf(scene.goals[1].speed_max));
  CHECK_FALSE(scene.goals[1].tip_speed_max_m_s);
  CHECK(scene.goals[2].type == GoalType::pose);
  CHECK(scene.goals[2].tolerance_m == 0.02);
  CHECK(scene.goals[2].tolerance_rad == 0.26);
  CHECK(scene.goals[2].pose.R()(2, 2) == -1.0);
  REQUIRE(scene.map);
  CHECK(scene.map->file == data / "scenes" / "shelf.bt");
  CHECK(scene.map->pose.p().x() == 1.0);
  CHECK(scene.map->scale == 1.0);
  CHECK(scene.map->occupancy_threshold == 0.7);
  CHECK(scene.map->unknown == UnknownPolicy::block);
  CHECK(scene.map->keep_out_radius_m == 0.1);
  CHECK(scene.map->self_filter_padding_m == 0.015);
  REQUIRE(scene.obstacles.size() == 4);
  CHECK(std::get<SineMotion>(*scene.obstacles[0].motion).period_s == 6.0);
  CHECK_FALSE(scene.obstacles[0].known);
  CHECK(scene.obstacles[0].visible_within_m == 0.15);
  CHECK(scene.obstacles[0].appears_s == 2.0);
  CHECK(scene.obstacles[1].length_m == 0.2);
  CHECK(scene.obstacles[1].judge_only);
  CHECK(scene.obstacles[2].size_m.z() == 0.3);
  CHECK(scene.model.joint_damping.values == std::vector<double>{0.1, 0.2});
  CHECK(scene.model.joint_limits);
  CHECK_FALSE(scene.model.torque_limits);
  CHECK(scene.model.velocity_limits);
  CHECK(scene.model.payload->inertia_kg_m2(0, 2) == 0.2);
  CHECK(scene.actuation.type == ActuationType::sampled);
  CHECK(scene.actuation.control_period_s == 0.002);
  CHECK(scene.actuation.planner_mass_scale == 1.1);
  CHECK(scene.planner->params["escape"] == "none");
  CHECK(scene.integrator.params["tolerance"] == 1e-12);
  CHECK(scene.stall->hold_s == 2.0);
  CHECK(scene.stall->distance_m == 0.2);
  CHECK(scene.duration_s == 30.0);
  CHECK(scene.seed == 9007199254740991ULL);
}

TEST_CASE("parts that a scene does not name have their defaults, and null means the same",
          "[scene][unit]") {
  Json document = small_document();
  const Json absent = resolved_json(scene_from_json(document, ".", "x.json"));
  for (const char* key :
       {"start", "goals", "map", "obstacles", "model", "actuation", "planner", "stall"})
    document[key] = nullptr;
  CHECK(resolved_json(scene_from_json(document, ".", "x.json")) == absent);
  const Scene scene = scene_from_json(document, ".", "x.json");
  CHECK_FALSE(scene.map);
  CHECK_FALSE(scene.planner);
  CHECK_FALSE(scene.stall);
  CHECK(scene.model.joint_damping.values.empty());
  CHECK(scene.actuation.control_period_s == scene.step_s);
  CHECK(scene.integrator.name == "hamel-variational");
}

TEST_CASE("gravity acts and limits are kept unless a scene switches them off", "[scene][unit]") {
  const auto resolved = [](const Json& document) {
    return resolved_json(scene_from_json(document, ".", "x.json"));
  };
  Json document = small_document();
  const Json schema = Json::parse(schema_text("scene"))["properties"];
  const Json defaults = resolved(document);
  const Json made = resolved_json(Scene());
  CHECK(made["gravity_m_s2"] == defaults["gravity_m_s2"]);
  CHECK(made["model"] == defaults["model"]);
  CHECK(defaults["gravity_m_s2"] == Json({0.0, 0.0, -9.81}));
  CHECK(schema["gravity_m_s2"]["default"] == defaults["gravity_m_s2"]);
  for (const char* key : {"joint_limits", "velocity_limits", "torque_limits"}) {
    CAPTURE(key);
    CHECK(defaults["model"][key] == true);
    CHECK(schema["model"]["properties"][key]["default"] == true);
    document["model"] = {{key, nullptr}};
    CHECK(resolved(document)["model"][key] == true);
    document["model"] = {{key, false}};
    Json expected = defaults["model"];
    expected[key] = false;
    CHECK(resolved(document)["model"] == expected);
    CHECK(resolved(resolved(document)) == resolved(document));
  }
  CHECK(defaults["model"]["self_collision"] == false);
  document.erase("model");
  // The headers of earlier logs have null for a weightless scene, which must stay one.
  for (const Json& none : {Json(nullptr), Json({0, 0, 0})}) {
    document["gravity_m_s2"] = none;
    CHECK(resolved(document)["gravity_m_s2"] == Json({0.0, 0.0, 0.0}));
  }
  set_pointer(document, "/gravity_m_s2=[0, -9.81, 0]");
  CHECK(resolved(document)["gravity_m_s2"] == Json({0.0, -9.81, 0.0}));
}

TEST_CASE("paths of a scene follow symbolic links as the system does", "[scene][unit]") {
  const test::TemporaryFolder folder;
  const std::filesystem::path& root = folder.path();
  std::filesystem::create_directories(root / "project" / "scenes");
  std::filesystem::create_directory(root / "mine");
  // mine/scenes links to project/scenes, so mine/scenes/../robots is project/robots
  std::filesystem::create_directory_symlink(root / "project" / "scenes", root / "mine" / "scenes");
  const Json document{
      {"schema", "hamelin.scene/1"},
      {"robot", {{"file", "../robots/a.json"}, {"spheres", "../robots/s.json"}}},
      {"map",
       {{"file", "../maps/m.bt"}, {"changes", {{{"time_s", 1}, {"file", "../maps/c.bt"}}}}}}};
  for (const char* folder : {"robots", "maps"})
    for (const char* side : {"project", "mine"})
      std::filesystem::create_directory(root / side / folder);
  for (const char* file : {"robots/a.json", "robots/s.json", "maps/m.bt", "maps/c.bt"})
    for (const char* side : {"project", "mine"}) write_file_atomically(root / side / file, side);
  const Scene scene = scene_from_json(document, root / "mine" / "scenes", "x.json");
  for (const auto& file : input_files(scene)) {
    CAPTURE(file);
    CHECK(read_file(file) == "project");
  }
  CHECK(input_files(scene).size() == 4);
  CHECK(scene_from_json(document, root / "project" / "scenes", "x.json").map->file ==
        root / "project/maps/m.bt");
}

TEST_CASE("position actuation has servos, and MuJoCo takes torques", "[scene][unit]") {
  Json document = small_document();
  const auto read = [&] { return scene_from_json(document, ".", "x.json"); };
  CHECK_FALSE(resolved_json(read()).contains("plant"));
  document["plant"] = {{"type", "mujoco"}};
  CHECK_THROWS_WITH(read(),
                    "x.json: /actuation/type: is ideal, expected sampled or position because "
                    "the joints of MuJoCo take torques");
  document["actuation"] = {{"type", "position"}};
  CHECK_THROWS_WITH(read(),
                    "x.json: /actuation/servo: is missing, expected the gains kp and kv of "
                    "the position servos");
  document["actuation"]["servo"] = {
      {"kp", 2000.0}, {"kv", {80.0, 40.0}}, {"jerk_max", {7500.0, 3750.0}}};
  CHECK(read().plant == PlantType::mujoco);
  CHECK(read().actuation.type == ActuationType::position);
  CHECK(read().actuation.servo.kp == std::vector{2000.0});
  CHECK(read().actuation.servo.kv == std::vector{80.0, 40.0});
  CHECK(read().actuation.servo.acceleration_max == std::vector{15.0});
  CHECK(read().actuation.servo.jerk_max == std::vector{7500.0, 3750.0});
  const Json resolved = resolved_json(read());
  CHECK_NOTHROW(check_shipped_schema(resolved, "scene", "resolved"));
  CHECK(resolved["plant"]["type"] == "mujoco");
  Json servo{{"kp", 2000.0}, {"kv", {80.0, 40.0}}, {"feedforward", "dynamics"}};
  servo["acceleration_max"] = 15.0;
  servo["jerk_max"] = {7500.0, 3750.0};
  CHECK(resolved["actuation"]["servo"] == servo);
  CHECK(resolved_json(scene_from_json(resolved, ".", "x.json")) == resolved);
  document["actuation"]["torque_rate_max_Nm_s"] = 1000.0;
  CHECK_THROWS_WITH(read(), Catch::Contains("/actuation/torque_rate_max_Nm_s: is not allowed"));
  document["actuation"].erase("torque_rate_max_Nm_s");
  document["actuation"]["type"] = "sampled";
  CHECK_THROWS_WITH(read(),
                    "x.json: /actuation/servo: is not allowed, expected position actuation");
  document["actuation"].erase("servo");
  CHECK(read().plant == PlantType::mujoco);
}

TEST_CASE("the resolved scene reads back as itself", "[scene][unit]") {
  for (const Json& document : {full_document(), small_document()}) {
    const Json resolved = resolved_json(scene_from_json(document, "a/b", "x.json"));
    CHECK_NOTHROW(check_shipped_schema(resolved, "scene", "resolved"));
    for (const char* key : {"file", "tip", "spheres", "srdf"})
      CHECK(resolved["robot"].contains(key));
    CHECK(resolved_json(scene_from_json(resolved, ".", "x.json")).dump() == resolved.dump());
    CHECK(scene_from_json(resolved, ".", "x.json").base ==
          scene_from_json(document, "a/b", "x.json").base);
  }
  // A pose changed by the program is written as it is now.
  Scene scene = scene_from_json(full_document(), ".", "x.json");
  scene.base = geometry::SE3{};
  CHECK(resolved_json(scene)["base"]["quaternion_wxyz"] == Json{1.0, 0.0, 0.0, 0.0});
}

TEST_CASE("the scenes in data are read", "[scene][unit]") {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(test::data / "scenes")) {
    CAPTURE(entry.path());
    const Scene scene = read_scene(entry.path());
    CHECK(std::filesystem::exists(scene.robot.file));
    if (scene.planner) CHECK_FALSE(scene.goals.empty());
    ++count;
  }
  CHECK(count >= 6);
}

TEST_CASE("bad scenes are refused in one line that names file, place and what was expected",
          "[scene][unit]") {
  const auto with = [](const std::string& pointer, const Json& value) {
    Json document = full_document();
    document[Json::json_pointer(pointer)] = value;
    return document;
  };
  Json no_robot = small_document();
  no_robot.erase("robot");
  const std::vector<std::pair<Json, std::string>> cases{
      {no_robot, "robot"},
      {Json::array(), "/"},
      {with("/schema", "hamelin.scene/2"), "/schema"},
      {with("/gravity", 9.81), "gravity_m_s2"},
      {with("/gravity_m_s2", Json{0, 9.81}), "/gravity_m_s2"},
      {with("/step_s", 0), "/step_s"},
      {with("/step_s", "0.001"), "/step_s"},
      {with("/seed", -1), "/seed"},
      {with("/base/quaternion_wxyz", Json{1, 1, 0, 0}), "unit quaternion"},
      {with("/goals/0/type", "place"), "/goals/0/type"},
      {with("/goals/0/position_m", Json{0, 0, 0}), "/goals/0/position_m"},
      {with("/goals/1", Json{{"type", "position"}}), "/goals/1/position_m"},
      {with("/goals/1/quaternion_wxyz", Json{1, 0, 0, 0}), "/goals/1/quaternion_wxyz"},
      {with("/goals/2/tolerance_rad", -1), "/goals/2/tolerance_rad"},
      {with("/goals/0/tip_speed_max_m_s", 0.05), "/goals/0/tip_speed_max_m_s"},
      {with("/goals/2/tip_speed_max_m_s", 0), "/goals/2/tip_speed_max_m_s"},
      {with("/obstacles/0/length_m", 1), "/obstacles/0/length_m"},
      {with("/obstacles/0/radius_m", 0), "/obstacles/0/radius_m"},
      {with("/obstacles/2/size_m", Json{1, 1}), "/obstacles/2/size_m"},
      {with("/obstacles/0/motion/type", "saw"), "/obstacles/0/motion/type"},
      {with("/obstacles/0/motion/period", 3), "'period_s'"},
      {with("/obstacles/0/motion/start_s", 3), "/obstacles/0/motion/start_s"},
      {with("/obstacles/3/motion/period_s", 3), "/obstacles/3/motion/period_s"},
      {with("/map/changes/1/time_s", 1), "expected changes by time"},
      {with("/map/changes/0/file", nullptr), "/map/changes/0/file"},
      {with("/map/changes/1/free_boxes_m/0/3", 0), "/map/changes/1/free_boxes_m/0"},
      {with("/map/changes/1/free_boxes_m/0", Json{1, 2}), "/map/changes/1/free_boxes_m/0"},
      {with("/map/unknown", "wall"), "/map/unknown"},
      {with("/map/occupancy_threshold", 1), "/map/occupancy_threshold"},
      {with("/map/scale", 0), "/map/scale"},
      {with("/model/joint_damping", "file"), "/model/joint_damping"},
      {with("/actuation/control_period_s", 0.0015), "integer multiple"},
      {with("/actuation/type", "ideal"), "one tick per step"},
      {with("/planner", Json::object()), "name"},
  };
  for (const auto& [document, expected] : cases) {
    const std::string message = refusal(document);
    CAPTURE(message, expected);
    CHECK(message.rfind("x.json: ", 0) == 0);
    CHECK(message.find(expected) != std::string::npos);
    CHECK(message.find('\n') == std::string::npos);
  }
}

TEST_CASE("changes of a map and motion on a line are read", "[scene][unit]") {
  const Scene scene = scene_from_json(full_document(), "/scenes", "x.json");
  REQUIRE(scene.map->changes.size() == 2);
  CHECK(scene.map->changes[0].time_s == 1.5);
  CHECK(scene.map->changes[0].file == "/scenes/later.bt");
  CHECK_FALSE(scene.map->changes[1].file);
  CHECK(scene.map->changes[1].free_m.at(0).hi == Eigen::Vector3d::Ones());
  CHECK(scene.map->changes[1].occupied_m.at(0).hi.x() == 0.5);
  const auto& line = std::get<LinearMotion>(*scene.obstacles.at(3).motion);
  CHECK(line.velocity_m_s.y() == 0.1);
  CHECK(line.start_s == 2.0);
  CHECK(std::isinf(line.duration_s));
}

TEST_CASE("a self-filter may be true, false or a padding", "[scene][unit]") {
  Json document = full_document();
  const auto padding = [&](const Json& value) {
    document["map"]["self_filter"] = value;
    const Scene scene = scene_from_json(document, ".", "x.json");
    const Json resolved = resolved_json(scene)["map"]["self_filter"];
    CHECK(resolved == (scene.map->self_filter_padding_m
                           ? Json{{"padding_m", *scene.map->self_filter_padding_m}}
                           : Json()));
    return scene.map->self_filter_padding_m;
  };
  CHECK(padding(true) == default_self_filter_padding_m);
  CHECK(padding(Json::object()) == default_self_filter_padding_m);
  CHECK(padding({{"padding_m", 0}}) == 0.0);
  CHECK(padding(false) == std::nullopt);
  CHECK(padding(nullptr) == std::nullopt);
  document["map"]["self_filter"] = {{"padding_m", -0.1}};
  CHECK(refusal(document).find("/map/self_filter/padding_m") != std::string::npos);
  document["map"]["self_filter"] = {{"paddng_m", 0.1}};
  CHECK(refusal(document).find("'padding_m'") != std::string::npos);
}

TEST_CASE("maps that sensors make, and sensors, are read and read back", "[scene][unit]") {
  Json document = small_document();
  document["map"] = {
      {"resolution_m", 0.02}, {"unknown", "block"}, {"points", {{"margin_m", 0.01}}}};
  document["sensors"] = {{{"type", "depth"},
                          {"mount", "tip"},
                          {"position_m", {0.0, 0.1, 0.05}},
                          {"size", {32, 24}},
                          {"rate_hz", 5.0}},
                         {{"type", "depth"}, {"name", "beside"}},
                         {{"type", "depth"}, {"mount", "frame"}, {"frame", "wrist"}}};
  const auto read = [&] { return scene_from_json(document, ".", "x.json"); };
  const auto check_read = [](const Scene& scene) {
    REQUIRE(scene.map);
    CHECK(scene.map->file.empty());
    CHECK(scene.map->resolution_m == 0.02);
    CHECK(scene.map->points.margin_m == 0.01);
    CHECK(scene.map->points.most == 0.75);
    REQUIRE(scene.sensors.size() == 3);
    CHECK(scene.sensors[0].name == "camera 1");
    CHECK(scene.sensors[0].mount == Mount::tip);
    CHECK(scene.sensors[0].pose.p().y() == 0.1);
    CHECK(scene.sensors[0].width == 32);
    CHECK(scene.sensors[0].rate_hz == 5.0);
    CHECK(scene.sensors[1].name == "beside");
    CHECK(scene.sensors[1].mount == Mount::world);
    CHECK(scene.sensors[2].mount == Mount::frame);
    CHECK(scene.sensors[2].frame == "wrist");
    CHECK(input_files(scene).size() == 1);
  };
  check_read(read());
  check_read(scene_from_json(resolved_json(read()), ".", "x.json"));
  document["sensors"][2].erase("frame");
  CHECK_THROWS_WITH(read(), Catch::Contains("/sensors/2/frame: is not given, expected one with"));
  document["sensors"][2] = {{"type", "depth"}, {"frame", "wrist"}};
  CHECK_THROWS_WITH(read(), Catch::Contains("/sensors/2/frame: is given, expected mount"));
  document["sensors"].erase(2);
  document["map"]["points"]["least"] = 0.45;
  document["map"]["points"]["most"] = 0.5;
  CHECK(read().map->points.least == 0.45);
  document["map"] = {{"unknown", "block"}};
  CHECK_THROWS_WITH(read(),
                    "x.json: /map/file: is missing, expected it or, for a map that sensors make, "
                    "resolution_m");
  document["map"] = {{"file", "m.bt"}, {"resolution_m", 0.02}};
  CHECK_THROWS_WITH(
      read(), "x.json: /map/resolution_m: is given in addition to file, expected one of them");
  document["map"] = {{"resolution_m", 0.02}, {"known", false}};
  CHECK_THROWS_WITH(read(),
                    "x.json: /map/known: is false, but there is no file, expected one that sensors "
                    "see");
  document["map"] = {{"file", "m.bt"}, {"known", false}};
  CHECK_FALSE(read().map->known);
  document["map"] = nullptr;
  CHECK_THROWS_WITH(read(),
                    "x.json: /sensors/0/type: there is no map, expected one in the scene, into "
                    "which a sensor sees");
}

TEST_CASE("set_pointer sets keys that the schema defines and nothing else", "[scene][unit]") {
  Json document = full_document();
  set_pointer(document, "/step_s=0.002");
  set_pointer(document, "/map/unknown=slow");
  set_pointer(document, "/goals/0/q=[1, 2]");
  set_pointer(document, "/planner/params/gain=7");
  set_pointer(document, "/robot/tip=\"5\"");
  set_pointer(document, "/model/payload=null");
  CHECK(document["step_s"] == 0.002);
  CHECK(document["map"]["unknown"] == "slow");
  CHECK(document["goals"][0]["q"] == Json{1, 2});
  CHECK(document["planner"]["params"]["gain"] == 7);
  CHECK(document["robot"]["tip"] == "5");
  CHECK(document["model"]["payload"].is_null());
  Json bare = small_document();
  set_pointer(bare, "/stall/hold_s=3");
  set_pointer(bare, "/planner/name=apf");
  CHECK(scene_from_json(bare, ".", "x.json").stall->hold_s == 3.0);
  CHECK(scene_from_json(bare, ".", "x.json").planner->name == "apf");
}

TEST_CASE("set_pointer refuses in one line and leaves the document unchanged", "[scene][unit]") {
  const std::vector<std::pair<std::string, std::string>> cases{
      {"/stepp_s=1", "'step_s'"},
      {"/map/unknwon=free", "'unknown'"},
      {"/goals/7/q=[1]", "no element '7'"},
      {"/goals/x=1", "no element 'x'"},
      {"/step_s", "=VALUE"},
      {"step_s=1", "=VALUE"},
      {"", "=VALUE"},
      {"/step_s/deep=1", "plain value"},
      {"/a~2b=1", "pointer"},
      {"/obstacles/0/motion/speed=1", "speed"}};
  for (const auto& [assignment, expected] : cases) {
    const std::string message = set_refusal(assignment);
    CAPTURE(message, expected);
    CHECK(message.rfind(assignment, 0) == 0);
    CHECK(message.find(expected) != std::string::npos);
    CHECK(message.find('\n') == std::string::npos);
  }
}

TEST_CASE("a path is a joint goal with way-points, and reads back as one", "[scene][unit]") {
  Json document = small_document();
  document["goals"] = {
      {{"type", "path"}, {"q", {{0.1, 0.2}, {0.3, 0.4}, {0.5, 0.75}}}, {"tolerance_rad", 0.1}}};
  const Scene scene = scene_from_json(document, ".", "x.json");
  const Goal& goal = scene.goals.at(0);
  CHECK(goal.type == GoalType::joint);
  CHECK(type_name(goal) == "path");
  REQUIRE(goal.path.cols() == 3);
  CHECK(goal.path(1, 0) == 0.2);
  CHECK(goal.q == Eigen::Vector2d(0.5, 0.75));
  CHECK(goal.tolerance_rad == 0.1);
  CHECK(goal.speed_max == 0.05);
  const Json resolved = resolved_json(scene);
  CHECK(resolved["goals"][0]["q"] == document["goals"][0]["q"]);
  CHECK(resolved["goals"][0]["type"] == "path");
  CHECK(resolved_json(scene_from_json(resolved, ".", "x.json")) == resolved);

  const auto refusal = [&](const Json& changed_goal) -> std::string {
    document["goals"] = Json::array({changed_goal});
    try {
      (void)scene_from_json(document, ".", "x.json");
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  };
  CHECK_THAT(refusal({{"type", "path"}, {"q", Json::array()}}),
             Catch::Contains("/goals/0/q: is empty"));
  CHECK_THAT(refusal({{"type", "path"}, {"q", {0.1, 0.2}}}),
             Catch::Contains("/goals/0/q/0: expected a way-point"));
  CHECK_THAT(refusal({{"type", "path"}, {"q", {{0.1, 0.2}, {0.3}}}}),
             Catch::Contains("/goals/0/q/1: 1 values given, expected 2"));
  CHECK_THAT(refusal({{"type", "joint"}, {"q", {{0.1, 0.2}}}}),
             Catch::Contains("/goals/0/q/0: is a list"));
  CHECK_THAT(refusal({{"type", "path"}}), Catch::Contains("/goals/0/q: is missing"));
}

TEST_CASE("goals that follow a target are read, and read back", "[scene][unit]") {
  Json document = small_document();
  document["goals"] = {
      {{"type", "joint"}, {"q", {0.1}}},
      {{"type", "follow"},
       {"position_m", {0.5, 0.1, 0.4}},
       {"quaternion_wxyz", {0, 1, 0, 0}},
       {"motion", {{"type", "sine"}, {"amplitude_m", {0, 0.25, 0}}, {"period_s", 6}}},
       {"tolerance_m", 0.02}}};
  Scene scene = scene_from_json(document, ".", "x.json");
  const Goal& by_motion = scene.goals.at(1);
  CHECK(by_motion.type == GoalType::follow);
  CHECK_FALSE(by_motion.position_only);
  CHECK(std::get<SineMotion>(*by_motion.motion).period_s == 6.0);
  CHECK(by_motion.pose.R()(2, 2) == -1.0);
  CHECK(by_motion.tolerance_m == 0.02);
  CHECK(by_motion.tolerance_rad == 0.1);
  Json resolved = resolved_json(scene);
  CHECK(resolved_json(scene_from_json(resolved, ".", "x.json")) == resolved);

  document["goals"] = {{{"type", "follow"},
                        {"tracks", "position"},
                        {"stream",
                         {{"file", "target.jsonl"},
                          {"gap_max_s", 0.5},
                          {"jump_max_m", 0.3},
                          {"noise_m", 0.002},
                          {"leash_m", 0.1},
                          {"when_lost", "end"}}}}};
  scene = scene_from_json(document, "/folder", "x.json");
  const Goal& streamed = scene.goals.at(0);
  CHECK(streamed.position_only);
  CHECK_FALSE(streamed.motion);
  CHECK(streamed.stream.file == "/folder/target.jsonl");
  CHECK(streamed.stream.gap_max_s == 0.5);
  CHECK(streamed.stream.jump_max_m == 0.3);
  CHECK(streamed.stream.jump_max_rad == 0.5);
  CHECK(streamed.stream.noise_m == 0.002);
  CHECK(streamed.stream.leash_m == 0.1);
  CHECK(streamed.stream.when_lost == WhenLost::end);
  CHECK(target_file(streamed) == "/folder/target.jsonl");
  const auto files = input_files(scene);
  CHECK(std::find(files.begin(), files.end(), "/folder/target.jsonl") != files.end());
  resolved = resolved_json(scene);
  CHECK(resolved_json(scene_from_json(resolved, ".", "x.json")) == resolved);
}

TEST_CASE("goals that follow a target are refused where they are wrong", "[scene][unit]") {
  const Json motion{{"type", "sine"}, {"amplitude_m", {0, 0.25, 0}}, {"period_s", 6}};
  const auto message = [&](const Json& goals) {
    Json document = small_document();
    document["goals"] = goals;
    return refusal(document);
  };
  CHECK(message({{{"type", "follow"}}, {{"type", "joint"}, {"q", {0.1}}}}) ==
        "x.json: /goals/0: is a follow goal, which is never reached, expected it as the last goal");
  CHECK_THAT(message({{{"type", "follow"}, {"motion", motion}}}),
             Catch::Contains("/goals/0/position_m: is missing, expected for a follow goal"));
  CHECK_THAT(
      message({{{"type", "follow"}, {"motion", motion}, {"position_m", {0, 0, 0}}}}),
      Catch::Contains("/goals/0/quaternion_wxyz: is missing, expected for a follow goal that "
                      "tracks a pose"));
  CHECK_THAT(message({{{"type", "follow"}, {"position_m", {0, 0, 0}}}}),
             Catch::Contains("/goals/0/position_m: is not allowed for a follow goal without a "
                             "motion"));
  CHECK_THAT(message({{{"type", "follow"}, {"q", {0.1}}}}),
             Catch::Contains("/goals/0/q: is not allowed for a follow goal"));
  CHECK_THAT(message({{{"type", "position"}, {"position_m", {0, 0, 0}}, {"motion", motion}}}),
             Catch::Contains("/goals/0/motion: is not allowed for a position goal"));
  CHECK_THAT(message({{{"type", "follow"}, {"stream", {{"gap_max_s", 0}}}}}),
             Catch::Contains("/goals/0/stream/gap_max_s"));
}

TEST_CASE("the largest tip speed at a goal is read, and read back", "[scene][unit]") {
  Json document = full_document();
  document["goals"][1]["tip_speed_max_m_s"] = 0.05;
  document["goals"][2]["tip_speed_max_m_s"] = nullptr;
  const Scene scene = scene_from_json(document, ".", "x.json");
  CHECK(scene.goals[1].tip_speed_max_m_s == 0.05);
  CHECK_FALSE(scene.goals[2].tip_speed_max_m_s);
  const Json resolved = resolved_json(scene);
  CHECK_FALSE(resolved["goals"][0].contains("tip_speed_max_m_s"));
  CHECK(resolved["goals"][1]["tip_speed_max_m_s"] == 0.05);
  CHECK(resolved["goals"][2]["tip_speed_max_m_s"].is_null());
  CHECK(resolved_json(scene_from_json(resolved, ".", "x.json")) == resolved);
}

TEST_CASE("a velocity estimator is read, read back, and refused where nothing is sampled",
          "[scene][unit]") {
  Json document = small_document();
  document["actuation"] = {
      {"type", "sampled"}, {"joint_velocity", "estimated"}, {"estimator_bandwidth", 30.0}};
  const Scene scene = scene_from_json(document, ".", "x.json");
  CHECK(scene.actuation.estimates_velocity);
  CHECK(scene.actuation.estimator_bandwidth == 30.0);
  const Json resolved = resolved_json(scene);
  CHECK_NOTHROW(check_shipped_schema(resolved, "scene", "resolved"));
  CHECK(resolved_json(scene_from_json(resolved, ".", "x.json")) == resolved);
  document["actuation"]["estimator_bandwidth"] = 0.0;
  CHECK_THROWS_WITH(scene_from_json(document, ".", "x.json"),
                    Catch::Contains("/actuation/estimator_bandwidth"));
  document["actuation"]["estimator_bandwidth"] = 30.0;
  document["actuation"]["type"] = "ideal";
  CHECK_THROWS_WITH(scene_from_json(document, ".", "x.json"),
                    "x.json: /actuation/joint_velocity: 'estimated' is not allowed, expected "
                    "sampled actuation");
}

TEST_CASE("friction and the torque rate limit are read, and read back", "[scene][unit]") {
  Json document = small_document();
  document["actuation"] = {
      {"type", "sampled"}, {"torque_rate_max_Nm_s", 1000.0}, {"coulomb_friction_share", 0.05}};
  const Scene scene = scene_from_json(document, ".", "x.json");
  CHECK(scene.actuation.torque_rate_max_Nm_s == 1000.0);
  CHECK(scene.actuation.coulomb_friction_share == 0.05);
  const Json resolved = resolved_json(scene);
  CHECK(resolved_json(scene_from_json(resolved, ".", "x.json")) == resolved);
  document["actuation"]["coulomb_friction_share"] = 1.5;
  CHECK_THROWS_WITH(scene_from_json(document, ".", "x.json"),
                    Catch::Matchers::Contains("coulomb_friction_share"));
  document["actuation"] = {{"torque_rate_max_Nm_s", 1000.0}};
  CHECK_THROWS_WITH(scene_from_json(document, ".", "x.json"),
                    Catch::Matchers::Contains("torque_rate_max_Nm_s"));
}

TEST_CASE("dry friction and rotor inertia are read, and read back", "[scene][unit]") {
  Json document = small_document();
  CHECK(scene_from_json(document, ".", "x.json").model.friction.values.empty());
  CHECK(scene_from_json(document, ".", "x.json").model.armature.from_robot);  // part of the robot
  CHECK(resolved_json(scene_from_json(document, ".", "x.json"))["model"]["armature"] == "robot");
  document["model"] = {{"friction", {0.5, 0.25}}, {"friction_speed", 0.02}, {"armature", 0.1}};
  const Scene scene = scene_from_json(document, ".", "x.json");
  CHECK(scene.model.friction.values == std::vector<double>{0.5, 0.25});
  CHECK(scene.model.friction_speed == 0.02);
  CHECK_FALSE(scene.model.armature.from_robot);
  CHECK(scene.model.armature.values == std::vector<double>{0.1});
  const Json resolved = resolved_json(scene);
  CHECK(resolved_json(scene_from_json(resolved, ".", "x.json")) == resolved);
  document["model"] = {{"friction", "robot"}, {"armature", 0}};
  CHECK(scene_from_json(document, ".", "x.json").model.friction.from_robot);
  CHECK_FALSE(scene_from_json(document, ".", "x.json").model.armature.from_robot);
  for (const auto& [key, bad] :
       std::vector<std::pair<std::string, Json>>{{"friction", -1.0},
                                                 {"friction", "file"},
                                                 {"friction_speed", 0.0},
                                                 {"armature", {0.1, -0.1}}}) {
    document["model"] = {{key, bad}};
    CHECK_THROWS_WITH(scene_from_json(document, ".", "x.json"),
                      Catch::Matchers::Contains("/model/" + key));
  }
}

namespace {

// Each new kind of obstacle, motion and prediction.
Json movers_document() {
  Json document = small_document();
  document["obstacles"] = Json::parse(R"([
    {"name": "hand", "type": "sphere", "radius_m": 0.05, "attached_to": "person",
     "position_m": [0.2, 0, 1], "quaternion_wxyz": [0.8, 0, 0.6, 0],
     "motion": {"type": "sine", "amplitude_m": [0, 0, 0.1], "period_s": 2}, "prediction": {"speed_max": 4}},
    {"name": "person", "type": "frame", "prediction": "path",
     "motion": {"type": "waypoints", "repeat": true, "gap_max_s": 5,
                "waypoints": [{"time_s": 0, "position_m": [0, 0, 0]},
                              {"time_s": 1, "position_m": [0.5, 0, 0], "quaternion_wxyz": [0.6, 0, 0, 0.8]},
                              {"time_s": 3, "position_m": [0, 0, 0]}]}},
    {"name": "arm", "type": "capsule", "radius_m": 0.04, "length_m": 0.3, "attached_to": "person"},
    {"name": "cart", "type": "box", "size_m": [0.4, 0.3, 0.2], "prediction": "constant-velocity",
     "motion": {"type": "waypoints", "file": "paths/cart.csv"}},
    {"name": "post", "type": "cylinder", "radius_m": 0.04, "length_m": 0.3, "position_m": [1, 0, 0],
     "prediction": "constant-acceleration", "attached_to": null}
  ])");
  return document;
}

constexpr const char* cart_csv =
    "time_s,x_m,y_m,z_m,qw,qx,qy,qz\n0,1,0,0,1,0,0,0\n0.7,1,0.1,0,0.96,0,0,0.28\n1.3,1,0.3,0.1,1,0,"
    "0,0\n";

}  // namespace

TEST_CASE("moving frames, capsules and way-points are read, and read back", "[scene][unit]") {
  const test::TemporaryFolder folder;
  const auto csv = folder.put("paths/cart.csv", cart_csv);
  const Scene scene = scene_from_json(movers_document(), folder.path(), "x.json");
  REQUIRE(scene.obstacles.size() == 5);
  const Obstacle &hand = scene.obstacles[0], &person = scene.obstacles[1],
                 &arm = scene.obstacles[2], &cart = scene.obstacles[3], &post = scene.obstacles[4];
  CHECK(hand.attached_to == "person");
  CHECK(hand.prediction == Prediction::speed_bound);
  CHECK(hand.speed_max_m_s == 4.0);
  CHECK(person.shape == Shape::frame);
  CHECK(person.prediction == Prediction::path);
  const WaypointPath& walk = *std::get<WaypointMotion>(*person.motion).path;
  CHECK(walk.options().repeat);
  CHECK(walk.options().gap_max_s == 5.0);
  CHECK(walk.waypoints()[1].quaternion_wxyz == Quaternion{0.6, 0.0, 0.0, 0.8});
  CHECK(arm.shape == Shape::capsule);
  CHECK(arm.length_m == 0.3);
  CHECK(arm.prediction == Prediction::constant_acceleration);
  CHECK(cart.prediction == Prediction::constant_velocity);
  CHECK(std::get<WaypointMotion>(*cart.motion).path->file() == csv);
  CHECK(post.attached_to.empty());
  // the hand moves with the person
  REQUIRE(hand.parent);
  const geometry::SE3 at = motion_at(person, 1.0).pose;
  CHECK((motion_at(hand, 1.0).pose.p() - at * Vector3d(0.2, 0.0, 1.0)).norm() < 1e-12);
  const auto files = input_files(scene);
  CHECK(std::count(files.begin(), files.end(), csv) == 1);

  const Json resolved = resolved_json(scene);
  CHECK(resolved["obstacles"][1]["motion"]["waypoints"].size() == 3);
  CHECK_FALSE(resolved["obstacles"][3]["motion"].contains("waypoints"));
  CHECK(resolved["obstacles"][0]["prediction"] == Json{{"speed_max", 4.0}});
  CHECK(resolved["obstacles"][4]["prediction"] == "constant-acceleration");
  CHECK_FALSE(resolved["obstacles"][1].contains("radius_m"));
  const Scene again = scene_from_json(resolved, "", "y.json");
  CHECK(resolved_json(again) == resolved);
  for (std::size_t i = 0; i < 5; ++i)
    for (const double t : {0.0, 0.9, 2.2}) {
      const MotionState a = motion_at(scene.obstacles[i], t), b = motion_at(again.obstacles[i], t);
      CHECK(a.pose.p() == b.pose.p());
      CHECK(a.pose.R() == b.pose.R());
      CHECK(a.velocity == b.velocity);
    }
}

TEST_CASE("moving frames, capsules and way-points that are wrong are refused with file and place",
          "[scene][unit]") {
  const test::TemporaryFolder folder;
  folder.put("paths/cart.csv", cart_csv);
  folder.put("bad.csv", "time_s,x_m,y_m,z_m\n0,0,0,0\n1,a,0,0\n");
  const auto message = [&](const char* pointer, const Json& value) -> std::string {
    Json document = movers_document();
    const Json::json_pointer at(std::string("/obstacles/") + pointer);
    if (value.is_discarded())
      document[at.parent_pointer()].erase(at.back());
    else
      document[at] = value;
    try {
      (void)scene_from_json(document, folder.path(), "x.json");
    } catch (const Error& e) {
      return e.what();
    }
    return "accepted";
  };
  const Json removed(Json::value_t::discarded);
  const std::string bad = (folder.path() / "bad.csv").string();
  const std::vector<std::tuple<const char*, Json, std::string>> cases{
      {"2/length_m", removed, "x.json: /obstacles/2/length_m: is missing, expected for a capsule"},
      {"2/size_m", Json{1, 1, 1}, "x.json: /obstacles/2/size_m: is not allowed for a capsule"},
      {"1/radius_m", 1.0, "x.json: /obstacles/1/radius_m: is not allowed for a frame"},
      {"1/length_m", 1.0, "x.json: /obstacles/1/length_m: is not allowed for a frame"},
      {"4/position_m", removed,
       "x.json: /obstacles/4/position_m: is missing, expected for a cylinder"},
      {"4/type", "cone", "x.json: /obstacles/4/type: "},
      {"2/attached_to", "nobody",
       "x.json: /obstacles/2: obstacle 'arm' is attached to 'nobody', expected the name of an "
       "obstacle"},
      {"2/attached_to", 3, "x.json: /obstacles/2/attached_to: "},
      {"1/attached_to", "person",
       "x.json: /obstacles/1: obstacle 'person' is attached to 'person'"},
      {"0/prediction", "oracle", "x.json: /obstacles/0/prediction: "},
      {"0/prediction", Json::object(), "x.json: /obstacles/0/prediction: "},
      {"0/prediction", Json{{"speed_max", 0}}, "x.json: /obstacles/0/prediction/speed_max: "},
      {"0/prediction", Json{{"speed_max", 2.0}},
       "x.json: /obstacles/0: its motion reaches 3.23 m/s, expected at most 2 m/s"},
      {"0/motion/repeat", true, "x.json: /obstacles/0/motion/repeat: is not allowed for a sine"},
      {"0/motion/file", "a.csv", "x.json: /obstacles/0/motion/file: is not allowed for a sine"},
      {"1/motion/period_s", 1.0,
       "x.json: /obstacles/1/motion/period_s: is not allowed for a motion by way-points"},
      {"1/motion/waypoints", removed,
       "x.json: /obstacles/1/motion/waypoints: is missing, expected waypoints or a file"},
      {"1/motion/file", "paths/cart.csv",
       "x.json: /obstacles/1/motion/file: is given in addition to waypoints, expected one"},
      {"1/motion/gap_max_s", 0.5, "x.json: /obstacles/1/motion/waypoints/1: 1 s after"},
      {"1/motion/waypoints/2/position_m", Json{1, 0, 0},
       "x.json: /obstacles/1/motion/waypoints/2: its pose is not that of the first"},
      {"1/motion/waypoints/2/time_s", 1.0,
       "x.json: /obstacles/1/motion/waypoints/2: time_s is 1 after 1"},
      {"1/motion/waypoints/0/speed", 1.0, "x.json: /obstacles/1/motion/waypoints/0"},
      {"1/motion/waypoints", Json::array(),
       "x.json: /obstacles/1/motion/waypoints: 0 way-points, expected two or more"},
      {"3/motion/repeat", true,
       "x.json: /obstacles/3/motion/file: " + (folder.path() / "paths/cart.csv").string() +
           ": line 4: its pose is not that of the first way-point"},
      {"3/motion/file", "none.csv", "x.json: /obstacles/3/motion/file: "},
      {"3/motion/file", "bad.csv",
       "x.json: /obstacles/3/motion/file: " + bad + ": line 3: x_m is 'a', expected a finite"},
  };
  CHECK(message("4/known", true) == "accepted");
  for (const auto& [pointer, value, expected] : cases) {
    const std::string found = message(pointer, value);
    CAPTURE(pointer, found, expected);
    CHECK(found.rfind(expected, 0) == 0);
    CHECK(found.find('\n') == std::string::npos);
  }
}
