#include "hamelin/scene/make.hpp"
#include <octomap/OcTree.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/scene/map_file.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/test/scene_data.hpp"
#include "hamelin/test/scene_queries.hpp"
#include "hamelin/test/temporary.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;
using Eigen::Vector3d;

using Voxels = std::set<std::tuple<int, int, int>>;

Voxels voxels_of(const std::vector<Cell>& cells) {
  Voxels voxels;
  for (const Cell& c : cells)
    for (int x = c.lo[0]; x < c.lo[0] + c.size; ++x)
      for (int y = c.lo[1]; y < c.lo[1] + c.size; ++y)
        for (int z = c.lo[2]; z < c.lo[2] + c.size; ++z) voxels.insert({x, y, z});
  return voxels;
}

}  // namespace

TEST_CASE("a made map marks the voxels whose centre a sphere contains, or that it touches",
          "[scene][unit]") {
  MakeMapOptions options;
  options.resolution_m = 0.05;
  options.output = test::temporary("hamelin_scene_made.bt");
  Obstacle ball;
  ball.radius_m = 0.31;
  ball.pose = {Eigen::Matrix3d::Identity(), {0.11, -0.23, 0.4}};
  options.primitives = {ball};
  for (const Mark mark : {Mark::centre, Mark::touch}) {
    CAPTURE(to_string(mark));
    options.mark = mark;
    const MakeReport report = make_map(options);
    const MapData map = read_map(report.output);
    CHECK(report.sha256 == map.sha256);
    CHECK(report.nodes == map.node_count);
    Voxels expected;
    for (int x = -20; x < 20; ++x)
      for (int y = -20; y < 20; ++y)
        for (int z = -20; z < 20; ++z) {
          const Vector3d middle = 0.05 * Vector3d(x + 0.5, y + 0.5, z + 0.5);
          const Vector3d off = (middle - ball.pose.p()).cwiseAbs();
          const double distance =
              mark == Mark::centre ? off.norm() : (off.array() - 0.025).max(0.0).matrix().norm();
          if (distance <= ball.radius_m) expected.insert({x, y, z});
        }
    CHECK(voxels_of(map.occupied) == expected);
    CHECK(report.occupied_voxels == expected.size());
  }
  std::filesystem::remove(options.output);
}

TEST_CASE("touch is exact for turned boxes and cylinders", "[scene][property]") {
  const auto shape = GENERATE(Shape::box, Shape::cylinder);
  Rng rng(31);
  int touching = 0, apart = 0;
  for (int i = 0; i < 400; ++i) {
    Clutter clutter;
    clutter.count = 1;
    clutter.size_min_m = 0.05;
    clutter.size_max_m = 0.3;
    clutter.bounds = {{-0.3, -0.3, -0.3}, {0.3, 0.3, 0.3}};
    clutter.seed = rng.next();
    Obstacle o = make_clutter(clutter).front();
    o.shape = shape;
    const Box cube{{-0.05, -0.05, -0.05}, {0.05, 0.05, 0.05}};
    // The nearest point of a fine grid in the cube: an upper bound of the gap, too large by half a
    // grid diagonal at most.
    double sampled = 1.0;
    const int n = 20;
    for (int x = 0; x <= n; ++x)
      for (int y = 0; y <= n; ++y)
        for (int z = 0; z <= n; ++z) {
          const Vector3d p = cube.lo + (cube.hi - cube.lo).cwiseProduct(Vector3d(x, y, z)) / n;
          sampled = std::min(sampled, closest_on(o, o.pose, p).distance);
        }
    const double slack = 0.5 * std::sqrt(3.0) * 0.1 / n;
    if (sampled <= 0.0) {
      CHECK(touches(o, cube));
      ++touching;
    } else if (sampled > slack) {
      CHECK_FALSE(touches(o, cube));
      ++apart;
    }
  }
  CHECK(touching > 20);
  CHECK(apart > 20);
}

