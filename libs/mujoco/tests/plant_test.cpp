#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <memory>
#include <vector>

#include "fixture.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/geometry/so3.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/arm_loop.hpp"
#include "hamelin/test/frames.hpp"

using namespace hamelin;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::Rig;

namespace {

constexpr double h = 1e-3;

scene::Obstacle ball(const Vector3d& at, double radius) {
  scene::Obstacle obstacle;
  obstacle.name = "ball";
  obstacle.radius_m = radius;
  obstacle.pose = {Eigen::Matrix3d::Identity(), at};
  return obstacle;
}

// A box that moves and turns along way-points, or a capsule that is attached to a frame that does.
std::vector<scene::Obstacle> turning_bar(bool attached) {
  const std::vector<scene::Waypoint> points{
      {0.0, {2.0, 0.5, 0.0}},
      {0.3, {2.1, 0.25, 0.01}, {std::cos(0.4), 0.0, 0.0, std::sin(0.4)}},
      {0.6, {2.0, -0.1, 0.0}, {std::cos(0.7), 0.6 * std::sin(0.7), 0.0, 0.8 * std::sin(0.7)}}};
  scene::Obstacle bar = ball(Vector3d::Zero(), 0.05);
  bar.shape = attached ? scene::Shape::capsule : scene::Shape::box;
  bar.size_m = {0.3, 0.1, 0.12};
  bar.length_m = 0.2;
  const scene::WaypointMotion motion{
      std::make_shared<scene::WaypointPath>(points, scene::WaypointPath::Options(), "points")};
  if (!attached) {
    bar.motion = motion;
    return {bar};
  }
  bar.attached_to = "frame";
  bar.pose = {geometry::SO3::exp({0.0, 1.2, 0.3}).R(), {0.05, 0.02, 0.01}};
  scene::Obstacle frame;
  frame.name = "frame";
  frame.shape = scene::Shape::frame;
  frame.motion = motion;
  return {bar, frame};
}

// The largest relative deviation of the acceleration of one step from hamelin's forward dynamics,
// at random states.
double deviation(Rig& rig, std::uint64_t seed) {
  Rng rng(seed);
  const int n = rig.model.dof();
  dynamics::Workspace ws(rig.model);
  VectorXd expected(n);
  double largest = 0.0;
  simulation::Plant& plant = rig.make();
  for (int trial = 0; trial < 20; ++trial) {
    const VectorXd q = test::random_joints(rng, n, 2.0), v = test::random_joints(rng, n, 2.0),
                   torque = test::random_joints(rng, n, 20.0);
    plant.start(q, v);
    REQUIRE(plant.step(torque, h));
    dynamics::forward_dynamics(rig.model, ws, q, v, torque, expected);
    const VectorXd found = (plant.node().v - v) / h;
    largest = std::max(largest, (found - expected).norm() / expected.norm());
    CHECK((plant.node().q - q - h * plant.node().v).norm() <= 1e-12);
  }
  return largest;
}

}  // namespace

TEST_CASE("one step accelerates as hamelin's forward dynamics do", "[mujoco]") {
  const int prismatic_every = GENERATE(0, 2, 3);
  const bool planar = GENERATE(false, true);
  CAPTURE(prismatic_every, planar);
  model::Robot robot = test::random_robot(7, 6, prismatic_every, planar);
  robot.links[1].joint.armature = 0.2;
  robot.links[4].joint.armature = 0.05;
  Rig rig(model::Model(robot, test::tilted_base(), Vector3d(1.0, -2.0, -9.0)));
  CHECK(deviation(rig, 3) <= 1e-9);
}

