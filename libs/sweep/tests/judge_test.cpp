#include "hamelin/sweep/judge.hpp"

#ifdef HAMELIN_WITH_FCL
#include <fcl/geometry/octree/octree.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/distance.h>
#include <octomap/OcTree.h>
#endif

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <limits>
#include <string>
#include <vector>

#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/geometry/so3.hpp"
#include "hamelin/scene/make.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/test/robots.hpp"
#include "hamelin/test/scene_data.hpp"

using namespace hamelin;
using namespace hamelin::sweep;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

namespace fs = std::filesystem;

const fs::path source_dir = HAMELIN_SOURCE_DIR;

scene::Scene scene_of(const Json& more) {
  Json document{{"schema", "hamelin.scene/1"},
                {"robot",
                 {{"file", "data/robots/arm7.urdf"},
                  {"tip", "flange"},
                  {"spheres", "data/robots/arm7.spheres.json"}}}};
  document.update(more);
  return scene::scene_from_json(document, source_dir, "scene");
}

/// Centres of the moving spheres, computed by the library that planners and runs use.
std::vector<Vector3d> centers_of(const model::Model& model, const VectorXd& q) {
  dynamics::Workspace ws(model);
  std::vector<Vector3d> centers(model.shapes().size());
  dynamics::forward_kinematics(model, ws, q);
  dynamics::shape_centers(model, ws, centers);
  return centers;
}

}  // namespace

TEST_CASE("the judge places spheres where the dynamics place them, also on a rotated base",
          "[sweep][unit]") {
  const auto scene = scene_of(
      {{"base", {{"position_m", {0.3, -0.2, 0.5}}, {"quaternion_wxyz", {0.8, 0.0, 0.6, 0.0}}}}});
  const model::Model model = control::load_model(scene);
  const JudgedArm arm(scene);
  REQUIRE(arm.balls().size() == model.shapes().size());
  Rng rng(3);
  std::vector<Vector3d> centers;
  for (int i = 0; i < 50; ++i) {
    const VectorXd q = test::random_within_limits(model, rng);
    const auto expected = centers_of(model, q);
    arm.place(q, centers);
    for (std::size_t k = 0; k < centers.size(); ++k)
      CHECK((centers[k] - expected[k]).norm() < 1e-12);
  }
}

#ifdef HAMELIN_WITH_FCL
namespace {

using Geometry = std::shared_ptr<fcl::CollisionGeometryd>;

/// Poses around the origin, turning by up to 1.4 rad from one to the next.
Json random_waypoints(Rng& rng) {
  Json list = Json::array();
  for (int i = 0; i <= 4; ++i) {
    const Vector3d p(rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3)),
        turn(rng.uniform(-0.8, 0.8), rng.uniform(-0.8, 0.8), rng.uniform(-0.8, 0.8));
    const Eigen::Vector4d q = geometry::quaternion_wxyz(geometry::SO3::exp(turn).R());
    list.push_back({{"time_s", 0.75 * i},
                    {"position_m", {p.x(), p.y(), p.z()}},
                    {"quaternion_wxyz", {q[0], q[1], q[2], q[3]}}});
  }
  return {{"type", "waypoints"}, {"waypoints", list}};
}

/// Primitives of all shapes around the arm, rotated at random. Some oscillate, some turn along
/// way-points, and some are attached to a frame that turns.
Json random_obstacles(std::size_t count, std::uint64_t seed) {
  scene::Clutter clutter;
  clutter.count = count;
  clutter.size_min_m = 0.05;
  clutter.size_max_m = 0.3;
  clutter.bounds = {{-0.9, -0.9, -0.1}, {0.9, 0.9, 1.2}};
  clutter.seed = seed;
  Rng rng(seed);
  Json all = Json::array();
  for (auto obstacle : scene::make_clutter(clutter)) {
    obstacle.judge_only = true;
    if (obstacle.shape == scene::Shape::cylinder && rng.below(2) == 0)
      obstacle.shape = scene::Shape::capsule;
    if (all.size() % 4 == 0) obstacle.motion = scene::SineMotion{{0.2, -0.1, 0.05}, 2.0};
    if (all.size() % 4 == 1) obstacle.attached_to = "carrier";
    Json json = scene::to_json(obstacle);
    if (all.size() % 4 == 2) json["motion"] = random_waypoints(rng);
    for (auto it = json.begin(); it != json.end();)
      it = it->is_null() ? json.erase(it) : std::next(it);
    all.push_back(json);
  }
  all.push_back({{"name", "platform"},
                 {"type", "frame"},
                 {"motion", {{"type", "linear"}, {"velocity_m_s", {0.05, -0.02, 0.03}}}}});
  all.push_back({{"name", "carrier"},
                 {"type", "frame"},
                 {"attached_to", "platform"},
                 {"motion", random_waypoints(rng)}});
  return all;
}

