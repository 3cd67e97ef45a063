#include <octomap/OcTree.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <variant>

#include "hamelin/control/preparation.hpp"
#include "hamelin/control/world.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/frames.hpp"
#include "hamelin/scene/payload.hpp"
#include "hamelin/sensing/depth_camera.hpp"
#include "hamelin/test/errors.hpp"

using namespace hamelin;
using Catch::Contains;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

const std::filesystem::path data = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";

// An arm with spheres in a world of which nothing is known.
struct Room {
  scene::Scene scene = scene::read_scene(data / "scenes" / "shelf.json");
  model::Model arm;
  std::unique_ptr<control::World> world;

  explicit Room(scene::UnknownPolicy unknown = scene::UnknownPolicy::free,
                double resolution_m = 0.02)
      : arm((scene.obstacles.clear(), scene.map.emplace(), control::load_model(scene))) {
    scene.map->resolution_m = resolution_m;
    scene.map->unknown = unknown;
    make();
  }
  void make() { world = std::make_unique<control::World>(scene, arm, control::World::Options{}); }
  [[nodiscard]] const scene::Environment& environment() const {
    return world->latest()->environment;
  }
  [[nodiscard]] double distance(const Vector3d& p) const {
    const double radius = 0.0;
    return environment().clearance({{&p, 1}, {&radius, 1}}, 0.0, 1.0);
  }
};

// One point per voxel of 2 cm of a wall across x.
control::PointFrame wall_at(double x, double time_s = 0.0) {
  control::PointFrame frame;
  frame.points.resize(3, 400);
  for (int i = 0; i < 400; ++i)
    frame.points.col(i) =
        Vector3d(x + 0.013, -0.187 + 0.02 * (i % 20), 0.413 + 0.02 * (i / 20)).cast<float>();
  frame.sensor = {};
  frame.time_s = time_s;
  // points are given in the sensor's frame, which is turned as the world is
  const Vector3d at(-1.0, 0.0, 1.2);
  frame.sensor = {Eigen::Matrix3d::Identity(), at};
  frame.points.colwise() -= at.cast<float>();
  return frame;
}

// A camera that looks from one place to another.
geometry::SE3 look(const Vector3d& from, const Vector3d& to) {
  const Vector3d z = (to - from).normalized(), x = z.cross(Vector3d::UnitZ()).normalized();
  Eigen::Matrix3d R;
  R << x, z.cross(x), z;
  return {R, from};
}

}  // namespace

TEST_CASE("what a frame sees is an obstacle, and free again when later frames see through it",
          "[control][points]") {
  Room room;
  const Vector3d behind(0.813, 0.013, 0.613), front(0.613, 0.013, 0.613);
  CHECK(room.distance(front) == 1.0);
  const control::FrameReport first = room.world->insert_points(wall_at(0.6));
  CHECK(first.snapshot == 1);
  CHECK(first.points == 400);
  CHECK(first.on_arm == 0);
  CHECK(first.occupied == 400);
  CHECK(first.cleared == 0);  // unknown space was free before
  CHECK(room.distance(front) < 0.0);
  CHECK(room.world->insert_points(wall_at(0.6)).snapshot == 1);  // nothing new
  for (int i = 0; i < 20; ++i) (void)room.world->insert_points(wall_at(0.6));
  int frames = 0;
  while (frames < 10 && room.distance(front) < 0.1) {
    (void)room.world->insert_points(wall_at(0.8));
    ++frames;
    CHECK(room.distance(behind) < 0.0);  // what is new is known at once
  }
  CHECK(frames == 3);
}

