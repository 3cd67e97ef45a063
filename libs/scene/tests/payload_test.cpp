#include "hamelin/scene/payload.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <limits>
#include <random>

#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/test/errors.hpp"

using namespace hamelin;
using Catch::Contains;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

const std::filesystem::path data = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";

model::Robot arm7() {
  return description::read_robot(data / "robots" / "arm7.urdf",
                                 {"flange", data / "robots" / "arm7.spheres.json", {}});
}

// A body with off-diagonal inertia and its centre of mass beside the tip.
scene::Payload lump() {
  scene::Payload lump;
  lump.name = "lump";
  lump.mass_kg = 2.3;
  lump.position_m = {0.04, -0.07, 0.11};
  lump.inertia_kg_m2 << 0.02, 0.003, -0.001, 0.003, 0.015, 0.002, -0.001, 0.002, 0.012;
  lump.spheres = {{{0.0, 0.1, 0.2}, 0.03}};
  lump.capsules = {{{-0.1, 0.0, 0.1}, {0.1, 0.05, 0.1}, 0.02}};
  return lump;
}

}  // namespace

TEST_CASE(
    "a loaded arm has the energies of the arm plus those of the body as it moves with the tip",
    "[scene][payload]") {
  const model::Robot robot = arm7();
  const scene::Payload body = lump();
  const model::Model bare(robot), loaded(scene::with_payloads(robot, {&body, 1}));
  dynamics::Workspace ws(bare), ws_loaded(loaded);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1.5, 1.5);
  dynamics::Matrix6Xd J(6, 7);
  for (int i = 0; i < 50; ++i) {
    const VectorXd q = VectorXd::NullaryExpr(7, [&] { return uniform(random); }),
                   v = VectorXd::NullaryExpr(7, [&] { return uniform(random); });
    dynamics::forward_kinematics(bare, ws, q);
    const geometry::SE3 tip = dynamics::tip_pose(bare, ws);
    const Vector3d at = tip * body.position_m;
    dynamics::frame_jacobian(bare, ws, robot.tip.link, at, J);
    const Eigen::Matrix<double, 6, 1> twist = J * v;
    const Vector3d omega = twist.head<3>(), speed = twist.tail<3>();
    const Matrix3d inertia = tip.R() * body.inertia_kg_m2 * tip.R().transpose();
    const double kinetic =
        0.5 * body.mass_kg * speed.squaredNorm() + 0.5 * omega.dot(inertia * omega);
    const double potential = body.mass_kg * 9.81 * at.z();
    CHECK(dynamics::kinetic_energy(loaded, ws_loaded, q, v) ==
          Approx(dynamics::kinetic_energy(bare, ws, q, v) + kinetic).epsilon(1e-12));
    CHECK(dynamics::potential_energy(loaded, ws_loaded, q) -
              dynamics::potential_energy(bare, ws, q) ==
          Approx(potential).epsilon(1e-10));
  }
}

TEST_CASE("a payload's shapes move with the tip, and the arm's own shapes stay where they were",
          "[scene][payload]") {
  const model::Robot robot = arm7();
  const scene::Payload body = lump();
  const model::Model bare(robot), loaded(scene::with_payloads(robot, {&body, 1}));
  const VectorXd q = VectorXd::LinSpaced(7, -0.8, 0.9);
  dynamics::Workspace ws(bare), ws_loaded(loaded);
  dynamics::forward_kinematics(bare, ws, q);
  dynamics::forward_kinematics(loaded, ws_loaded, q);
  const geometry::SE3 tip = dynamics::tip_pose(bare, ws);
  CHECK((dynamics::tip_pose(loaded, ws_loaded).p() - tip.p()).norm() < 1e-14);
  std::vector<Vector3d> before(bare.shapes().size()), after(loaded.shapes().size());
  dynamics::shape_centers(bare, ws, before);
  dynamics::shape_centers(loaded, ws_loaded, after);
  REQUIRE(after.size() == before.size() + 2);
  for (std::size_t i = 0; i < before.size(); ++i) CHECK((after[i] - before[i]).norm() < 1e-14);
  const std::size_t sphere = before.size(), capsule = sphere + 1;
  CHECK((after[sphere] - tip * body.spheres[0].center_m).norm() < 1e-14);
  CHECK((after[capsule] - tip * Vector3d(0.0, 0.025, 0.1)).norm() < 1e-14);
  CHECK(loaded.shapes()[capsule].radius == 0.02);
  CHECK(loaded.describe(loaded.shapes()[capsule]) == "capsule 0 of part 'lump'");
}

TEST_CASE("payloads that are no bodies are refused with one line", "[scene][payload]") {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refusal = [](const auto& change) {
    scene::Payload body = lump();
    change(body);
    return test::error_of([&] { scene::check(body, "payload"); });
  };
  CHECK(refusal([](auto&) {}) == "no error");
  CHECK(refusal([](auto& b) { b.name.clear(); }) ==
        "payload: has no name, expected one to refer to it");
  CHECK(refusal([](auto& b) { b.mass_kg = -1.0; }) ==
        "payload: its mass is -1 kg, expected zero or more");
  CHECK_THAT(refusal([&](auto& b) { b.position_m.y() = nan; }), Contains("is not finite"));
  CHECK_THAT(refusal([](auto& b) { b.inertia_kg_m2(0, 0) = -1.0; }), Contains("semi-definite"));
  CHECK_THAT(refusal([](auto& b) { b.spheres[0].radius_m = 0.0; }), Contains("sphere 0"));
  CHECK_THAT(refusal([&](auto& b) { b.capsules[0].to_m.x() = nan; }), Contains("capsule 0"));
  scene::Payload body = lump();
  body.name = "link3";
  CHECK_THAT(test::error_of([&] {
               (void)scene::with_payloads(arm7(), {&body, 1});
             }),
             Contains("'arm7' has a link or part of this name"));
}