std::optional<Closest> judged(const scene::Scene& scene, double time_s, const VectorXd& q) {
  Judge judge(scene);
  judge.add_node(time_s, q);
  return judge.verdict().obstacles;
}

fcl::Transform3d at(const Vector3d& p, const Eigen::Matrix3d& R = Eigen::Matrix3d::Identity()) {
  fcl::Transform3d pose = fcl::Transform3d::Identity();
  pose.translation() = p;
  pose.linear() = R;
  return pose;
}

Geometry shape_of(const scene::Obstacle& o) {
  if (o.shape == scene::Shape::sphere) return std::make_shared<fcl::Sphered>(o.radius_m);
  if (o.shape == scene::Shape::box) return std::make_shared<fcl::Boxd>(o.size_m);
  if (o.shape == scene::Shape::capsule)
    return std::make_shared<fcl::Capsuled>(o.radius_m, o.length_m);
  return std::make_shared<fcl::Cylinderd>(o.radius_m, o.length_m);
}

/// FCL's smallest distance of the spheres from a body; −1 if they are in contact.
double fcl_distance(const std::vector<Vector3d>& centers, const model::Model& model,
                    const fcl::CollisionGeometryd& body, const fcl::Transform3d& pose) {
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < centers.size(); ++k) {
    const fcl::Sphered sphere(model.shapes()[k].radius);
    fcl::CollisionResultd hit;
    fcl::collide(&body, pose, &sphere, at(centers[k]), fcl::CollisionRequestd(), hit);
    if (hit.isCollision()) return -1.0;
    fcl::DistanceRequestd request;
    request.gjk_solver_type = fcl::GST_LIBCCD;
    request.distance_tolerance = 1e-9;
    fcl::DistanceResultd result;
    fcl::distance(&body, pose, &sphere, at(centers[k]), request, result);
    nearest = std::min(nearest, result.min_distance);
  }
  return nearest;
}

}  // namespace

TEST_CASE(
    "the judge agrees with FCL on contact and distance of random primitives, also of moving ones",
    "[sweep][unit]") {
  Rng rng(17);
  int contacts = 0, clear = 0, capsules = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const auto scene = scene_of({{"obstacles", random_obstacles(8, seed)}});
    const model::Model model = control::load_model(scene);
    for (int i = 0; i < 12; ++i) {
      const VectorXd q = test::random_within_limits(model, rng);
      const double time_s = rng.uniform(0.0, 3.0);
      const auto centers = centers_of(model, q);
      double nearest = std::numeric_limits<double>::infinity();
      for (const auto& o : scene.obstacles) {
        if (o.shape == scene::Shape::frame) continue;
        capsules += o.shape == scene::Shape::capsule ? 1 : 0;
        const Geometry shape = shape_of(o);
        const geometry::SE3 pose = scene::motion_at(o, time_s).pose;
        nearest = std::min(nearest, fcl_distance(centers, model, *shape, at(pose.p(), pose.R())));
      }
      const auto found = judged(scene, time_s, q);
      REQUIRE(found.has_value());
      CAPTURE(seed, i, found->clearance_m, nearest);
      // FCL's GJK has an error of this size, and FCL reports no depth
      if (std::abs(found->clearance_m) < 1e-6) continue;
      CHECK((found->clearance_m <= 0.0) == (nearest < 0.0));
      if (nearest < 0.0) {
        ++contacts;
      } else {
        ++clear;
        CHECK(found->clearance_m == Approx(nearest).margin(1e-6));
      }
    }
  }
  CHECK(contacts > 10);
  CHECK(clear > 10);
  CHECK(capsules > 50);
}

