#include "hamelin/reactive/field_drive.hpp"

#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/reactive/rest_rule.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/reactive_scene.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using planning::SetupData;
using reactive::FieldDrive;
using reactive::NearPoint;
using reactive::Repulsion;

namespace {

constexpr double period_s = 0.001;
const Vector3d gravity{1.0, -2.0, -9.0};

hamelin_goal joint_goal(const VectorXd& q) {
  hamelin_goal goal{};
  goal.struct_size = sizeof goal;
  goal.type = HAMELIN_GOAL_JOINT;
  goal.tolerance_rad = 0.02;
  goal.q = q.data();
  return goal;
}

SetupData setup_of(const model::Model& model) {
  SetupData data(model);
  data.control_period_s = period_s;
  data.influence_m = 0.1;
  return data;
}

/// A drive with its inputs, and an arm that the held torque moves.
struct Driven {
  explicit Driven(const model::Robot& robot, SetupData from)
      : model(robot, geometry::SE3{}, gravity),
        data(std::move(from)),
        raw(data.view()),
        drive(planning::Setup(raw), {2.0, 0.05}),
        ws(model),
        q(VectorXd::Zero(model.dof())),
        v(q),
        to(q),
        buffers(static_cast<std::size_t>(model.dof()), 64),
        command(buffers.raw(), static_cast<std::size_t>(model.dof())) {}
  Driven(const Driven&) = delete;

  void update() {
    goal = joint_goal(to);
    input = {};
    input.struct_size = sizeof input;
    input.q = q.data();
    input.v = v.data();
    input.goal = &goal;
    input.speed_scale = 1.0;
    input.contacts = contacts.data();
    input.contact_count = contacts.size();
    input.contact_stride = sizeof(hamelin_contact);
    buffers.clear();
    drive.update(planning::Tick(input, static_cast<std::size_t>(q.size())));
  }
  /// The acceleration of the arm by the held torque alone.
  VectorXd acceleration() {
    VectorXd a(q.size());
    dynamics::forward_dynamics(model, ws, q, v, buffers.held_torque(), a);
    return a;
  }
  void add_contact(int shape, double distance, const Vector3d& n) {
    hamelin_contact contact{};
    contact.shape = shape;
    contact.distance_m = distance;
    dynamics::forward_kinematics(model, ws, q);
    planning::VectorMap(contact.arm_point_world_m, 3) =
        dynamics::link_pose(model, ws, data.shapes[static_cast<std::size_t>(shape)].link) *
        planning::vec3(data.shapes[static_cast<std::size_t>(shape)].center_link_m);
    planning::VectorMap(contact.direction_world, 3) = n.normalized();
    contacts.push_back(contact);
  }

  model::Model model;
  SetupData data;
  hamelin_setup raw;
  FieldDrive drive;
  dynamics::Workspace ws;
  VectorXd q, v, to;
  hamelin_goal goal{};
  hamelin_tick input{};
  std::vector<hamelin_contact> contacts;
  planning::CommandBuffers buffers;
  planning::Command command;
};

const model::Robot robot4 = test::random_robot(11, 4);

SetupData free_setup() {
  return setup_of(model::Model(robot4, geometry::SE3{}, gravity));
}

}  // namespace

TEST_CASE("far from the goal the attraction has the cruise speed and a bounded acceleration",
          "[reactive][field_drive]") {
  Driven arm(robot4, free_setup());
  arm.to << 3.0, -2.0, 1.0, 0.5;
  arm.update();
  const VectorXd direction = arm.to.normalized();
  CHECK(arm.drive.acceleration().cwiseAbs().maxCoeff() == Approx(10.0));
  CHECK((arm.drive.acceleration().normalized() - direction).norm() < 1e-12);
  arm.v = arm.to * (2.0 / 3.0);  // the first joint has the cruise speed
  arm.update();
  CHECK(arm.drive.acceleration().norm() < 1e-12);
  CHECK(arm.drive.goal_factor() == 1.0);
  // Near the goal it is linear: 20 (4 e − v).
  arm.v << 0.02, 0.0, 0.01, 0.0;
  arm.q = arm.to - VectorXd::Constant(4, 0.01);
  arm.update();
  CHECK((arm.drive.acceleration() - 20.0 * (VectorXd::Constant(4, 0.04) - arm.v)).norm() < 1e-12);
  CHECK(arm.drive.at_goal());
  CHECK(arm.drive.goal_factor() == Approx(std::pow(0.02 / 0.5, 2)));
}