TEST_CASE("a pushed arm moves as hamelin's integrators say, the nearer the smaller MuJoCo's step",
          "[mujoco]") {
  Rig rig(test::model_with_frames(5, 6, 3, false));
  const std::vector<dynamics::ExternalWrench> pushes{
      {model::Model::tip_frame, dynamics::Reference::local_world_aligned,
       (dynamics::Vector6d() << 1.0, -2.0, 0.5, 10.0, 5.0, -8.0).finished()},
      {rig.model.frame("lumped2"), dynamics::Reference::local,
       (dynamics::Vector6d() << 0.0, 1.0, 0.0, -6.0, 4.0, 2.0).finished()},
      {rig.model.frame("own3"), dynamics::Reference::world,
       (dynamics::Vector6d() << 2.0, 0.0, -1.0, 3.0, -3.0, 5.0).finished()}};
  const VectorXd q = VectorXd::Constant(6, 0.2), rest = VectorXd::Zero(6);
  constexpr double duration = 0.2;
  const auto integrator = integration::make_integrator("gauss:8", rig.model);
  integration::Channels channels;
  channels.wrenches = pushes;
  integration::State state = integrator->start(q, rest);
  for (int k = 0; k < 200; ++k)
    REQUIRE(integrator->step(state, channels, duration / 200).converged);
  double difference[3], unpushed = 0.0;
  for (int i = 0; i < 3; ++i) {
    const int steps = 200 << i;
    simulation::Plant& plant = rig.start(q, rest);
    plant.push(pushes);
    double work = 0.0;
    const double before = plant.energy().total();
    for (int k = 0; k < steps; ++k) {
      REQUIRE(plant.step(rest, duration / steps));
      work += plant.report().external_work_J;
    }
    difference[i] = (plant.node().q - state.q).norm();
    CHECK(std::abs(plant.energy().total() - before - work) <= 0.05 * std::abs(work));
  }
  for (int i = 0; i < 2; ++i) {
    CHECK(difference[i] / difference[i + 1] > 1.8);
    CHECK(difference[i] / difference[i + 1] < 2.2);
  }
  simulation::Plant& plant = rig.start(q, rest);
  for (int k = 0; k < 200; ++k) REQUIRE(plant.step(rest, duration / 200));
  unpushed = (plant.node().q - state.q).norm();
  CHECK(unpushed > 100.0 * difference[0]);
}

TEST_CASE("inertias that MuJoCo's compiler refuses are simulated", "[mujoco]") {
  // Point masses at the ends of the links: the inertia about two axes breaks the triangle
  // inequality.
  model::Robot robot = test::random_robot(4, 4, 0, true);
  for (auto& link : robot.links) link.inertia_kg_m2 = Vector3d(1e-3, 1e-3, 1.0).asDiagonal();
  robot.links[1].mass_kg = 0.0;
  robot.links[1].inertia_kg_m2.setZero();
  Rig rig{model::Model(robot)};
  CHECK(deviation(rig, 5) <= 1e-9);
}

TEST_CASE("energy, work and dissipation balance to first order in the step", "[mujoco]") {
  Rig rig(model::Model(test::random_robot(2, 5, 3)));
  rig.damping = VectorXd::Constant(5, 0.3);
  rig.friction = VectorXd::Constant(5, 0.2);
  const VectorXd q = VectorXd::Constant(5, 0.4), torque = VectorXd::Constant(5, 0.5);
  const auto error = [&](double step) {
    simulation::Plant& plant = rig.start(q, VectorXd::Constant(5, 0.2));
    const double before = plant.energy().total();
    double work = 0.0, dissipated = 0.0;
    for (int k = 0; k < std::lround(0.2 / step); ++k) {
      REQUIRE(plant.step(torque, step));
      work += plant.report().held_work_J;
      dissipated += plant.report().dissipated_J;
    }
    CHECK(dissipated > 0.01);
    return std::abs(plant.energy().total() - before - work + dissipated);
  };
  const double coarse = error(1e-3), fine = error(1e-4);
  CHECK(coarse < 0.1);
  CHECK(fine < 0.12 * coarse);
}