TEST_CASE("the bounds of events count what is carried at a time", "[scene][payload]") {
  const model::Model arm(arm7());
  scene::Event first, second, off;
  first.attach = second.attach = lump();
  second.attach->name = "other";
  second.attach->spheres.push_back({{0.0, 0.0, 1.0}, 0.1});
  off.detach = "lump";
  const std::vector<scene::Event> both{first, second}, one_by_one{first, off, second};
  const scene::PayloadBounds together = scene::payload_bounds(both, arm, "events"),
                             apart = scene::payload_bounds(one_by_one, arm, "events");
  CHECK(together.shapes == 5);
  CHECK(apart.shapes == 3);
  CHECK(apart.reach_m == Approx(1.1));
  CHECK(scene::payload_bounds({}, arm, "events").reach_m == 0.0);
  const std::vector<scene::Event> twice{first, first};
  CHECK_THAT(test::error_of([&] { (void)scene::payload_bounds(twice, arm, "events"); }),
             Contains("events/1/attach: payload 'lump'"));
}

TEST_CASE("events are written as they are read", "[scene][payload]") {
  const scene::Scene scene = scene::read_scene(data / "scenes" / "shelf_carry.json");
  REQUIRE(scene.events.size() == 4);
  const Json resolved = scene::resolved_json(scene);
  const scene::Scene again = scene::scene_from_json(resolved, data / "scenes", scene.name);
  CHECK(scene::resolved_json(again) == resolved);
  CHECK(again.events[0].attach->capsules.size() == scene.events[0].attach->capsules.size());
}

TEST_CASE("events that cannot happen are refused with place and expectation", "[scene][payload]") {
  const auto refusal = [](const std::string& assignment) {
    Json document = read_json(data / "scenes" / "shelf_carry.json");
    scene::set_pointer(document, assignment);
    return test::error_of(
        [&] { (void)scene::scene_from_json(document, data / "scenes", "scene"); });
  };
  CHECK(refusal("/seed=1") == "no error");
  CHECK_THAT(refusal("/events/0/time_s=3"),
             Contains("/events/0/time_s: is given in addition to goals_reached"));
  CHECK_THAT(refusal("/events/0/goals_reached=null"),
             Contains("/events/0/time_s: is missing, expected time_s or goals_reached"));
  CHECK_THAT(refusal("/events/2/goals_reached=6"),
             Contains("/events/2/goals_reached: is 6, expected less than the number of goals, 6"));
  CHECK_THAT(refusal("/events/3/detach=cup"), Contains("/events/3/detach: 'cup' is not attached"));
  CHECK_THAT(refusal("/events/3/attach={\"name\":\"can\",\"mass_kg\":1}"),
             Contains("/events/3/detach: is given in addition to attach"));
  CHECK_THAT(refusal("/model/payload={\"name\":\"can\",\"mass_kg\":1}"),
             Contains("/events/0/attach/name: 'can' is attached already"));
  CHECK_THAT(refusal("/events/3={\"time_s\":9,\"detach\":\"can\"}"), Contains("no error"));
  Json fixed = read_json(data / "scenes" / "shelf_carry.json");
  fixed["model"]["payload"] = {{"name", "tool"}, {"mass_kg", 1}};
  fixed["events"][3]["detach"] = "tool";
  CHECK_THAT(test::error_of([&] { (void)scene::scene_from_json(fixed, data / "scenes", "scene"); }),
             Contains("/events/3/detach: 'tool' is the payload of /model"));
  CHECK_THAT(refusal("/events/1/map=null"),
             Contains("/events/1/attach: is missing, expected attach, detach or map"));
  CHECK_THAT(refusal("/events/3/obstacle=can"),
             Contains("/events/3/obstacle: is given without attach"));
  CHECK_THAT(refusal("/events/0/obstacle=cann"), Contains("there is no obstacle 'cann'"));
  const auto carried = [](const Json& changes) {
    Json document = read_json(data / "scenes" / "shelf_carry.json");
    Json obstacle{
        {"name", "can"}, {"type", "sphere"}, {"radius_m", 0.1}, {"position_m", {5, 0, 0}}};
    obstacle.update(changes);
    const Json lid{
        {"name", "lid"}, {"type", "sphere"}, {"radius_m", 0.1}, {"position_m", {6, 0, 0}}};
    document["obstacles"] = Json::array({obstacle, lid});
    if (changes.contains("lid")) {
      document["obstacles"][0].erase("lid");
      document["obstacles"][1]["attached_to"] = "can";
    }
    document["events"][0]["obstacle"] = "can";
    return test::error_of(
        [&] { (void)scene::scene_from_json(document, data / "scenes", "scene"); });
  };
  CHECK(carried(Json::object()) == "no error");
  CHECK_THAT(carried({{"known", false}}), Contains("/events/0/obstacle: 'can' moves, is a frame"));
  CHECK_THAT(carried({{"motion", {{"type", "linear"}, {"velocity_m_s", {1, 0, 0}}}}}),
             Contains("/events/0/obstacle: 'can' moves"));
  CHECK_THAT(carried({{"lid", true}}), Contains("obstacle 'lid' is attached to 'can'"));
  CHECK_THAT(refusal("/map=null"), Contains("/events/0/map: there is no map"));
}