TEST_CASE("a made map has the voxels that a test of each single voxel marks", "[scene][property]") {
  const auto seed = GENERATE(range(std::uint64_t{0}, std::uint64_t{6}));
  CAPTURE(seed);
  MakeMapOptions options;
  options.resolution_m = 0.03;
  options.mark = seed % 2 == 0 ? Mark::touch : Mark::centre;
  options.free_bounds = Box{{-0.7, -0.55, -0.2}, {0.4, 0.61, 0.9}};
  options.output = test::temporary("hamelin_scene_exhaustive.bt");
  Clutter clutter;
  clutter.count = 7;
  clutter.size_min_m = 0.02;
  clutter.size_max_m = 0.6;
  clutter.bounds = {{-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}};
  clutter.seed = seed;
  options.clutter = clutter;
  Obstacle slab;  // its faces are slightly beyond faces of voxels
  slab.shape = Shape::box;
  slab.size_m = Vector3d(0.6, 0.3, 0.06).array() + 2e-7;
  slab.pose = {Eigen::Matrix3d::Identity(), {0.12, -0.21, 0.72 + 0.03 * static_cast<double>(seed)}};
  options.primitives = {slab};
  const MakeReport report = make_map(options);
  const MapData map = read_map(options.output, {std::nullopt, 0.5, true});
  Voxels occupied, free;
  auto made = make_clutter(clutter);
  made.push_back(slab);
  for (int x = -40; x < 40; ++x)
    for (int y = -40; y < 40; ++y)
      for (int z = -40; z < 40; ++z) {
        const Box cube = to_metres(Cell{{x, y, z}, 1}, options.resolution_m);
        const Vector3d middle = 0.5 * (cube.lo + cube.hi);
        const bool marked = std::any_of(made.begin(), made.end(), [&](const Obstacle& o) {
          return options.mark == Mark::touch ? touches(o, cube)
                                             : closest_on(o, o.pose, middle).distance <= 0.0;
        });
        const bool inside = (middle.array() >= options.free_bounds->lo.array()).all() &&
                            (middle.array() <= options.free_bounds->hi.array()).all();
        if (marked) occupied.insert({x, y, z});
        if (inside && !marked) free.insert({x, y, z});
      }
  CHECK((voxels_of(map.occupied) == occupied));
  CHECK((voxels_of(map.free) == free));
  CHECK(report.occupied_voxels == occupied.size());
  CHECK(report.free_voxels == free.size());
  std::filesystem::remove(options.output);
}

TEST_CASE("a map of a single kind of space is written so that OctoMap reads it", "[scene][unit]") {
  MakeMapOptions options;
  options.resolution_m = 0.5;
  options.output = test::temporary("hamelin_scene_whole.bt");
  options.free_bounds = Box{Vector3d::Constant(-16384.0), Vector3d::Constant(16384.0)};
  const MakeReport report = make_map(options);
  CHECK(report.free_voxels == std::size_t{1} << 48U);
  octomap::OcTree tree(options.output.string());
  CHECK(tree.size() == report.nodes);
  CHECK(tree.getNumLeafNodes() == 8);
  CHECK(tree.search(100.0, -3000.0, 7.0) != nullptr);
  CHECK(read_map(options.output).free_leaves == 8);
  std::filesystem::remove(options.output);
}

TEST_CASE("everything outside of the free bounds is unknown", "[scene][unit]") {
  MakeMapOptions options;
  options.resolution_m = 0.1;
  options.free_bounds = Box{{-1.0, -1.0, 0.0}, {1.0, 1.0, 1.0}};
  options.output = test::temporary("hamelin_scene_free.bt");
  Obstacle slab;
  slab.shape = Shape::box;
  slab.size_m = {1.0, 1.0, 0.18};
  slab.pose = {Eigen::Matrix3d::Identity(), {0.0, 0.0, 0.5}};
  options.mark = Mark::centre;
  options.primitives = {slab};
  const MakeReport report = make_map(options);
  CHECK(report.occupied_voxels == 10 * 10 * 2);
  CHECK(report.free_voxels == 20 * 20 * 10 - report.occupied_voxels);
  std::filesystem::remove(options.output);
}

TEST_CASE("clutter avoids keep-out balls and the same seed gives the same bytes", "[scene][unit]") {
  MakeMapOptions options;
  options.resolution_m = 0.04;
  options.output = test::temporary("hamelin_scene_clutter.bt");
  Clutter clutter;
  clutter.count = 30;
  clutter.size_min_m = 0.05;
  clutter.size_max_m = 0.2;
  clutter.bounds = {{-0.8, -0.8, 0.0}, {0.8, 0.8, 1.2}};
  clutter.keep_out = {{{0.0, 0.0, 0.3}, 0.35}};
  clutter.seed = 7;
  options.clutter = clutter;
  const auto made = make_clutter(clutter);
  CHECK(made.size() == 30);
  for (const Obstacle& o : made) CHECK(closest_on(o, o.pose, {0.0, 0.0, 0.3}).distance >= 0.35);
  const std::string first = make_map(options).sha256;
  CHECK(make_map(options).sha256 == first);
  options.clutter->seed = 8;
  CHECK(make_map(options).sha256 != first);
  options.clutter->keep_out = {{{0.0, 0.0, 0.6}, 5.0}};
  CHECK_THROWS_WITH(make_map(options), Catch::Matchers::Contains("0 of 30"));
  std::filesystem::remove(options.output);
}