TEST_CASE("the scene's speed scale slows the attraction", "[reactive][field_drive]") {
  Driven arm(robot4, free_setup());
  arm.to << 3.0, -2.0, 1.0, 0.5;
  arm.v = arm.to * (0.5 / 3.0);
  arm.update();
  arm.input.speed_scale = 0.25;
  arm.drive.update(planning::Tick(arm.input, 4));
  CHECK(arm.drive.acceleration().norm() < 1e-12);
}

TEST_CASE("the attraction to a pose turns the tip", "[reactive][field_drive]") {
  Driven arm(robot4, free_setup());
  arm.q << 0.3, -0.5, 0.8, 0.4;
  arm.update();
  dynamics::forward_kinematics(arm.model, arm.ws, arm.q);
  const geometry::SE3 tip = dynamics::tip_pose(arm.model, arm.ws);
  hamelin_goal pose{};
  pose.type = HAMELIN_GOAL_POSE;
  std::copy_n(tip.p().data(), 3, pose.position_world_m);
  const Eigen::Quaterniond to(Eigen::AngleAxisd(0.3, Vector3d::UnitX()) * tip.R());
  pose.quaternion_wxyz[0] = to.w();
  planning::VectorMap(&pose.quaternion_wxyz[1], 3) = to.vec();
  arm.input.goal = &pose;
  arm.drive.update(planning::Tick(arm.input, 4));
  dynamics::Matrix6Xd J(6, 4);
  dynamics::frame_jacobian(arm.model, arm.ws, arm.model.robot().tip.link, tip.p(), J);
  CHECK((J * arm.drive.acceleration()).x() > 0.1);
}

TEST_CASE("the repulsion is the negative derivative of its potential", "[reactive][field_drive]") {
  const Repulsion repulsion{1e-6, 0.025, 0.002};
  const double step = 1e-8;
  for (const double rho : {-0.003, 0.0005, 0.0019, 0.0021, 0.004, 0.01, 0.02, 0.0249}) {
    CAPTURE(rho);
    const double difference =
        (repulsion.potential(rho - step) - repulsion.potential(rho + step)) / (2.0 * step);
    CHECK(repulsion.force(rho) == Approx(difference).epsilon(1e-5));
  }
  CHECK(repulsion.force(0.025) == 0.0);
  CHECK(repulsion.potential(0.025) == 0.0);
}

TEST_CASE("a push accelerates the distance of its point, up to the least mobility",
          "[reactive][field_drive]") {
  Driven arm(robot4, free_setup());
  arm.q << 0.3, -0.5, 0.8, 0.4;
  arm.to = arm.q;
  arm.add_contact(3, 0.02, {0.3, 1.0, -0.4});
  arm.update();
  REQUIRE(arm.drive.points().size() == 1);
  const NearPoint& point = arm.drive.points().front();
  MatrixXd M(4, 4);
  dynamics::mass_matrix(arm.model, arm.ws, arm.q, M);
  const VectorXd Wa = M.inverse() * point.row;
  const double mobility = point.row.dot(Wa);
  arm.drive.push(point, 3.0);
  CHECK((arm.drive.acceleration() - 3.0 / (mobility + 0.01) * Wa).norm() < 1e-9);
}

TEST_CASE("only approaches that are too fast for their distance are braked",
          "[reactive][field_drive]") {
  Driven arm(robot4, free_setup());
  arm.q << 0.3, -0.5, 0.8, 0.4;
  arm.to = arm.q;
  arm.add_contact(3, 0.03, {0.3, 1.0, -0.4});
  arm.update();
  const VectorXd row = arm.drive.points().front().row;
  const auto braked = [&](double approach) {
    arm.v = -approach / row.squaredNorm() * row;
    arm.update();
    const NearPoint& point = arm.drive.points().front();
    CHECK(arm.drive.approach_speed(point) == Approx(approach));
    const VectorXd before = arm.drive.acceleration();
    arm.drive.brake(point);
    return row.dot(arm.drive.acceleration() - before);
  };
  CHECK(braked(-1.0) == 0.0);
  CHECK(braked(0.1) == 0.0);
  // The distance less 8 mm allows √(6 (0.022 − 3/512)) = 0.311 m/s, docs/theory.md (10.10).
  CHECK(braked(0.31) == 0.0);
  CHECK(braked(0.32) > 0.0);
  CHECK(braked(1.0) > 10.0);
}

