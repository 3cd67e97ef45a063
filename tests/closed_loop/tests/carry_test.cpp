// The scene shelf_carry: a can is taken from one compartment of a shelf and put into another.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "../scratch_scene.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/scene/obstacles.hpp"

using namespace hamelin;
using Catch::Contains;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::plugin_directories;

namespace {

const std::filesystem::path data = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";

Json carry_document() {
  Json document = read_json(data / "scenes" / "shelf_carry.json");
  document["robot"]["file"] = (data / "robots" / "arm7.urdf").string();
  document["robot"]["spheres"] = (data / "robots" / "arm7.spheres.json").string();
  document["map"]["file"] = (data / "maps" / "shelf.bt").string();
  return document;
}

scene::Scene carry_scene(const std::vector<std::string>& assignments = {}) {
  Json document = carry_document();
  for (const auto& assignment : assignments) scene::set_pointer(document, assignment);
  return scene::scene_from_json(document, data / "scenes", "shelf_carry.json");
}

// The solids of the shelf, without the can, from which the map was made.
std::vector<scene::Obstacle> shelf() {
  const Json primitives = read_json(data / "maps" / "shelf.primitives.json");
  std::vector<scene::Obstacle> out;
  for (const Json& one : primitives["obstacles"])
    if (one["name"] != "can") out.push_back(scene::obstacle_from_json(one, "shelf"));
  return out;
}

// Points on the surface of the can in the tip's frame: its axis is the tip's x, its centre 0.04 m
// along x and 0.08 m along z.
std::vector<Vector3d> surface_of_can() {
  constexpr double radius = 0.033, half_length = 0.06;
  std::vector<Vector3d> out;
  for (int i = 0; i < 48; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / 48.0;
    const auto at = [&](double r, double along) {
      return Vector3d(0.04 + along, r * std::sin(angle), 0.08 + r * std::cos(angle));
    };
    for (int k = -6; k <= 6; ++k) out.push_back(at(radius, half_length * k / 6.0));
    for (const double end : {-half_length, half_length})
      for (const double share : {0.3, 0.7}) out.push_back(at(share * radius, end));
  }
  return out;
}

}  // namespace

TEST_CASE("the spheres and capsules of the demonstration's can contain it", "[simulation][load]") {
  const scene::Scene scene = carry_scene();
  const scene::Payload& can = *scene.events[0].attach;
  double outside = -1.0;
  for (const Vector3d& p : surface_of_can()) {
    double nearest = 1.0;
    for (const auto& capsule : can.capsules) {
      const Vector3d axis = capsule.to_m - capsule.from_m;
      const double share =
          std::clamp((p - capsule.from_m).dot(axis) / axis.squaredNorm(), 0.0, 1.0);
      nearest = std::min(nearest, (p - capsule.from_m - share * axis).norm() - capsule.radius_m);
    }
    outside = std::max(outside, nearest);
  }
  CHECK(outside <= 0.0);
}