TEST_CASE("the judge agrees with FCL on contact with and distance from a map", "[sweep][unit]") {
  const auto scene = scene_of({{"map", {{"file", "data/maps/clutter.bt"}}}});
  const model::Model model = control::load_model(scene);
  const auto tree =
      std::make_shared<octomap::OcTree>((source_dir / "data/maps/clutter.bt").string());
  const fcl::OcTreed octree(tree);
  Rng rng(5);
  int contacts = 0, clear = 0;
  for (int i = 0; i < 40 && clear < 4; ++i) {
    const VectorXd q = test::random_within_limits(model, rng);
    const auto found = judged(scene, 0.0, q);
    REQUIRE(found.has_value());
    CHECK(found->other == "map");
    const double nearest =
        fcl_distance(centers_of(model, q), model, octree, fcl::Transform3d::Identity());
    CHECK((found->clearance_m <= 0.0) == (nearest < 0.0));
    if (nearest >= 0.0) CHECK(found->clearance_m == Approx(nearest).margin(1e-5));
    ++(nearest < 0.0 ? contacts : clear);
  }
  CHECK(contacts > 0);
  CHECK(clear > 0);
}
#endif

TEST_CASE("the judge's stored leaves do not change its distances along a motion", "[sweep][unit]") {
  const auto scene = scene_of({{"map", {{"file", "data/maps/clutter.bt"}}}});
  const model::Model model = control::load_model(scene);
  const JudgedMap map(*scene.map);
  Rng rng(11);
  for (int motion = 0; motion < 3; ++motion) {
    Judge judge(scene);
    const VectorXd from = test::random_within_limits(model, rng),
                   to = from + 0.15 * (test::random_within_limits(model, rng) - from);
    double nearest = std::numeric_limits<double>::infinity();
    for (int i = 0; i <= 100; ++i) {
      const VectorXd q = from + 0.01 * i * (to - from);
      judge.add_node(0.001 * i, q);
      const auto centers = centers_of(model, q);
      for (std::size_t k = 0; k < centers.size(); ++k)
        nearest = std::min(nearest, map.distance(centers[k]) - model.shapes()[k].radius);
    }
    REQUIRE(judge.verdict().configurations == 101);
    CHECK(judge.verdict().obstacles->clearance_m == Approx(nearest).margin(1e-12));
  }
}

TEST_CASE(
    "between two nodes the judge checks every hundredth of a radian, with obstacles at their "
    "position at that time",
    "[sweep][unit]") {
  const JudgedArm arm(scene_of(Json::object()));
  std::vector<Vector3d> centers;
  VectorXd q = VectorXd::Zero(7);
  q[1] = 1.2;
  const auto tip = [&](double angle) {
    VectorXd rotated = q;
    rotated[0] = angle;
    arm.place(rotated, centers);
    return centers.back();
  };
  // a small ball on the path of the last sphere, halfway between two nodes that are 0.8 rad apart
  const Vector3d middle = tip(0.4);
  Json ball{{"name", "pin"},
            {"type", "sphere"},
            {"radius_m", 0.004},
            {"position_m", {middle.x(), middle.y(), middle.z()}}};
  const auto verdict = [&](const Json& obstacle) {
    Judge judge(scene_of({{"obstacles", {obstacle}}}));
    judge.add_node(0.0, q);
    CHECK_FALSE(judge.verdict().contact());
    VectorXd end = q;
    end[0] = 0.8;
    judge.add_node(2.0, end);
    CHECK(judge.verdict().configurations == 81);
    return judge.verdict();
  };
  const Verdict hit = verdict(ball);
  CHECK(hit.contact());
  CHECK(hit.obstacles->other == "pin");
  CHECK(hit.obstacles->ball == arm.balls().back().name);
  CHECK(hit.obstacles->time_s == Approx(1.0).margin(0.1));
  Json late = ball;
  late["appears_s"] = 1.9;
  CHECK_FALSE(verdict(late).contact());
  // this ball is on the path at first and has moved away when the arm arrives
  Json moving = ball;
  moving["motion"] = {{"type", "sine"}, {"amplitude_m", {0.0, 0.0, 2.0}}, {"period_s", 4.0}};
  CHECK_FALSE(verdict(moving).contact());
}