TEST_CASE("dry friction holds a torque below it, and joint limits are kept if they are modelled",
          "[mujoco]") {
  model::Robot robot = test::planar4();
  for (auto& link : robot.links) {
    link.joint.lower = -1.0;
    link.joint.upper = 0.2;
  }
  const bool limits = GENERATE(false, true);
  const VectorXd zero = VectorXd::Zero(4);
  Rig rig(model::Model(robot, geometry::SE3{}, Vector3d::Zero()));
  rig.scene.model.joint_limits = limits;
  rig.friction = VectorXd::Constant(4, 1.0);
  simulation::Plant& plant = rig.rest_at(zero);
  for (int k = 0; k < 1000; ++k) REQUIRE(plant.step(VectorXd::Constant(4, 0.9), h));
  CHECK(plant.node().q.norm() < 0.02);
  for (int k = 0; k < 1000; ++k) REQUIRE(plant.step(Eigen::Vector4d(60.0, 0.0, 0.0, 0.0), h));
  CHECK((plant.node().q[0] < 0.25) == limits);
}

TEST_CASE("each link's contact with each kind of obstacle is counted at its true depth",
          "[mujoco]") {
  const auto shape = GENERATE(scene::Shape::sphere, scene::Shape::box, scene::Shape::cylinder,
                              scene::Shape::capsule);
  const bool capsules = GENERATE(false, true);
  model::Robot robot = test::random_robot(11, 4);
  for (auto& link : robot.links) {
    if (!capsules) continue;
    link.segments.push_back({Vector3d(0.0, 0.0, -0.05), Vector3d(0.0, 0.0, 0.05), 0.03});
    link.spheres.clear();
  }
  Rig rig(model::Model(robot, test::tilted_base()));
  const VectorXd q = VectorXd::Constant(4, 0.3);
  dynamics::Workspace ws(rig.model);
  dynamics::forward_kinematics(rig.model, ws, q);
  scene::PlacedShapes placed(rig.model);
  placed.place(rig.model, ws);
  const double depth = 1.5e-3;
  for (std::size_t i = 0; i < 4; ++i) {
    CAPTURE(scene::to_string(shape), capsules, i);
    const scene::Shapes arm = placed.view();
    // the obstacle's lowest point is below the shape's highest point
    const Vector3d half = capsules ? arm.half_axes[i] : Vector3d::Zero();
    const Vector3d end = arm.centers[i] + (half.z() > 0.0 ? half : Vector3d(-half));
    const double top = end.z() + arm.radii[i];
    scene::Obstacle obstacle = ball({end.x(), end.y(), top + 0.1 - depth}, 0.1);
    obstacle.shape = shape;
    obstacle.size_m = Vector3d(0.02, 0.02, 0.2);
    obstacle.length_m = shape == scene::Shape::capsule ? 0.18 : 0.2;
    if (shape != scene::Shape::sphere) obstacle.radius_m = 0.01;
    rig.scene.obstacles = {obstacle};
    simulation::Plant& plant = rig.rest_at(q);
    const auto environment = scene::make_environment(rig.scene, rig.model, 0.1);
    const double exact = environment.clearance(arm, 0.0, 0.1);
    REQUIRE(exact == Approx(-depth).epsilon(1e-9));
    CHECK(plant.contacts().count >= 1);
    // MuJoCo finds the distance from cylinders, and that of capsules from boxes, by iteration.
    const bool closed_form = !capsules && shape != scene::Shape::cylinder;
    CHECK(plant.contacts().deepest_m == Approx(-depth).epsilon(closed_form ? 1e-6 : 0.05));
    CHECK(plant.describe_contact().find("mm inside obstacle 'ball'") != std::string::npos);
    CHECK(plant.describe_contact().find(rig.model.describe(rig.model.shapes()[i])) !=
          std::string::npos);
    rig.scene.obstacles[0].pose = {Eigen::Matrix3d::Identity(),
                                   obstacle.pose.p() + 2.0 * depth * Vector3d::UnitZ()};
    CHECK(rig.rest_at(q).contacts().count == 0);
  }
}