TEST_CASE("a can is carried from one compartment to another without touching but at its places",
          "[simulation][load]") {
  const bool ideal = GENERATE(true, false);
  const scene::Scene scene =
      ideal ? carry_scene() : carry_scene({"/actuation={\"type\":\"sampled\"}"});
  const test::TemporaryFolder folder;
  log::RunLog log(folder.path() / "run.jsonl");
  struct Node {
    double time_s;
    VectorXd q;
  };
  std::vector<Node> nodes;
  simulation::Watch watch;
  watch.log = &log;
  watch.at_node = [&](double time_s, const VectorXd& q) { nodes.push_back({time_s, q}); };
  const log::Result result = simulation::run(scene, plugin_directories, watch);
  CAPTURE(result.cause);
  CHECK(result.outcome == log::Outcome::reached);
  CHECK(*result.min_clearance_m > 0.003);
  CHECK(*result.certified_share == 1.0);
  CHECK(result.energy_error_max_J < 1e-4);

  double attached_s = -1.0, detached_s = -1.0, lifted_s = -1.0;
  for (const auto& line : log::read_log(log.file()).lines) {
    if (line["type"] != "event") continue;
    const auto text = line["text"].get<std::string>();
    if (text == "'can' is attached") attached_s = line["time_s"];
    if (text == "'can' is detached") detached_s = line["time_s"];
    if (text == "goal 2 of 6 reached") lifted_s = line["time_s"];
  }
  REQUIRE(attached_s > 0.0);
  REQUIRE(lifted_s > attached_s);
  REQUIRE(detached_s > lifted_s);

  // against the solids themselves, not the map, and the cylinder, not the capsules around it
  const std::vector<scene::Obstacle> solids = shelf();
  const std::vector<Vector3d> surface = surface_of_can();
  const model::Model arm = control::load_model(scene);
  dynamics::Workspace ws(arm);
  Vector3d at_start, at_end;
  double least = 1.0, deepest = 1.0;
  for (std::size_t k = 0; k < nodes.size(); k += 10) {
    const double time_s = nodes[k].time_s;
    if (time_s < attached_s || time_s > detached_s) continue;
    dynamics::forward_kinematics(arm, ws, nodes[k].q);
    const geometry::SE3 tip = dynamics::tip_pose(arm, ws);
    at_end = tip * Vector3d(0.04, 0.0, 0.08);
    if (least == 1.0 && deepest == 1.0) at_start = at_end;
    const bool at_a_place =
        time_s < lifted_s || (at_end - Vector3d(0.72, -0.25, 0.34)).head<2>().norm() < 0.02;
    for (const Vector3d& p : surface)
      for (const auto& solid : solids) {
        const double distance = scene::closest_on(solid, solid.pose, tip * p).distance;
        (at_a_place ? deepest : least) = std::min(at_a_place ? deepest : least, distance);
      }
  }
  CHECK(least > 0.003);
  CHECK(deepest > -0.005);  // a place is reached to within 3 mm
  CHECK((at_start - Vector3d(0.72, 0.4, 0.34)).norm() < 0.005);
  CHECK((at_end - Vector3d(0.72, -0.25, 0.34)).norm() < 0.005);
}

TEST_CASE("without the can's shapes the same run hits the shelf with it", "[simulation][load]") {
  const log::Result result =
      simulation::run(carry_scene({"/events/0/attach/shapes_known=false"}), plugin_directories, {});
  CHECK(result.outcome == log::Outcome::collision);
  CHECK_THAT(result.cause, Contains("of part 'can' is"));
}

TEST_CASE("a load that overlaps the map, or is too heavy, is refused while the arm stays safe",
          "[simulation][load]") {
  const auto outcome = [](const std::vector<std::string>& assignments) {
    return simulation::run(carry_scene(assignments), plugin_directories, {});
  };
  const log::Result overlap = outcome({"/events/0/map=null"});
  CHECK(overlap.outcome == log::Outcome::refused);
  CHECK_THAT(overlap.cause, Contains("'can' cannot be attached: capsule") &&
                                Contains("of part 'can' would come too near the map"));
  CHECK(*overlap.min_clearance_m > 0.0);
  CHECK(overlap.v.lpNorm<Eigen::Infinity>() < 0.01);
  const log::Result heavy = outcome({"/events/0/attach/mass_kg=20"});
  CHECK(heavy.outcome == log::Outcome::refused);
  CHECK_THAT(heavy.cause, Contains("no stop within the torque limits would remain"));
  const log::Result without = outcome({"/events/0/map=null", "/events/0/required=false"});
  CHECK(without.outcome == log::Outcome::reached);
  CHECK_THAT(without.warnings.back(), Contains("'can' cannot be attached"));
}

TEST_CASE("a payload from the start is avoided like the arm that carries it",
          "[simulation][load]") {
  // the first goal puts the tip between board and divider; a bar across the tip does not fit
  Json document = carry_document();
  document["events"] = Json::array();
  document["duration_s"] = 6.0;
  document["model"]["payload"] = {
      {"mass_kg", 0.2},
      {"capsules",
       {{{"from_m", {0.0, -0.3, 0.05}}, {"to_m", {0.0, 0.3, 0.05}}, {"radius_m", 0.02}}}}};
  const log::Result with = simulation::run(scene::scene_from_json(document, data / "scenes", "bar"),
                                           plugin_directories, {});
  CHECK(with.outcome != log::Outcome::collision);
  CHECK(with.goal->index == 0);
  CHECK(*with.min_clearance_m > 0.0);
}