TEST_CASE("maps that cannot be made are refused", "[scene][unit]") {
  MakeMapOptions options;
  options.output = test::temporary("hamelin_scene_none.bt");
  CHECK_THROWS_WITH(make_map(options), Catch::Matchers::Contains("empty"));
  options.free_bounds = Box{{-300.0, -300.0, -300.0}, {300.0, 300.0, 300.0}};
  CHECK_THROWS_WITH(make_map(options), Catch::Matchers::Contains("too fine"));
  options.free_bounds = Box{{-1e6, -1.0, -1.0}, {1.0, 1.0, 1.0}};
  CHECK_THROWS_AS(make_map(options), Error);
  options.resolution_m = 0.0;
  CHECK_THROWS_WITH(make_map(options), Catch::Matchers::Contains("resolution 0"));
  CHECK_FALSE(std::filesystem::exists(options.output));
  CHECK_THROWS_AS(mark_from("center"), Error);
}

TEST_CASE("the maps in data are those their primitives make", "[scene][unit]") {
  const auto directory = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data" / "maps";
  for (const std::string name : {"shelf", "clutter"}) {
    CAPTURE(name);
    const auto source = directory / (name + ".primitives.json");
    MakeMapOptions options = make_options_from_json(read_json(source), source.string());
    CHECK(options.resolution_m <= 0.02);
    options.output = test::temporary("hamelin_scene_" + name + ".bt");
    const MakeReport report = make_map(options);
    CHECK(report.bytes < 200000);
    CHECK(report.sha256 == sha256_of_file(directory / (name + ".bt")));
    CHECK(read_map(directory / (name + ".bt")).warnings.empty());
    std::filesystem::remove(options.output);
  }
}

namespace {

const std::filesystem::path own_problem =
    std::filesystem::path(HAMELIN_SOURCE_DIR) / "libs/scene/tests/data/cabinet.problem.json";

void check_problem(const std::filesystem::path& source) {
  CAPTURE(source);
  const auto directory = test::temporary("hamelin_scene_problem");
  std::filesystem::create_directories(directory);
  ProblemOptions options;
  options.robot = test::third_party_robots / "panda.urdf";
  options.spheres = test::third_party_robots / "panda_spheres.json";
  options.tip = "panda_grasptarget";
  options.resolution_m = 0.04;
  options.output = directory / "scene.json";
  make_scene_from_problem(source, options);
  const Json problem = read_json(source);
  const Scene scene = read_scene(options.output);
  CHECK(std::filesystem::equivalent(scene.robot.file, options.robot));
  CHECK(std::filesystem::equivalent(*scene.robot.spheres, options.spheres));
  CHECK(scene.robot.tip == "panda_grasptarget");
  REQUIRE(scene.goals.size() == 1);
  CHECK(scene.goals[0].q.size() == 7);
  CHECK(scene.goals[0].q[2] == problem["goal"][2].get<double>());
  CHECK(scene.start_q[3] == problem["start"][3].get<double>());
  CHECK(scene.obstacles.size() == problem["obstacles"].size());
  REQUIRE(scene.map);
  // The map is marked by touch, so it holds every primitive: their centres are in contact.
  const model::Model model(description::read_robot(options.robot, {options.tip, options.spheres}));
  const auto environment = make_environment(scene, model, 2.0);  // some are beyond the arm's reach
  CHECK(environment.summary().warnings.empty());
  const Shares shares = shares_within_reach(*scene.map, scene.base, model.reach());
  CHECK(shares.unknown == 0.0);
  CHECK(shares.free > 0.9);
  for (const Obstacle& o : scene.obstacles) {
    CHECK(o.judge_only);
    const std::vector<Vector3d> center{o.pose.p()};
    const std::vector<double> radius{0.0};
    CHECK(environment.clearance({center, radius}, 0.0, 1.0, View::planner) <= 0.0);
  }
  std::filesystem::remove_all(directory);
}

}  // namespace

TEST_CASE("a motion-planning problem becomes a scene that reads back", "[scene][unit]") {
  check_problem(own_problem);
}

TEST_CASE("problems of MotionBenchMaker become scenes that read back", "[scene][unit]") {
  const auto problems = test::shared_data("problems");
  for (const char* name : {"bookshelf_small_0001.json", "table_pick_0001.json", "box_0001.json"})
    check_problem(problems / name);
}