TEST_CASE("without limits the held torque gives a bounded acceleration",
          "[reactive][field_drive]") {
  Driven arm(robot4, free_setup());
  Rng rng(3);
  for (int i = 0; i < 200; ++i) {
    arm.q = test::random_joints(rng, 4, 3.0);
    arm.v = test::random_joints(rng, 4, 2.0);
    arm.to = test::random_joints(rng, 4, 3.0);
    arm.contacts.clear();
    arm.add_contact(3, rng.uniform(0.0, 0.05), test::random_vector(rng));
    arm.add_contact(2, rng.uniform(0.0, 0.05), test::random_vector(rng));
    arm.update();
    for (const auto& point : arm.drive.points()) {
      arm.drive.push(point, 50.0);
      arm.drive.brake(point);
    }
    arm.drive.apply(arm.command);
    REQUIRE(arm.acceleration().cwiseAbs().maxCoeff() <= 15.0 + 1e-6);
  }
}

TEST_CASE("the limits of joints and of their speeds are never passed", "[reactive][field_drive]") {
  const bool sampled = GENERATE(false, true);
  CAPTURE(sampled);
  SetupData data = free_setup();
  data.sampled = sampled;
  data.q_lower = Eigen::Vector4d(-1.0, -0.5, -2.0, -0.2);
  data.q_upper = Eigen::Vector4d(0.5, 1.5, 0.1, 0.9);
  data.velocity_max = Eigen::Vector4d(1.0, 2.0, 1.5, 3.0);
  Driven arm(robot4, data);
  Rng rng(5);
  double nearest = 1.0;
  for (int run = 0; run < 40; ++run) {
    CAPTURE(run);
    for (int k = 0; k < 4; ++k) {
      arm.q[k] = rng.uniform(data.q_lower[k], data.q_upper[k]);
      // From here half of the deceleration that the drive may use stops the joint.
      const double room = std::min(arm.q[k] - data.q_lower[k], data.q_upper[k] - arm.q[k]);
      const double most = std::min(data.velocity_max[k], std::sqrt(5.0 * room));
      arm.v[k] = rng.uniform(-most, most);
      arm.to[k] = rng.uniform(1.5 * data.q_lower[k] - 0.5, 1.5 * data.q_upper[k] + 0.5);
    }
    for (int tick = 0; tick < 3000; ++tick) {
      arm.update();
      arm.drive.apply(arm.command);
      arm.v += period_s * arm.acceleration();
      arm.q += period_s * arm.v;
      REQUIRE((arm.q - data.q_lower).minCoeff() >= 0.0);
      REQUIRE((data.q_upper - arm.q).minCoeff() >= 0.0);
      REQUIRE((data.velocity_max - arm.v.cwiseAbs()).minCoeff() >= 0.0);
    }
    nearest =
        std::min({nearest, (arm.q - data.q_lower).minCoeff(), (data.q_upper - arm.q).minCoeff()});
  }
  CHECK(nearest < 0.05);  // some goals lie beyond the limits
}

