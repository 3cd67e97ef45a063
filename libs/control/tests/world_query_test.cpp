#include "world/world_query.hpp"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <string>

#include "hamelin/control/preparation.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr double influence = 0.2;

/// The arm of a scene of data/ among the boxes of its map, a ball that stands, and one that moves.
struct QueryRig {
  QueryRig()
      : scene(with_balls()),
        arm(control::load_model(scene)),
        world(scene, arm, {influence}),
        view(scene, arm, world),
        query(arm, world, view),
        ws(arm),
        shapes(arm) {
    query.refresh();
  }
  static scene::Scene with_balls() {
    scene::Scene scene =
        scene::read_scene(std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/scenes/clutter.json");
    scene.model.self_collision = true;
    scene::Obstacle still, moving;
    still.name = "still";
    still.radius_m = 0.1;
    still.pose = {Eigen::Matrix3d::Identity(), {0.5, 0.2, 0.6}};
    moving = still;
    moving.name = "moving";
    moving.pose = {Eigen::Matrix3d::Identity(), {-0.5, 0.0, 0.6}};
    moving.motion = scene::LinearMotion{{0.0, 0.2, 0.0}, 0.0};
    scene.obstacles = {still, moving};
    return scene;
  }
  [[nodiscard]] VectorXd random_q() {
    VectorXd q(arm.dof());
    for (int i = 0; i < arm.dof(); ++i) {
      const auto& joint = arm.robot().links[static_cast<std::size_t>(i)].joint;
      q[i] = rng.uniform(joint.lower.value_or(-3.0), joint.upper.value_or(3.0));
    }
    return q;
  }
  /// The smallest distance at q, computed without the query.
  double reference(const VectorXd& q, double time_s) {
    dynamics::forward_kinematics(arm, ws, q);
    shapes.place(arm, ws);
    double smallest = world.latest()->environment.clearance(shapes.view(), time_s, influence);
    for (std::size_t pair = 0; pair < view.self_field()->pairs().size(); ++pair) {
      const double distance = view.self_field()->distance(pair, shapes.view(), 1.0);
      if (distance < view.self_influence_m()) smallest = std::min(smallest, distance);
    }
    return smallest;
  }

  scene::Scene scene;
  model::Model arm;
  control::World world;
  control::WorldView view;
  control::WorldQuery query;
  dynamics::Workspace ws;
  scene::PlacedShapes shapes;
  Rng rng{3};
};

}  // namespace

TEST_CASE(
    "the clearance of a configuration is that of obstacles and of the arm itself, and ends "
    "early below a bound",
    "[control][query]") {
  QueryRig rig;
  long contacts = 0, by_self = 0;
  for (int i = 0; i < 300; ++i) {
    const VectorXd q = rig.random_q();
    const double time_s = rig.rng.uniform(0.0, 5.0), expected = rig.reference(q, time_s);
    const double found = rig.query.clearance(q.data(), time_s, -1.0);
    CHECK(found == Approx(expected).margin(1e-12));
    CHECK(rig.query.clearance(q.data(), time_s, expected + 0.01) < expected + 0.01);
    if (expected <= 0.0) CHECK(rig.query.clearance(q.data(), time_s, 0.0) <= 0.0);
    contacts += expected <= 0.0 ? 1 : 0;
    std::vector<hamelin_self_contact> self(100);
    const std::size_t pairs =
        rig.query.self_contacts(q.data(), 1.0, std::span<hamelin_self_contact>(self));
    for (std::size_t k = 0; k < pairs; ++k) {
      CHECK(self[k].distance_m >= expected - 1e-12);
      by_self += std::abs(self[k].distance_m - expected) < 1e-12 ? 1 : 0;
    }
  }
  CHECK(contacts > 20);
  CHECK(by_self > 5);
}

TEST_CASE("contacts of a query name shapes and obstacles by their ids, at their times",
          "[control][query]") {
  QueryRig rig;
  rig.world.remove_obstacle("still");  // ids do not shift
  rig.query.refresh();
  std::vector<hamelin_contact> contacts(10000);
  long moving = 0;
  for (int i = 0; i < 200; ++i) {
    const VectorXd q = rig.random_q();
    const double time_s = rig.rng.uniform(0.0, 5.0);
    const std::size_t count =
        rig.query.contacts(q.data(), time_s, influence, std::span<hamelin_contact>(contacts));
    REQUIRE(count <= contacts.size());
    for (std::size_t k = 0; k < count; ++k) {
      CHECK(contacts[k].obstacle != 0);
      if (contacts[k].obstacle != 1) continue;
      ++moving;
      const Vector3d center(-0.5, 0.2 * time_s, 0.6);
      CHECK((Vector3d::Map(contacts[k].obstacle_point_world_m) - center).norm() == Approx(0.1));
      CHECK(contacts[k].obstacle_velocity_world_m_s[1] == 0.2);
    }
  }
  CHECK(moving > 20);
}

