#include <algorithm>
#include <catch2/catch.hpp>

#include "../scratch_scene.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/planning/plugin_abi.h"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/make.hpp"

using namespace hamelin;
using test::run_scene;
using test::scene_52;
using test::TemporaryFolder;

namespace {

// Free space around the arm's path with a box in it. Everything outside is unknown.
void make_map(const std::filesystem::path& file) {
  scene::Obstacle box;
  box.shape = scene::Shape::box;
  box.size_m = Eigen::Vector3d::Constant(0.3);
  box.pose = geometry::SE3(Eigen::Matrix3d::Identity(), {2.0, 0.8, 0.0});
  scene::MakeMapOptions options;
  options.resolution_m = 0.1;
  options.primitives = {box};
  options.free_bounds = scene::Box{{-1.0, -4.5, -0.6}, {4.8, 4.5, 0.6}};
  options.output = file;
  (void)scene::make_map(options);
}

std::vector<std::string> events_of(const TemporaryFolder& folder, const std::string& unknown) {
  make_map(folder.path() / "map.bt");
  Json document = scene_52();
  document["map"] = {{"file", "map.bt"}, {"unknown", unknown}, {"keep_out_radius_m", 1.0}};
  document["obstacles"] = Json::array({test::ball("ball", 3.0, -0.8, 0.2)});
  document["planner"] = {{"name", "probe"}, {"params", {{"influence_m", 0.9}}}};
  document["duration_s"] = 0.04;
  log::RunLog log(folder.path() / "run.jsonl");
  simulation::Watch watch;
  watch.log = &log;
  (void)run_scene(folder, document, watch);
  std::vector<std::string> events;
  for (const auto& line : log::read_log(log.file()).lines)
    if (line["type"] == "event") events.push_back(line["text"]);
  return events;
}

}  // namespace

TEST_CASE("a planner can distinguish contacts with the map, unknown space and obstacles",
          "[simulation][unit]") {
  STATIC_REQUIRE(HAMELIN_OBSTACLE_MAP == scene::Contact::map);
  STATIC_REQUIRE(HAMELIN_OBSTACLE_UNKNOWN == scene::Contact::unknown);
  const TemporaryFolder folder;
  const auto found = [&](const std::string& unknown, const std::string& line) {
    const auto events = events_of(folder, unknown);
    CAPTURE(unknown, events);
    return std::any_of(events.begin(), events.end(), [&](const std::string& event) {
      return event.find(line) != std::string::npos;
    });
  };
  CHECK(found("block", "contacts with the map 1, unknown space 1, obstacles 1"));
  CHECK(found("free", "contacts with the map 1, unknown space 0, obstacles 1"));
}