TEST_CASE("moving and appearing obstacles are where the scene puts them at each node", "[mujoco]") {
  Rig rig(model::Model(test::planar4(), geometry::SE3{}, Vector3d::Zero()));
  const VectorXd q = VectorXd::Zero(4);
  scene::Obstacle obstacle = ball({2.0, 0.5, 0.0}, 0.1);
  const int kind = GENERATE(0, 1, 2, 3, 4);
  if (kind == 0) obstacle.motion = scene::LinearMotion{{0.0, -1.0, 0.0}, 0.1};
  if (kind == 1) obstacle.motion = scene::SineMotion{{0.3, -0.5, 0.0}, 3.0};
  if (kind == 2) {
    obstacle = ball({2.0, 0.05, 0.0}, 0.1);
    obstacle.appears_s = 0.25;
  }
  rig.scene.obstacles = {obstacle};
  if (kind >= 3) rig.scene.obstacles = turning_bar(kind == 4);
  simulation::Plant& plant = rig.rest_at(q);
  const auto environment = scene::make_environment(rig.scene, rig.model, 1.0);
  dynamics::Workspace ws(rig.model);
  dynamics::forward_kinematics(rig.model, ws, q);
  scene::PlacedShapes placed(rig.model);
  placed.place(rig.model, ws);
  int touched = 0;
  for (int k = 1; k <= 600; ++k) {
    // held by friction alone, so that contact does not move it before it is counted
    REQUIRE(plant.step(VectorXd::Zero(4), h));
    const double exact = environment.clearance(placed.view(), k * h, 1.0);
    if (touched == 0) CHECK((plant.contacts().count > 0) == (exact < 0.0));
    if (plant.contacts().count == 0) continue;
    if (++touched == 1) CHECK(plant.contacts().deepest_m == Approx(exact).margin(1e-9));
  }
  CHECK(touched > 0);
}

TEST_CASE("random configurations touch map and arm where hamelin's distances say so", "[mujoco]") {
  scene::Scene scene = scene::read_scene(test::data / "scenes" / "clutter.json");
  scene.robot.file = test::third_party_robots / "panda.urdf";
  scene.robot.spheres = test::third_party_robots / "panda_spheres.json";
  scene.robot.srdf = test::third_party_robots / "panda.srdf";
  scene.robot.tip = "panda_hand";
  scene.start_q = VectorXd::Zero(7);
  scene.model.self_collision = true;
  Rig rig(control::load_model(scene), scene);
  simulation::Plant& plant = rig.make();
  const auto environment = scene::make_environment(scene, rig.model, 0.01);
  const scene::SelfField self(rig.model);
  dynamics::Workspace ws(rig.model);
  scene::PlacedShapes placed(rig.model);
  Rng rng(5);
  int clear = 0, in_map = 0, in_arm = 0;
  const VectorXd zero = VectorXd::Zero(7);
  for (int trial = 0; trial < 400; ++trial) {
    VectorXd q(7);
    for (int i = 0; i < 7; ++i) {
      const auto& joint = rig.model.robot().links[static_cast<std::size_t>(i)].joint;
      q[i] = rng.uniform(*joint.lower, *joint.upper);
    }
    plant.start(q, zero);
    dynamics::forward_kinematics(rig.model, ws, q);
    placed.place(rig.model, ws);
    const double to_map = environment.clearance(placed.view(), 0.0, 0.01);
    double to_arm = 0.01;
    for (std::size_t pair = 0; pair < self.pairs().size(); ++pair)
      to_arm = std::min(to_arm, self.distance(pair, placed.view(), 0.01));
    if (std::abs(to_map) < 1e-6 || std::abs(to_arm) < 1e-6) continue;
    CAPTURE(trial, to_map, to_arm, plant.describe_contact());
    CHECK((plant.contacts().count > 0) == (to_map < 0.0 || to_arm < 0.0));
    clear += to_map > 0.0 && to_arm > 0.0 ? 1 : 0;
    in_map += to_map < 0.0 && to_arm > 0.0 ? 1 : 0;
    in_arm += to_map > 0.0 && to_arm < 0.0 ? 1 : 0;
  }
  CHECK(clear > 20);
  CHECK(in_map > 20);
  CHECK(in_arm > 5);
}