TEST_CASE("the judge's self-collision pairs and their distances equal those of libs/scene",
          "[sweep][unit]") {
  std::vector<scene::Scene> scenes{scene_of({{"model", {{"self_collision", true}}}})};
  scenes.push_back(scene::scene_from_json(
      {{"schema", "hamelin.scene/1"},
       {"robot",
        {{"file", (test::third_party_robots / "panda.urdf").string()},
         {"tip", "panda_grasptarget"},
         {"spheres", (test::third_party_robots / "panda_spheres.json").string()}}},
       {"model", {{"self_collision", true}}}},
      source_dir, "panda"));
  for (const auto& scene : scenes) {
    CAPTURE(scene.name);
    const model::Model model = control::load_model(scene);
    const scene::SelfField field(model);
    Rng rng(23);
    int contacts = 0;
    for (int i = 0; i < 200; ++i) {
      const VectorXd q = test::random_within_limits(model, rng);
      const auto centers = centers_of(model, q);
      double nearest = 10.0;
      for (std::size_t pair = 0; pair < field.pairs().size(); ++pair)
        nearest = std::min(nearest, field.distance(pair, {centers}, 10.0));
      Judge judge(scene);
      judge.add_node(0.0, q);
      REQUIRE(judge.verdict().self.has_value());
      CHECK_FALSE(judge.verdict().obstacles.has_value());
      CHECK(judge.verdict().self->clearance_m == Approx(nearest).margin(1e-12));
      CHECK(judge.verdict().contact() == (judge.verdict().self->clearance_m <= 0.0));
      contacts += judge.verdict().contact();
    }
    CHECK(contacts > 0);
    CHECK(contacts < 200);
  }
}

TEST_CASE(
    "a scene is feasible if start and goal are free of the map and of obstacles that are not "
    "judge_only",
    "[sweep][unit]") {
  const fs::path directory = source_dir / "data/scenes";
  const scene::Scene shelf = scene::read_scene(directory / "shelf.json");
  CHECK(feasibility(shelf, {}).feasible);
  VectorXd into(7);
  into << 0.0, 1.2, 0.0, -0.4, 0.0, 1.6, 0.0;
  const Feasibility blocked = feasibility(shelf, {into});
  CHECK_FALSE(blocked.feasible);
  CHECK_THAT(blocked.reason, Catch::StartsWith("goal: ") && Catch::Contains(" in the map, ") &&
                                 Catch::EndsWith(" m deep"));
  scene::Scene start = shelf;
  start.start_q = into;
  CHECK_THAT(feasibility(start, {}).reason, Catch::StartsWith("start: "));
  // judge_only primitives do not count: the map was made from them
  scene::Obstacle wall;
  wall.shape = scene::Shape::box;
  wall.size_m = Vector3d::Constant(5.0);
  wall.judge_only = true;
  start = shelf;
  start.obstacles = {wall};
  CHECK(feasibility(start, {}).feasible);
  start.obstacles[0].judge_only = false;
  CHECK_FALSE(feasibility(start, {}).feasible);
  CHECK_THROWS_WITH(feasibility(shelf, {VectorXd::Zero(3)}),
                    Catch::Contains("goal: 3 values given, expected 7"));
}

