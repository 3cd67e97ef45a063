#include <catch2/catch.hpp>
#include <optional>
#include <string>

#include "../scratch_scene.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/scene/make.hpp"

using namespace hamelin;
using test::plugin_directories;
using test::TemporaryFolder;

namespace {

// A wall across the path of example 5.2's tip, from (4, 0) to (2, 3).
scene::Obstacle wall() {
  scene::Obstacle wall;
  wall.name = "wall";
  wall.shape = scene::Shape::box;
  wall.size_m = {1.4, 0.2, 0.4};
  wall.pose = geometry::SE3(Eigen::Matrix3d::Identity(), {3.3, 1.6, 0.0});
  return wall;
}

// Two maps of the same grid: one knows only the wall, the other free space without it.
void make_maps(const TemporaryFolder& folder) {
  scene::MakeMapOptions options;
  options.resolution_m = 0.05;
  options.primitives = {wall()};
  options.output = folder.path() / "wall.bt";
  (void)scene::make_map(options);
  options.primitives.clear();
  options.free_bounds = scene::Box{{1.0, -1.0, -0.3}, {4.5, 3.0, 0.3}};
  options.output = folder.path() / "free.bt";
  (void)scene::make_map(options);
}

Json wall_scene(const std::string& planner) {
  const std::filesystem::path data = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";
  Json scene = read_json(data / "scenes" / ("paper_52_" + planner + ".json"));
  scene["robot"]["file"] = (data / "robots" / "planar4.json").string();
  scene["obstacles"] = Json::array();
  scene["duration_s"] = 20.0;
  return scene;
}

struct Run {
  log::Result result;
  std::optional<double> through_s;  // first time at which the arm was inside the wall's place
  bool changed = false;
};

Run run(const TemporaryFolder& folder, const Json& document) {
  const auto file = folder.path() / "scene.json";
  write_file_atomically(file, document.dump(1));
  const scene::Scene scene = scene::read_scene(file);
  const model::Model model(description::read_robot(scene.robot.file));
  const scene::Environment walls({}, {wall()}, {}, model.reach(), 0.1);
  dynamics::Workspace ws(model);
  scene::PlacedShapes arm(model);
  log::RunLog log(folder.path() / "run.jsonl");
  Run out;
  simulation::Watch watch;
  watch.log = &log;
  watch.every = 1000;
  watch.at_node = [&](double time_s, const Eigen::VectorXd& q) {
    dynamics::forward_kinematics(model, ws, q);
    arm.place(model, ws);
    if (!out.through_s && walls.clearance(arm.view(), time_s, 0.05) <= 0.0) out.through_s = time_s;
  };
  out.result = simulation::run(scene, plugin_directories, watch);
  for (const auto& line : log::read_log(log.file()).lines)
    out.changed = out.changed ||
                  (line["type"] == "event" &&
                   line["text"].get<std::string>().find("the map changes") != std::string::npos);
  return out;
}

}  // namespace

TEST_CASE(
    "a wall known only from an OctoMap stops or diverts every planner, also when it appears during "
    "the run",
    "[simulation][map]") {
  const std::string planner = GENERATE("apf", "gyro", "hybrid");
  CAPTURE(planner);
  const TemporaryFolder folder;
  make_maps(folder);
  Json scene = wall_scene(planner);

  const Run without = run(folder, scene);
  REQUIRE(without.through_s);  // otherwise the wall would not be in the way

  const auto stays_clear = [&](const Run& with) {
    CAPTURE(log::to_string(with.result.outcome), with.result.cause);
    CHECK(with.result.outcome != log::Outcome::collision);
    CHECK(with.result.outcome != log::Outcome::diverged);
    CHECK(with.result.outcome != log::Outcome::defect);
    CHECK(with.result.outcome != log::Outcome::refused);
    CHECK_FALSE(with.through_s);
    REQUIRE(with.result.min_clearance_m);
    CHECK(*with.result.min_clearance_m > 0.0);
    CHECK(with.result.time_s > *without.through_s);
  };
  scene["map"] = {{"file", "wall.bt"}};
  const Run from_start = run(folder, scene);
  stays_clear(from_start);
  CHECK_FALSE(from_start.changed);

  scene["map"] = {{"file", "free.bt"},
                  {"changes", {{{"time_s", 0.5 * *without.through_s}, {"file", "wall.bt"}}}}};
  const Run mid_run = run(folder, scene);
  stays_clear(mid_run);
  CHECK(mid_run.changed);
}

TEST_CASE("a wall that a map change removes no longer blocks the arm", "[simulation][map]") {
  const TemporaryFolder folder;
  make_maps(folder);
  Json scene = wall_scene("apf");
  scene["map"] = {{"file", "wall.bt"}};
  const Run with = run(folder, scene);
  CHECK_FALSE(with.through_s);
  CHECK(with.result.outcome != log::Outcome::reached);
  scene["map"]["changes"] = {{{"time_s", 10.0}, {"file", "free.bt"}}};
  scene["duration_s"] = 40.0;
  scene.erase("stall");
  const Run without = run(folder, scene);
  CHECK(without.changed);
  REQUIRE(without.through_s);
  CHECK(*without.through_s > 10.0);
  CHECK(without.result.outcome == log::Outcome::reached);
}