TEST_CASE("the held torque and the turning keep within the torque limits, and turning does no work",
          "[reactive][field_drive]") {
  SetupData data = free_setup();
  data.effort_max = Eigen::Vector4d(8.0, 6.0, 4.0, 2.0);
  Driven arm(robot4, data);
  Rng rng(7);
  int bounded = 0;
  for (int i = 0; i < 100; ++i) {
    arm.q = test::random_joints(rng, 4, 3.0);
    arm.v = test::random_joints(rng, 4, 2.0);
    arm.to = test::random_joints(rng, 4, 3.0);
    arm.contacts.clear();
    arm.add_contact(3, 0.02, test::random_vector(rng));
    arm.update();
    const NearPoint& point = arm.drive.points().front();
    const Vector3d w = test::random_vector(rng, 20.0), velocity = arm.drive.velocity(point);
    arm.drive.turn(point, w, arm.command);
    arm.drive.apply(arm.command);
    REQUIRE(arm.buffers.gyroscopic().size() == 1);
    const Vector3d applied = planning::vec3(arm.buffers.gyroscopic()[0].w_world);
    CHECK(applied.cross(w).norm() < 1e-9 * w.squaredNorm());
    bounded += applied.norm() < 0.999 * w.norm() ? 1 : 0;
    VectorXd turning(4);
    dynamics::forward_kinematics(arm.model, arm.ws, arm.q);
    dynamics::point_jacobian_transpose(arm.model, arm.ws, point.link, point.arm_point,
                                       applied.cross(velocity), turning);
    CHECK(turning.cwiseAbs().cwiseQuotient(data.effort_max).maxCoeff() <= 0.3 + 1e-9);
    CHECK(std::abs(turning.dot(arm.v)) < 1e-12 * (1.0 + turning.norm()) * arm.v.norm() * 10.0);
    const VectorXd sum = arm.buffers.held_torque() + turning;
    CHECK(sum.cwiseAbs().cwiseQuotient(data.effort_max).maxCoeff() <= 0.98 + 1e-9);
  }
  CHECK(bounded > 10);
}

TEST_CASE("a disturbance is made up for", "[reactive][field_drive]") {
  Driven arm(robot4, free_setup());
  arm.to << 0.5, 0.1, -0.2, 0.4;
  arm.update();
  arm.drive.apply(arm.command);
  const VectorXd without = arm.acceleration(), disturbance = Eigen::Vector4d(0.5, -0.2, 0.1, 0.3);
  arm.update();
  arm.input.disturbance = disturbance.data();
  arm.drive.update(planning::Tick(arm.input, 4));
  arm.drive.apply(arm.command);
  CHECK((arm.acceleration() + disturbance - without).norm() < 1e-9);
}

TEST_CASE("the field drive does not allocate", "[reactive][field_drive]") {
  test::require_allocation_count();
  SetupData data = free_setup();
  data.q_lower = VectorXd::Constant(4, -2.0);
  data.q_upper = -data.q_lower;
  data.velocity_max = data.effort_max = VectorXd::Constant(4, 3.0);
  Driven arm(robot4, data);
  arm.v.setConstant(0.3);
  arm.to.setConstant(1.0);
  arm.add_contact(3, 0.01, {1.0, 0.2, 0.3});
  CHECK(test::allocations_in([&] {
          arm.update();
          for (const auto& point : arm.drive.points()) {
            arm.drive.push(point, 1.0);
            arm.drive.brake(point);
            arm.drive.pull(point, arm.drive.inertia(point) * arm.drive.velocity(point));
            arm.drive.turn(point, {0.0, 0.0, 1.0}, arm.command);
          }
          arm.drive.apply(arm.command);
        }) == 0);
}

TEST_CASE("an arm that rests away from its goal is given up after 3 s", "[reactive][rest_rule]") {
  Driven arm(robot4, free_setup());
  arm.update();
  reactive::RestRule rule{planning::Setup(arm.raw)};
  const auto ticks_until_end = [&](bool at_goal, int ticks) {
    for (int i = 0; i < ticks; ++i) {
      arm.buffers.clear();
      rule.check(planning::Tick(arm.input, 4), at_goal, arm.command);
      if (arm.buffers.raw().state == HAMELIN_PLANNER_GAVE_UP) return i;
      REQUIRE(arm.buffers.raw().state == HAMELIN_PLANNER_DETECTS_STALLS);
    }
    return ticks;
  };
  CHECK(ticks_until_end(true, 5000) == 5000);
  CHECK(ticks_until_end(false, 2900) == 2900);
  arm.input.goal_number = 1;  // counts again from zero
  CHECK(ticks_until_end(false, 2900) == 2900);
  arm.v.setConstant(0.1);
  CHECK(ticks_until_end(false, 1) == 1);
  arm.v.setZero();
  arm.input.moving_count = 1;
  CHECK(ticks_until_end(false, 5000) == 5000);
  arm.input.moving_count = 0;
  CHECK(ticks_until_end(false, 5000) == Approx(3000).margin(1));
  CHECK(std::string(arm.buffers.raw().cause) ==
        "force balance: the arm has rested for 3 s away from the goal");
}