namespace {

/// A configuration of arm7, and boxes in the map's frame around its last ball.
struct Rest {
  VectorXd q = VectorXd::Zero(7);
  Vector3d ball;
  Rest() {
    q[1] = 1.2;
    std::vector<Vector3d> centers;
    JudgedArm(scene_of(Json::object())).place(q, centers);
    ball = centers.back();
  }
  [[nodiscard]] Json box(double half) const {
    const Vector3d lo = ball.array() - half, hi = ball.array() + half;
    return Json::array({lo.x(), lo.y(), lo.z(), hi.x(), hi.y(), hi.z()});
  }
};

Json map_with(const Json& changes) {
  return {{"map", {{"file", "data/maps/clutter.bt"}, {"changes", changes}}}};
}

std::vector<double> distances(const scene::Scene& scene, const std::vector<double>& times,
                              const VectorXd& q) {
  std::vector<double> found;
  for (const double time_s : times) {
    Judge judge(scene);
    judge.add_node(time_s, q);
    const auto& nearest = judge.verdict().obstacles;
    found.push_back(nearest ? nearest->clearance_m : std::numeric_limits<double>::infinity());
  }
  return found;
}

}  // namespace

TEST_CASE("the judge sees the map with the changes up to the present time", "[sweep][unit]") {
  const Rest rest;
  const auto scene =
      scene_of(map_with({{{"time_s", 1.0}, {"occupied_boxes_m", {rest.box(0.05)}}},
                         {{"time_s", 2.0}, {"free_boxes_m", {rest.box(1.5)}}},
                         {{"time_s", 3.0}, {"occupied_boxes_m", {rest.box(0.01)}}}}));
  const auto found = distances(scene, {0.0, 0.999, 1.0, 1.999, 2.0, 2.5, 3.0, 9.0}, rest.q);
  CHECK(found[0] > 0.0);
  CHECK(found[1] == found[0]);
  CHECK(found[2] < 0.0);
  CHECK(found[3] == found[2]);
  CHECK(found[4] > found[0]);  // leaves of the original map are freed as well
  CHECK(found[5] == found[4]);
  CHECK(found[6] < 0.0);
  CHECK(found[7] == found[6]);
  // stored leaves are discarded at a change
  Judge judge(scene);
  for (int i = 0; i <= 100; ++i) judge.add_node(0.01 * i - 0.005, rest.q);
  CHECK_FALSE(judge.verdict().contact());
  judge.add_node(1.0, rest.q);
  CHECK(judge.verdict().contact());
  CHECK(judge.verdict().obstacles->time_s == 1.0);
  CHECK(judge.verdict().obstacles->other == "map");
}

TEST_CASE("the judge's own code changes maps as runs do", "[sweep][unit]") {
  const Rest rest;
  Json free_boxes = Json::array(), occupied_boxes = Json::array();
  Rng rng(29);
  for (int i = 0; i < 12; ++i) {
    const Vector3d lo{rng.uniform(-0.7, 0.6), rng.uniform(-0.7, 0.6), rng.uniform(0.0, 0.9)};
    const Vector3d hi =
        lo + Vector3d(rng.uniform(0.03, 0.3), rng.uniform(0.03, 0.3), rng.uniform(0.03, 0.3));
    (i % 2 == 0 ? free_boxes : occupied_boxes)
        .push_back({lo.x(), lo.y(), lo.z(), hi.x(), hi.y(), hi.z()});
  }
  scene::MakeMapOptions other;
  other.resolution_m = 0.02;
  scene::Clutter clutter;
  clutter.count = 10;
  clutter.size_min_m = 0.05;
  clutter.size_max_m = 0.3;
  clutter.bounds = {{-0.7, -0.7, 0.0}, {0.7, 0.7, 1.0}};
  other.primitives = scene::make_clutter(clutter);
  other.free_bounds = scene::Box{{-0.4, -0.8, 0.1}, {0.8, 0.5, 0.9}};
  other.output = fs::path(HAMELIN_TEST_BINARY_DIR) / "sweep_other.bt";
  (void)scene::make_map(other);
  const auto scene = scene_of(map_with({{{"time_s", 0.5}, {"occupied_boxes_m", occupied_boxes}},
                                        {{"time_s", 1.0}, {"free_boxes_m", free_boxes}},
                                        {{"time_s", 1.5}, {"file", "data/maps/clutter.bt"}},
                                        {{"time_s", 2.0}, {"file", other.output.string()}}}));
  const model::Model model = control::load_model(scene);
  const JudgedArm judged_arm(scene);
  JudgedMap map(scene, judged_arm);
  auto environment = scene::make_environment(scene, model, 0.5);
  scene::PlacedShapes arm(model);
  dynamics::Workspace ws(model);
  std::vector<Vector3d> centers;
  int contacts = 0, clear = 0;
  for (const double time_s : {0.0, 0.5, 1.0, 1.5, 2.0}) {
    (void)environment.advance(time_s);
    CHECK(map.advance(time_s) == (time_s > 0.0));
    Rng poses(31);
    for (int i = 0; i < 25; ++i) {
      const VectorXd q = test::random_within_limits(model, poses);
      dynamics::forward_kinematics(model, ws, q);
      arm.place(model, ws);
      judged_arm.place(q, centers);
      double found = std::numeric_limits<double>::infinity();
      for (std::size_t k = 0; k < centers.size(); ++k)
        found = std::min(found, map.distance(centers[k]) - judged_arm.balls()[k].radius);
      const double expected = environment.clearance(arm.view(), time_s, 0.5);
      CAPTURE(time_s, i, expected, found);
      CHECK((found <= 0.0) == (expected <= 0.0));
      if (expected > 0.0 && expected < 0.5) CHECK(found == Approx(expected).margin(1e-9));
      ++(found <= 0.0 ? contacts : clear);
    }
  }
  CHECK(contacts > 10);
  CHECK(clear > 10);
}