TEST_CASE("the map of many frames equals OctoMap's own insertion, voxel by voxel",
          "[control][points][reference]") {
  for (const auto unknown : {scene::UnknownPolicy::free, scene::UnknownPolicy::block}) {
    Room room(unknown);
    const bool close_gaps = GENERATE(false, true);
    room.scene.map->points.close_gaps = close_gaps;
    // an arm that is far away, so that all points count
    room.scene.map->points.margin_m = 0.0;
    room.make();
    octomap::OcTree tree(0.02);
    tree.setClampingThresMin(0.4);
    tree.setClampingThresMax(0.75);
    Rng rng(7);
    const VectorXd posture = room.scene.start_q;
    for (int k = 0; k < 12; ++k) {
      control::PointFrame frame;
      frame.points.resize(3, 500);
      frame.sensor = look({1.4, rng.uniform(-1.0, 1.0), 1.2}, {0.8, 0.0, 0.3});
      for (int i = 0; i < 500; ++i) {
        const Vector3d p(rng.uniform(0.7, 1.0), rng.uniform(-0.5, 0.5), rng.uniform(0.0, 0.5));
        frame.points.col(i) = (frame.sensor.inverse() * p).cast<float>();
      }
      const control::FrameReport report = room.world->insert_points(frame);
      REQUIRE(report.on_arm == 0);
      octomap::Pointcloud cloud;
      const Eigen::Matrix3f R = frame.sensor.R().cast<float>();
      const Eigen::Vector3f at = frame.sensor.p().cast<float>();
      for (int i = 0; i < 500; ++i) {
        const Eigen::Vector3f p = R * frame.points.col(i) + at;
        cloud.push_back(p[0], p[1], p[2]);
      }
      tree.insertPointCloud(cloud, {at[0], at[1], at[2]}, -1.0, true, true);
    }
    const auto& map = room.environment().map_field();
    const auto& space = room.environment().unknown_field();
    scene::BoxHit hit;
    int different = 0, occupied = 0, known = 0, closed = 0;
    for (int x = 30; x < 60; ++x)
      for (int y = -30; y < 30; ++y)
        for (int z = -5; z < 35; ++z) {
          const Vector3d p(0.02 * x + 0.01, 0.02 * y + 0.01, 0.02 * z + 0.01);
          const auto* node = tree.search(octomap::point3d(
              static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())));
          const bool full = node != nullptr && tree.isNodeOccupied(node);
          occupied += full ? 1 : 0;
          known += node != nullptr ? 1 : 0;
          different += map.nearest(p, 0.0, hit) != full ? 1 : 0;
          if (unknown != scene::UnknownPolicy::block) continue;
          const bool blocks = space.nearest(p, 0.0, hit);
          const bool gap = close_gaps && node == nullptr && !blocks;
          closed += gap ? 1 : 0;
          different += !gap && blocks != (node == nullptr) ? 1 : 0;
        }
    CHECK(occupied > 1000);
    CHECK(known > 10000);
    CHECK(different == 0);
    CHECK((closed > 0) == (close_gaps && unknown == scene::UnknownPolicy::block));
    CHECK(20 * closed < known);
  }
}

TEST_CASE("a map that was read is seen before, and changes with what is seen",
          "[control][points]") {
  Room room;
  room.scene.map->file = data / "maps" / "shelf.bt";
  room.make();
  const Vector3d in_wall(0.413, 0.013, 0.613);
  const double before = room.distance(in_wall);
  CHECK(before > 0.0);
  REQUIRE(room.environment().summary().resolution_m == 0.01);
  (void)room.world->insert_points(wall_at(0.4));
  CHECK(room.distance(in_wall) < 0.0);
  // a new map knows nothing of what was seen
  room.world->set_map(room.scene.map);
  CHECK(room.distance(in_wall) == before);
  scene::MapChangeSpec change;
  change.occupied_m = {{{0.4, -0.2, 0.4}, {0.42, 0.2, 0.8}}};
  room.world->change_map(change);
  CHECK(room.distance(in_wall) < 0.0);
  for (int k = 0; k < 3; ++k) (void)room.world->insert_points(wall_at(0.5));
  CHECK(room.distance(in_wall) > 0.0);
}

