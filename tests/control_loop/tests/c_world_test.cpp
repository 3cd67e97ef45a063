// The C interface: counts of shield and guide, maps, and what is written as JSON.
#include <algorithm>
#include <catch2/catch.hpp>
#include <string>
#include <vector>

#include "../c_loop.hpp"
#include "shield/shield.hpp"

using namespace hamelin;
using Catch::Contains;
using test::c_document;
using test::CLoop;

namespace {

/// A planner that drives through a wall, from which the shield keeps the arm.
Json blind() {
  Json document = c_document("reporting");
  document["goals"] = {{{"type", "joint"}, {"q", {1.2, -0.785, 0, -2.356, 0, 1.571, 0.785}}}};
  document["map"] = nullptr;
  document["obstacles"] = {{{"type", "box"},
                            {"name", "wall"},
                            {"size_m", {0.6, 0.02, 0.6}},
                            {"position_m", {0.4, 0.3, 0.5}}}};
  return document;
}

hamelin_shield shield_of(CLoop& loop) {
  hamelin_shield out{};
  out.struct_size = sizeof out;
  loop.require(
      hamelin_controller_shield(loop.controller, &out, loop.error.data(), loop.error.size()));
  return out;
}

void check_same(const hamelin_shield& counted, control::Controller& controller) {
  const control::Shield& shield = *controller.shield();
  const control::Shield::Counts counts = shield.counts();
  CHECK(counted.steps == counts.steps);
  CHECK(counted.refused == counts.refused);
  CHECK(counted.at_rest == counts.at_rest);
  CHECK(counted.stops == counts.stops);
  CHECK(counted.longest == counts.longest);
  CHECK(std::equal(counts.causes.begin(), counts.causes.end(), counted.causes));
  CHECK(counted.strayed == counts.strayed);
  CHECK(counted.strayed_share == counts.strayed_share);
  CHECK(counted.strayed_joint == counts.strayed_joint);
  CHECK(counted.overtaken == counts.overtaken);
  CHECK(counted.evasions == counts.evasions);
  CHECK(std::equal(counts.proofs.begin(), counts.proofs.end(), counted.proofs));
  CHECK((counted.stopping == 1) == shield.stopping());
  CHECK(counted.line ==
        (shield.stopping() ? shield.describe(controller.surroundings().environment) : ""));
}

hamelin_guide guide_of(CLoop& loop) {
  hamelin_guide out{};
  out.struct_size = sizeof out;
  loop.require(
      hamelin_controller_guide(loop.controller, &out, loop.error.data(), loop.error.size()));
  return out;
}

/// The text that a function writes, with exactly as much memory as it needs.
template <class Write>
Json written(CLoop& loop, Write&& write) {
  std::size_t needed = 0;
  char* const error = loop.error.data();
  const std::size_t size = loop.error.size();
  loop.require(write(loop.controller, nullptr, 0, &needed, error, size));
  REQUIRE(needed > 1);
  std::vector<char> text(needed, '#');
  CHECK_THAT(loop.failure(write(loop.controller, text.data(), needed - 1, nullptr, error, size)),
             Contains("json_size: ") && Contains("expected at least " + std::to_string(needed)));
  CHECK(text.front() == '#');
  loop.require(write(loop.controller, text.data(), needed, nullptr, error, size));
  CHECK(text.back() == '\0');
  CHECK_THAT(loop.failure(write(loop.controller, nullptr, needed, nullptr, error, size)),
             Contains("json: is null"));
  return parse_json(text.data(), "written");
}

std::int32_t set_map(CLoop& loop, const Json& map, const char* folder, std::uint64_t* snapshot) {
  return hamelin_controller_set_map_json(loop.controller, map.dump().c_str(), folder, nullptr,
                                         snapshot, loop.error.data(), loop.error.size());
}

std::int32_t change_map(CLoop& loop, const Json& change, std::uint64_t* snapshot) {
  return hamelin_controller_change_map(loop.controller, change.dump().c_str(), nullptr, snapshot,
                                       loop.error.data(), loop.error.size());
}

}  // namespace

TEST_CASE("in C, the counts of the shield are those of the controller in C++", "[control][c]") {
  CLoop loop(blind());
  control::Controller controller(loop.scene, {test::c_plugins[0], test::c_plugins[1]}, {});
  bool stopped = false;
  for (int k = 0; k < 1500; ++k) {
    REQUIRE(loop.tick() == 0);
    (void)controller.tick(loop.state.time_s, loop.state.q, loop.v);
    if (loop.answer.shield_stopping == 1 && !stopped) {
      const hamelin_shield now = shield_of(loop);
      CHECK(now.active == 1);
      CHECK(now.cause == HAMELIN_SHIELD_OBSTACLE);
      CHECK_THAT(now.line, Contains("obstacle 'wall'"));
      stopped = true;
    }
    if (k % 100 == 0) check_same(shield_of(loop), controller);
    loop.step();
  }
  CHECK(stopped);
  const hamelin_shield counted = shield_of(loop);
  check_same(counted, controller);
  CHECK(counted.steps >= 1499);
  CHECK(counted.refused > 0);
  CHECK(counted.causes[HAMELIN_SHIELD_OBSTACLE] > 0);
  CHECK(loop.answer.clearance_m > 0.0);
}