TEST_CASE("a document that is not a problem is refused by key, and nothing is written",
          "[scene][unit]") {
  const auto directory = test::temporary("hamelin_scene_no_problem");
  std::filesystem::create_directories(directory);
  ProblemOptions options;
  options.robot = test::third_party_robots / "panda.urdf";
  options.tip = "panda_grasptarget";
  options.resolution_m = 0.04;
  options.output = directory / "scene.json";
  const Json good = Json::parse(
      R"({"start": [0, -0.785, 0, -2.356, 0, 1.571, 0.785], "goal": [1, 0, 0, -1, 0, 1, 0],
    "obstacles": [{"name": "a", "type": "sphere", "position": [0.5, 0, 0.5], "radius": 0.1},
                  {"type": "box", "position": [0.5, 0, 0.1], "quaternion_wxyz": [1, 0, 0, 0], "size": [1, 1, 0.1]},
                  {"type": "cylinder", "position": [0.5, 0, 0.1], "radius": 0.1, "length": 0.2}]})");
  const auto refusal = [&](const std::string& pointer, const Json& value) {
    Json document = good;
    document[Json::json_pointer(pointer)] = value;
    const auto file = directory / "problem.json";
    write_file_atomically(file, document.dump());
    try {
      make_scene_from_problem(file, options);
    } catch (const Error& e) {
      CHECK_FALSE(std::filesystem::exists(directory / "scene.json"));
      CHECK_FALSE(std::filesystem::exists(directory / "scene.bt"));
      const std::string message = e.what(), named = file.string() + ": ";
      CHECK(message.rfind(named, 0) == 0);
      return message.substr(std::min(message.size(), named.size()));
    }
    for (const char* made : {"scene.json", "scene.bt"}) std::filesystem::remove(directory / made);
    return std::string();
  };
  using Catch::Matchers::StartsWith;
  CHECK(refusal("/name", "whatever") == "");
  CHECK_THAT(refusal("/units", "mm,deg"), StartsWith("/units: are \"mm,deg\""));
  CHECK_THAT(refusal("/start", {1, 2, 3}),
             StartsWith("/start: is a list of 3, expected 7 numbers"));
  CHECK_THAT(refusal("/goal", nullptr), StartsWith("/goal: is missing"));
  CHECK_THAT(refusal("/goal/3", "x"), StartsWith("/goal: is a list of 7, expected 7 numbers"));
  CHECK_THAT(refusal("/obstacles", 3), StartsWith("/obstacles: is missing"));
  CHECK_THAT(refusal("/obstacles/1", 3), StartsWith("/obstacles/1: is 3, expected a primitive"));
  CHECK_THAT(refusal("/obstacles/0/type", "mesh"),
             StartsWith("/obstacles/0/type: is \"mesh\", expected \"sphere\""));
  CHECK_THAT(refusal("/obstacles/0/pose", {0, 0, 0, 1, 0, 0, 0}),
             StartsWith("/obstacles/0/pose: is not known"));
  CHECK_THAT(refusal("/obstacles/0/length", 1),
             StartsWith("/obstacles/0/length: is not known, a sphere has"));
  CHECK_THAT(refusal("/obstacles/0/radius", -1),
             StartsWith("/obstacles/0/radius: is -1, expected a length above 0"));
  CHECK_THAT(refusal("/obstacles/1/size", {1, 0, 1}), StartsWith("/obstacles/1/size: is 0"));
  CHECK_THAT(refusal("/obstacles/1/size", nullptr),
             StartsWith("/obstacles/1/size: is null, expected 3 numbers"));
  CHECK_THAT(refusal("/obstacles/2/position", {1, 2}),
             StartsWith("/obstacles/2/position: is a list of 2"));
  CHECK_THAT(refusal("/obstacles/1/quaternion_wxyz", {2, 0, 0, 0}),
             StartsWith("/obstacles/1/quaternion_wxyz: the norm is 2"));
  std::filesystem::remove_all(directory);
}

TEST_CASE("a problem's goal can be converted to the position or pose of the tip", "[scene][unit]") {
  const auto directory = test::temporary("hamelin_scene_goal");
  std::filesystem::create_directories(directory);
  ProblemOptions options;
  options.robot = test::third_party_robots / "panda.urdf";
  options.tip = "panda_grasptarget";
  options.resolution_m = 0.04;
  options.output = directory / "scene.json";
  const auto& source = own_problem;
  // the tip by the product of exponentials
  const auto robot = description::read_robot(options.robot, {options.tip, std::nullopt});
  const auto q = read_json(source)["goal"].get<std::vector<double>>();
  geometry::SE3 tip;
  for (std::size_t i = 0; i < q.size(); ++i)
    tip = tip * geometry::SE3::exp(geometry::Vector6d(robot.links[i].joint.screw * q[i]));
  tip = tip * robot.tip.pose;
  for (const GoalType type : {GoalType::position, GoalType::pose}) {
    options.goal = type;
    make_scene_from_problem(source, options);
    const Scene scene = read_scene(options.output);
    REQUIRE(scene.goals.size() == 1);
    CHECK(scene.goals[0].type == type);
    CHECK((scene.goals[0].pose.p() - tip.p()).norm() < 1e-12);
    if (type == GoalType::pose) CHECK((scene.goals[0].pose.R() - tip.R()).norm() < 1e-12);
    CHECK(scene.model.self_collision);
  }
  options.robot = directory / "absent.urdf";
  CHECK_THROWS_AS(make_scene_from_problem(source, options), Error);
  std::filesystem::remove_all(directory);
}