TEST_CASE("no point of an arm that moves becomes part of the map, in 1000 postures",
          "[control][points]") {
  Room room;
  const double speed = 1.0, delay_s = 0.02, noise_m = 0.005;
  sensing::DepthCamera camera;
  camera.width = 48;
  camera.height = 36;
  camera.noise_m = noise_m;
  sensing::DepthRenderer renderer(camera);
  const geometry::SE3 at = look({1.2, 1.0, 1.2}, {0.2, 0.0, 0.4});
  dynamics::Workspace ws(room.arm);
  scene::PlacedShapes shapes(room.arm);
  std::vector<sensing::DepthRenderer::Solid> solids;
  Rng rng(11);
  VectorXd from = room.scene.start_q;
  std::size_t on_arm = 0;
  double time_s = 0.0;
  for (int k = 0; k < 1000; ++k) {
    // the arm moves on at one radian per second
    const VectorXd way = VectorXd::NullaryExpr(
        room.arm.dof(), [&](Eigen::Index) { return rng.uniform(-speed, speed); });
    control::PointFrame frame;
    for (int tick = 0; tick <= 40; ++tick) {
      const double t = 0.001 * tick;
      const VectorXd q = from + t * way;
      room.world->note_posture(time_s + t, q, 0);
      if (tick != 20) continue;
      dynamics::forward_kinematics(room.arm, ws, q);
      shapes.place(room.arm, ws);
      solids.clear();
      sensing::add_solids(shapes.view(), solids);
      frame.points = renderer.render(at, solids, rng);
      frame.sensor = at;
      frame.time_s = time_s + t;
      frame.range_m = camera.range_m;
    }
    on_arm += room.world->insert_points(frame).on_arm;
    time_s += 0.04 + delay_s;
    from = room.scene.start_q +
           VectorXd::NullaryExpr(room.arm.dof(), [&](Eigen::Index) { return rng.uniform(-1, 1); });
  }
  CHECK(on_arm > 20'000);
  CHECK(room.environment().map_field().empty());
}

TEST_CASE("what the arm carries is left out from when it is attached", "[control][points]") {
  Room room;
  scene::Payload can;
  can.name = "can";
  can.mass_kg = 0.3;
  can.inertia_kg_m2 = 1e-3 * Eigen::Matrix3d::Identity();
  can.spheres.push_back({{0.0, 0.0, 0.15}, 0.04});
  dynamics::Workspace ws(room.arm);
  dynamics::forward_kinematics(room.arm, ws, room.scene.start_q);
  const Vector3d center = dynamics::tip_pose(room.arm, ws) * Vector3d(0.0, 0.0, 0.15);
  control::PointFrame frame;
  frame.points = center.cast<float>();
  frame.points.col(0) -= Eigen::Vector3f(-1.0F, 0.0F, 1.2F);
  frame.sensor = {Eigen::Matrix3d::Identity(), {-1.0, 0.0, 1.2}};
  room.world->note_load(1, model::Model(scene::with_payloads(room.arm.robot(), {{can}}),
                                        room.arm.base(), room.arm.gravity()));
  for (int k = 0; k <= 300; ++k)
    room.world->note_posture(0.001 * k, room.scene.start_q, k >= 100 && k < 200 ? 1 : 0);
  frame.time_s = 0.15;
  CHECK(room.world->insert_points(frame).on_arm == 1);
  frame.time_s = 0.25;
  CHECK(room.world->insert_points(frame).on_arm == 0);
  CHECK(room.distance(center) < 0.02);
}

TEST_CASE("points on a known obstacle do not become part of the map", "[control][points]") {
  Room room;
  scene::Obstacle box;
  box.name = "door";
  box.shape = scene::Shape::box;
  box.size_m = {0.1, 0.2, 0.2};
  box.pose = {Eigen::Matrix3d::Identity(), {0.66, 0.5, 0.6}};
  (void)room.world->set_obstacle(box);
  for (int k = 0; k <= 1000; ++k) room.world->note_posture(0.001 * k, room.scene.start_q, 0);
  CHECK(room.world->insert_points(wall_at(0.6, 0.99)).on_obstacles == 0);
  // at the time of the frame it has come before the wall
  (void)room.world->set_obstacle(box);
  (void)room.world->move_obstacle("door", box.pose, {0.0, -1.0, 0.0}, 0.5);
  const control::FrameReport report = room.world->insert_points(wall_at(0.6, 1.0));
  CHECK(report.on_obstacles > 100);
  CHECK(report.on_obstacles + report.points == 400);
}

TEST_CASE("a ball that moves becomes an obstacle with its velocity, and the map stays empty",
          "[control][points]") {
  Room room(scene::UnknownPolicy::free, 0.02);
  sensing::DepthCamera camera;
  camera.width = 120;
  camera.height = 90;
  camera.noise_m = 0.002;
  sensing::DepthRenderer renderer(camera);
  const geometry::SE3 at = look({1.5, 0.0, 1.2}, {0.0, 0.0, 0.9});
  Rng rng(5);
  sensing::DepthRenderer::Solid ball;
  ball.shape.radius_m = 0.12;
  const auto center = [](double t) { return Vector3d(0.5, -0.6 + 0.5 * t, 0.9); };
  std::size_t movers = 0;
  double time_s = 0.0;
  for (int k = 0; k <= 40; ++k) {
    time_s = k / 20.0;
    room.world->note_posture(time_s, room.scene.start_q, 0);
    ball.pose = {Eigen::Matrix3d::Identity(), center(time_s)};
    control::PointFrame frame;
    // the ball comes into a room that was seen to be free
    frame.points = renderer.render(
        at, k < 3 ? std::vector<sensing::DepthRenderer::Solid>{} : std::vector{ball}, rng);
    frame.sensor = at;
    frame.time_s = time_s;
    frame.range_m = camera.range_m;
    movers += room.world->insert_points(frame).movers;
  }
  CHECK(movers > 25);
  REQUIRE(room.environment().obstacles().size() == 1);
  const scene::Obstacle& found = room.environment().obstacles()[0];
  CHECK_THAT(found.name, Contains("mover 0."));
  const auto motion = std::get<scene::ObservedMotion>(*found.motion);
  CHECK((motion.velocity_m_s - Vector3d(0.0, 0.5, 0.0)).norm() < 0.1);
  CHECK((found.pose.p() - center(time_s)).norm() < 0.06);
  // what it left behind is free again
  CHECK(room.distance(center(time_s - 1.0)) > 0.2);
}

TEST_CASE("a sensor on a frame of the arm sees from where the frame was", "[control][points]") {
  Room room;
  room.scene.map->points.margin_m = 0.0;
  room.make();
  const std::string name = GENERATE(as<std::string>(), "the tip", "link5");
  CAPTURE(name);
  dynamics::Workspace ws(room.arm);
  VectorXd q = room.scene.start_q;
  dynamics::forward_kinematics(room.arm, ws, q);
  const int at = name == "the tip" ? model::Model::tip_frame : room.arm.frame(name);
  const Vector3d seen = dynamics::frame_pose(room.arm, ws, at) * Vector3d(0.0, 0.0, 0.3);
  for (int k = 0; k <= 100; ++k) {
    room.world->note_posture(0.001 * k, q, 0);
    q[0] += 0.01;
  }
  control::PointFrame frame;
  frame.points = Eigen::Vector3f(0.0F, 0.0F, 0.25F);
  frame.sensor = {Eigen::Matrix3d::Identity(), {0.0, 0.0, 0.05}};
  frame.mount = name == "the tip" ? scene::Mount::tip : scene::Mount::frame;
  if (name != "the tip") frame.frame = name;
  CHECK(room.world->insert_points(frame).occupied == 1);
  CHECK(room.distance(seen) < 0.0);
}

TEST_CASE("frames that make no sense are refused in one line, and the world is unchanged",
          "[control][points]") {
  Room room;
  const auto refused = [&](const control::PointFrame& frame, const std::string& message) {
    CHECK_THAT(test::error_of([&] { (void)room.world->insert_points(frame); }), Contains(message));
    CHECK(room.world->latest()->number <= 1);
  };
  const double nan = std::nan("");
  control::PointFrame frame = wall_at(0.6);
  frame.mount = scene::Mount::frame;
  frame.frame = "link55";
  refused(frame, "points: the sensor's mount: 'arm7' has no frame 'link55'");
  frame = wall_at(0.6);
  frame.points(1, 7) = std::nanf("");
  refused(frame, "points: one is not finite");
  frame.points.resize(3, 0);
  refused(frame, "points: 0 given, expected 1 to 2000000");
  frame.points.setZero(3, 10'000'000);
  refused(frame, "points: 10000000 given, expected 1 to 2000000");
  frame = wall_at(0.6, nan);
  refused(frame, "points: time_s: is not finite");
  frame = wall_at(0.6);
  frame.range_m = 0.0;
  refused(frame, "points: range_m: 0 m given");
  frame = wall_at(0.6);
  frame.sensor = {Eigen::Matrix3d::Identity(), {nan, 0.0, 0.0}};
  refused(frame, "points: the sensor's pose is not finite");
  for (int k = 0; k <= 2000; ++k) room.world->note_posture(5.0 + 0.001 * k, room.scene.start_q, 0);
  refused(wall_at(0.6, 7.5), "points: seen at 7.5 s, expected at most 0.01 s after the last tick");
  refused(wall_at(0.6, 6.0), "points: seen at 6 s, 1 s before the last tick, expected at most 0.5");
  CHECK(room.world->latest()->number == 0);
  (void)room.world->insert_points(wall_at(0.6, 6.9));
  frame = wall_at(0.6, 6.9);
  frame.sensor = {Eigen::Matrix3d::Identity(), {0.61, 0.01, 0.61}};
  refused(frame, "points: seen from (0.61, 0.01, 0.61) m in the map, which is occupied");

  control::World bare(scene::Scene{}, room.arm, {});
  CHECK_THAT(test::error_of([&] { (void)bare.insert_points(wall_at(0.6)); }),
             Contains("points: there is no map, expected one"));
}