TEST_CASE("in C, a controller without a shield and a guide says so", "[control][c]") {
  Json document = c_document("hybrid");
  document["safety"] = {{"type", "none"}};
  CLoop loop(document);
  loop.move(3);
  const hamelin_shield shield = shield_of(loop);
  CHECK(shield.active == 0);
  CHECK(shield.steps == 0);
  CHECK(std::string(shield.line).empty());
  CHECK(guide_of(loop).active == 0);
}

TEST_CASE("in C, a guide without a thread searches when it is told to", "[control][c]") {
  Json document = c_document("hybrid", {{"escape", "none"}});
  document["planner"]["guide"] = "rrt-connect";
  CLoop loop(document, [](hamelin_controller_options& options) { options.no_guide_thread = 1; });
  loop.move(300);
  hamelin_guide guide = guide_of(loop);
  CHECK(guide.active == 1);
  CHECK(guide.searches == 0);
  CHECK(guide.waited_s == Approx(0.3));
  loop.require(hamelin_controller_run_guide(loop.controller, loop.error.data(), loop.error.size()));
  loop.move(500);
  guide = guide_of(loop);
  CHECK(guide.searches == 1);
  CHECK(guide.found == 1);
  CHECK(guide.checks > 0);
  CHECK(guide.length > 0.0);
}

TEST_CASE("in C, parameters of the planner are read back", "[control][c]") {
  CLoop loop(c_document("reporting", {{"gain", 3.0}}));
  CHECK(written(loop, hamelin_controller_planner_params) ==
        Json({{"gain", 3.0}, {"sleep_s", 0.0}}));
}

TEST_CASE("in C, the names of what is attached are read back", "[control][c]") {
  CLoop loop(c_document("hybrid"));
  CHECK(written(loop, hamelin_controller_attached) == Json::array());
  hamelin_payload can{};
  can.struct_size = sizeof can;
  can.name = "a \"can\"";
  can.mass_kg = 0.1;
  for (int i = 0; i < 3; ++i) can.inertia_kg_m2[i] = 1e-4;
  loop.require(hamelin_controller_attach(loop.controller, &can, loop.state.q.data(), nullptr,
                                         loop.error.data(), loop.error.size()));
  CHECK(written(loop, hamelin_controller_attached) == Json::array({"a \"can\""}));
}

TEST_CASE("in C, a map is set, changed and removed as that of a scene", "[control][c]") {
  CLoop loop(c_document("hybrid"));
  std::uint64_t snapshot = 0;
  const auto clearance = [&] {
    REQUIRE(loop.tick() == 0);
    CHECK(loop.answer.snapshot == snapshot);
    return loop.answer.clearance_m;
  };
  const double influence = 0.1;
  REQUIRE(clearance() == influence);  // of the arm at its start from the map
  // below the tip, in the frames of two maps
  const Eigen::Vector3d tip(loop.answer.tip_position_m),
      below = tip - 0.12 * Eigen::Vector3d::UnitZ();
  const auto box_at = [](const Eigen::Vector3d& p) {
    return Json::array(
        {{p.x() - 0.01, p.y() - 0.01, p.z() - 0.01, p.x() + 0.01, p.y() + 0.01, p.z() + 0.01}});
  };
  loop.require(change_map(loop, {{"occupied_boxes_m", box_at(below)}}, &snapshot));
  CHECK(snapshot == 1);
  CHECK(clearance() < 0.09);
  loop.require(change_map(loop, {{"free_boxes_m", box_at(below)}}, &snapshot));
  CHECK(clearance() == influence);

  const std::string maps = (test::data_folder / "maps").string();
  const Json map = {{"file", "clutter.bt"},
                    {"position_m", {below.x(), below.y(), below.z() - 5.0}}};
  const std::uint64_t before = snapshot;
  CHECK_THAT(loop.failure(set_map(loop, map, nullptr, &snapshot)),
             Contains((loop.folder.path() / "clutter.bt").string()));
  CHECK(snapshot == before);
  loop.require(set_map(loop, map, maps.c_str(), &snapshot));
  CHECK(clearance() == influence);
  loop.require(change_map(loop, {{"occupied_boxes_m", box_at({0.0, 0.0, 5.0})}}, &snapshot));
  CHECK(clearance() < 0.09);
  loop.require(set_map(loop, nullptr, nullptr, &snapshot));
  CHECK(clearance() == influence);
  CHECK_THAT(loop.failure(change_map(loop, {{"free_boxes_m", box_at(below)}}, &snapshot)),
             Contains("map: there is none, expected a map to change"));
}