TEST_CASE("a moving arm touches the map at the node at which hamelin's distances say so",
          "[mujoco]") {
  const scene::Scene scene = scene::read_scene(test::data / "scenes" / "clutter.json");
  Rig rig(control::load_model(scene), scene);
  const auto environment = scene::make_environment(scene, rig.model, 0.01);
  dynamics::Workspace ws(rig.model);
  scene::PlacedShapes placed(rig.model);
  VectorXd torque(7);
  Rng rng(8);
  int touched = 0;
  simulation::Plant& plant = rig.make();
  for (int trial = 0; trial < 20; ++trial) {
    // fast enough to pass many boxes
    plant.start(scene.start_q, test::random_joints(rng, 7, 6.0));
    for (int k = 0; k < 400; ++k) {
      dynamics::gravity_torque(rig.model, ws, plant.node().q, torque);
      REQUIRE(plant.step(torque, h));
      dynamics::forward_kinematics(rig.model, ws, plant.node().q);
      placed.place(rig.model, ws);
      const double exact = environment.clearance(placed.view(), 0.0, 0.01);
      CAPTURE(trial, k, exact);
      if (std::abs(exact) > 1e-6) REQUIRE((plant.contacts().count > 0) == (exact < 0.0));
      if (plant.contacts().count == 0) continue;
      ++touched;
      break;
    }
  }
  CHECK(touched > 5);
}

TEST_CASE("a change of the map changes what is touched, and the motion goes on", "[mujoco]") {
  scene::Scene scene = scene::read_scene(test::data / "scenes" / "clutter.json");
  Rig rig(control::load_model(scene), scene);
  const VectorXd q = scene.start_q;
  dynamics::Workspace ws(rig.model);
  dynamics::forward_kinematics(rig.model, ws, q);
  const Vector3d tip = rig.scene.map->pose.inverse() * dynamics::tip_pose(rig.model, ws).p();
  scene::MapChangeSpec change;
  change.time_s = 0.005;
  change.occupied_m = {{tip.array() - 0.05, tip.array() + 0.05}};
  rig.scene.map->changes = {change};
  VectorXd torque(rig.model.dof());
  dynamics::gravity_torque(rig.model, ws, q, torque);
  torque.array() += 0.01;
  simulation::Plant& plant = rig.rest_at(q);
  scene::Scene unchanged_scene = scene;
  Rig unchanged(rig.model, unchanged_scene);
  simulation::Plant& other = unchanged.rest_at(q);
  for (int k = 1; k <= 5; ++k) {
    CHECK(plant.contacts().count == 0);
    REQUIRE(plant.step(torque, h));
    REQUIRE(other.step(torque, h));
    CHECK(plant.node().q == other.node().q);
    CHECK(plant.node().v == other.node().v);
  }
  CHECK(plant.contacts().count > 0);
  CHECK(plant.describe_contact().find("inside the map") != std::string::npos);
}

TEST_CASE("a step without a change of the map allocates nothing", "[mujoco]") {
  test::require_allocation_count();
  scene::Scene scene = scene::read_scene(test::data / "scenes" / "clutter.json");
  Rig rig(control::load_model(scene), scene);
  simulation::Plant& plant = rig.rest_at(scene.start_q);
  const VectorXd torque = VectorXd::Zero(rig.model.dof());
  REQUIRE(plant.step(torque, h));
  const long allocations = test::allocations_in([&] {
    for (int k = 0; k < 20; ++k) (void)plant.step(torque, h);
  });
  CHECK(allocations == 0);
}

TEST_CASE("what MuJoCo cannot simulate is refused, and a state that it rejects ends the motion",
          "[mujoco]") {
  Rig rig(model::Model(test::random_robot(1, mujoco::joints_max)));
  CHECK_NOTHROW(rig.make());
  Rig longer(model::Model(test::random_robot(1, mujoco::joints_max + 1)));
  longer.scene.name = "long.json";
  CHECK_THROWS_WITH(
      longer.make(),
      "long.json: /plant/type: 'random' has 91 joints, expected at most 90 for MuJoCo");
  Rig small{model::Model(test::planar4())};
  simulation::Plant& plant = small.rest_at(VectorXd::Zero(4));
  const VectorXd before = plant.node().q;
  VectorXd torque = VectorXd::Zero(4);
  torque[2] = std::numeric_limits<double>::quiet_NaN();
  CHECK_FALSE(plant.step(torque, h));
  CHECK(plant.node().q == before);
  CHECK(plant.node().k == 0);
}