TEST_CASE("a motion that is proved clear has no contact anywhere, and most clear ones are proved",
          "[control][query]") {
  QueryRig rig;
  long clear = 0, proved = 0;
  for (int i = 0; i < 300; ++i) {
    const VectorXd from = rig.random_q(),
                   to = from + rig.rng.uniform(0.05, 0.5) * (rig.random_q() - from);
    const double t0 = rig.rng.uniform(0.0, 3.0), t1 = t0 + rig.rng.uniform(0.0, 2.0);
    double sampled = influence;
    constexpr int samples = 200;
    for (int k = 0; k <= samples && sampled > 0.0; ++k) {
      const double s = static_cast<double>(k) / samples;
      sampled = std::min(sampled, rig.reference(from + s * (to - from), t0 + s * (t1 - t0)));
    }
    double margin = 0.0;
    const bool is_clear = rig.query.motion_clear(from.data(), to.data(), 0.0, t0, t1, margin);
    if (is_clear) {
      CHECK(margin > 0.0);
      CHECK(sampled >= margin);
      ++proved;
    }
    clear += sampled > 0.0 ? 1 : 0;
  }
  CHECK(clear > 30);
  CHECK(static_cast<double>(proved) > 0.95 * static_cast<double>(clear));
}

TEST_CASE("whether a motion is clear depends on its times where obstacles move",
          "[control][query]") {
  scene::Scene scene = QueryRig::with_balls();
  scene.map.reset();
  scene.model.self_collision = false;
  const model::Model arm = control::load_model(scene);
  control::World world(scene, arm, {influence});
  world.remove_obstacle("still");
  dynamics::Workspace ws(arm);
  const VectorXd q = scene.start_q;
  dynamics::forward_kinematics(arm, ws, q);
  const Vector3d tip = dynamics::tip_pose(arm, ws).p();
  const geometry::SE3 start{Eigen::Matrix3d::Identity(), tip - Vector3d(0.0, 1.0, 0.0)};
  world.move_obstacle("moving", start, {0.0, 0.5, 0.0}, 0.0);  // at the tip after 2 s
  control::WorldView view(scene, arm, world);
  control::WorldQuery query(arm, world, view);
  query.refresh();
  VectorXd near = q;
  near[0] += 0.05;
  double margin = 0.0;
  CHECK(query.motion_clear(q.data(), near.data(), 0.0, 0.0, 0.5, margin));
  CHECK_FALSE(query.motion_clear(q.data(), near.data(), 0.0, 0.0, 3.0, margin));
  CHECK_FALSE(query.motion_clear(q.data(), near.data(), 0.0, 1.9, 2.1, margin));
  CHECK(query.motion_clear(q.data(), near.data(), 0.0, 4.0, 4.5, margin));
}

TEST_CASE("distances of points have their gradients, and boxes cover exactly what is occupied",
          "[control][query]") {
  QueryRig rig;
  rig.world.remove_obstacle("still");
  rig.world.remove_obstacle("moving");
  rig.query.refresh();
  std::vector<hamelin_box> boxes(5000);
  const std::size_t count =
      rig.query.boxes({-1.0, -1.0, 0.0}, {1.0, 1.0, 1.0}, std::span<hamelin_box>(boxes));
  REQUIRE(count > 10);
  REQUIRE(count <= boxes.size());
  long inside = 0, checked = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vector3d p(rig.rng.uniform(-0.6, 0.6), rig.rng.uniform(-0.6, 0.6),
                     rig.rng.uniform(0.0, 0.9));
    Vector3d gradient, unused;
    const double distance = rig.query.distance(p, 0.0, 0.15, gradient);
    bool in_box = false;
    for (std::size_t k = 0; k < count; ++k) {
      const Vector3d offset = (p - Vector3d::Map(boxes[k].center_world_m)).cwiseAbs() -
                              Vector3d::Map(boxes[k].half_size_m);
      in_box = in_box || offset.maxCoeff() < 0.0;
    }
    CHECK(in_box == (distance < 0.0));
    inside += in_box ? 1 : 0;
    if (distance < 0.01 || distance >= 0.149) continue;
    const double step = 1e-6;
    const double along = rig.query.distance(p + step * gradient, 0.0, 0.15, unused);
    CHECK((along - distance) / step == Approx(1.0).margin(1e-3));
    ++checked;
  }
  CHECK(inside > 20);
  CHECK(checked > 200);
}

TEST_CASE(
    "after a refresh a query sees the newest world, before it the old one; answers do not "
    "allocate",
    "[control][query]") {
  QueryRig rig;
  const VectorXd q = rig.scene.start_q;
  const double before = rig.query.clearance(q.data(), 0.0, -1.0);
  CHECK(before > 0.0);
  dynamics::forward_kinematics(rig.arm, rig.ws, q);
  scene::Obstacle ball;
  ball.name = "at the tip";
  ball.radius_m = 0.05;
  ball.pose = {Eigen::Matrix3d::Identity(), dynamics::tip_pose(rig.arm, rig.ws).p()};
  const std::uint64_t number = rig.world.set_obstacle(ball);
  CHECK(rig.query.clearance(q.data(), 0.0, -1.0) == before);
  CHECK(rig.query.refresh() == number);
  CHECK(rig.query.clearance(q.data(), 0.0, -1.0) < 0.0);

  std::vector<hamelin_contact> contacts(1000);
  Vector3d gradient;
  double margin = 0.0;
  const VectorXd to = q.array() + 0.1;
  const long allocations = test::allocations_in([&] {
    (void)rig.query.clearance(to.data(), 0.0, 0.0);
    (void)rig.query.contacts(to.data(), 0.0, 0.1, std::span<hamelin_contact>(contacts));
    (void)rig.query.motion_clear(q.data(), to.data(), 0.0, 0.0, 1.0, margin);
    (void)rig.query.distance({0.3, 0.3, 0.3}, 0.0, 0.1, gradient);
  });
  if (test::counts_allocations()) CHECK(allocations == 0);
}