TEST_CASE("in C, a self-filter takes the arm out of a map where it is", "[control][c]") {
  CLoop loop(c_document("hybrid"));
  loop.move(1);
  const Eigen::Vector3d at(loop.answer.tip_position_m);
  std::uint64_t snapshot = 0;
  loop.require(
      change_map(loop,
                 {{"occupied_boxes_m",
                   Json::array({Json::array({at.x() - 0.05, at.y() - 0.05, at.z() - 0.05,
                                             at.x() + 0.05, at.y() + 0.05, at.z() + 0.05})})}},
                 &snapshot));
  REQUIRE(loop.tick() == 0);
  CHECK(loop.answer.clearance_m < 0.0);

  Json map = c_document("hybrid")["map"];
  map["self_filter"] = true;
  loop.require(hamelin_controller_set_map_json(loop.controller, map.dump().c_str(), nullptr,
                                               loop.state.q.data(), &snapshot, loop.error.data(),
                                               loop.error.size()));
  REQUIRE(loop.tick() == 0);
  CHECK(loop.answer.clearance_m > 0.0);
}

TEST_CASE("in C, maps that are not valid are refused with their place", "[control][c]") {
  CLoop loop(c_document("hybrid"));
  std::uint64_t snapshot = 77;
  CHECK_THAT(loop.failure(set_map(loop, Json::array(), nullptr, &snapshot)),
             Contains("map: /map: "));
  CHECK_THAT(loop.failure(set_map(loop, {{"file", 3}}, nullptr, &snapshot)),
             Contains("map: /map/file: "));
  CHECK_THAT(loop.failure(change_map(loop, Json::array(), &snapshot)),
             Contains("change: /map/changes/0: has the type array, expected an object"));
  CHECK_THAT(loop.failure(change_map(loop, {{"free_boxes_m", {{1, 2}}}}, &snapshot)),
             Contains("change: /map/changes/0/free_boxes_m/0"));
  CHECK(snapshot == 77);
  loop.move(1);
  CHECK(loop.answer.snapshot == 0);
}

TEST_CASE("points from C become part of the map, and what makes no sense is refused",
          "[control_loop][points]") {
  Json document = c_document("reporting");
  document["map"] = {{"resolution_m", 0.02}};
  CLoop loop(document);
  (void)loop.tick();
  const float points[] = {0.613F, 0.51F, 0.61F, 0.613F, 0.53F, 0.61F};
  hamelin_point_frame frame{};
  frame.struct_size = sizeof frame;
  frame.points_m = points;
  frame.points = 2;
  frame.quaternion_wxyz[0] = 1.0;
  hamelin_frame_report report{};
  report.struct_size = sizeof report;
  const auto insert = [&] {
    return hamelin_controller_insert_points(loop.controller, &frame, &report, loop.error.data(),
                                            loop.error.size());
  };
  // seen from where the arm's base is, which is not occupied
  loop.require(insert());
  CHECK(report.snapshot == 1);
  CHECK(report.points + report.on_arm == 2);
  CHECK(report.points == report.occupied);
  CHECK(report.on_obstacles == 0);
  frame.mount = 4;
  CHECK_THAT(loop.failure(insert()), Contains("the sensor's mount is unknown"));
  frame.mount = HAMELIN_MOUNT_FRAME;
  CHECK_THAT(loop.failure(insert()), Contains("frame: frame: is null"));
  frame.frame = "none";
  CHECK_THAT(loop.failure(insert()), Contains("the sensor's mount: 'arm7' has no frame 'none'"));
  frame.struct_size = offsetof(hamelin_point_frame, frame);  // of an older header
  CHECK_THAT(loop.failure(insert()), Contains("frame: frame: is null"));
  frame.struct_size = sizeof frame;
  frame.mount = HAMELIN_MOUNT_TIP;
  loop.require(insert());
  frame.points = 3'000'000;
  CHECK_THAT(loop.failure(insert()), Contains("points: 3000000 given, expected 1 to 2000000"));
  frame.points = 2;
  frame.points_m = nullptr;
  CHECK_THAT(loop.failure(insert()), Contains("frame: points_m: is null"));
  frame.points_m = points;
  frame.time_s = 5.0;
  CHECK_THAT(loop.failure(insert()), Contains("points: seen at 5 s"));
  frame.time_s = 0.0;
  report.struct_size = 4;
  CHECK_THAT(loop.failure(insert()), Contains("report: is null or its struct_size is too small"));
}