TEST_CASE("with exact primitives the judge sees of the map only what changes occupy",
          "[sweep][unit]") {
  const Rest rest;
  Json document = map_with({{{"time_s", 1.0}, {"occupied_boxes_m", {rest.box(0.05)}}}});
  document["obstacles"] = {{{"type", "sphere"},
                            {"radius_m", 0.1},
                            {"position_m", {5.0, 5.0, 5.0}},
                            {"judge_only", true}}};
  const auto found = distances(scene_of(document), {0.0, 1.0}, rest.q);
  CHECK(found[0] > 4.0);
  CHECK(found[1] < 0.0);
}

TEST_CASE(
    "a start must be clear in the map at time 0, a goal in one of the maps within the scene's "
    "duration",
    "[sweep][unit]") {
  const Rest rest;
  const std::vector<double> away(7, 0.0), there(rest.q.begin(), rest.q.end());
  const Json block{{"occupied_boxes_m", {rest.box(0.05)}}},
      unblock{{"free_boxes_m", {rest.box(0.5)}}};
  const auto at = [](double time_s, Json change) {
    change["time_s"] = time_s;
    return change;
  };
  const auto judged = [&](const std::vector<double>& start, const std::vector<double>& goal,
                          const Json& changes) {
    Json document = map_with(changes);
    document["start"] = {{"q", start}};
    document["goals"] = {{{"type", "joint"}, {"q", goal}}};
    document["duration_s"] = 5.0;
    return feasibility(scene_of(document), {});
  };
  REQUIRE(judged(away, there, Json::array()).feasible);
  REQUIRE(judged(there, away, Json::array()).feasible);
  CHECK_THAT(judged(there, away, Json::array({at(0.0, block)})).reason,
             Catch::StartsWith("start: "));
  CHECK(judged(there, away, Json::array({at(0.001, block)})).feasible);
  CHECK_FALSE(judged(there, away, Json::array({at(0.0, block), at(0.001, unblock)})).feasible);
  CHECK_THAT(judged(away, there, Json::array({at(0.0, block)})).reason,
             Catch::StartsWith("goal: ") && Catch::Contains("in the map"));
  CHECK(judged(away, there, Json::array({at(1.0, block)})).feasible);  // the arm may arrive before
  CHECK(judged(away, there, Json::array({at(0.0, block), at(5.0, unblock)})).feasible);
  CHECK_FALSE(judged(away, there, Json::array({at(0.0, block), at(5.1, unblock)})).feasible);
}
