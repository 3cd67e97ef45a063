#include <catch2/catch.hpp>
#include <cmath>
#include <random>

#include "../src/follower.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/reactive_scene.hpp"

using namespace hamelin;
using Eigen::Vector3d;
using Eigen::VectorXd;
using hybrid::Follower;
using hybrid::NearPoint;

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double no_lag = 0.0;

/// An arm of data/ that follows a target which is where the tip is.
struct Arm {
  explicit Arm(const std::string& robot)
      : model(description::read_robot(std::filesystem::path(HAMELIN_SOURCE_DIR) / robot),
              geometry::SE3{}, Vector3d::Zero()),
        ws(model),
        data(model),
        raw(data.view()),
        setup(raw),
        follower(setup, model),
        u(VectorXd::Zero(model.dof())),
        lower(VectorXd::Constant(model.dof(), -infinity)),
        upper(-lower) {
    follower.set_params({8.0, 0.5, 1.5, 1e9, 0.02, 0.15});
    goal.type = HAMELIN_GOAL_FOLLOW;
    goal.follows_rotation = 1;
  }

  /// The velocity at q towards a target at the tip that has this twist, from a comfortable posture.
  const VectorXd& velocity(const VectorXd& q, const Vector3d& turn, const Vector3d& v,
                           bool comfortable = true) {
    if (comfortable) follower.start(q);
    dynamics::forward_kinematics(model, ws, q);
    const geometry::SE3 tip = dynamics::tip_pose(model, ws);
    const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(tip.R());
    std::copy_n(tip.p().data(), 3, goal.position_world_m);
    std::copy_n(wxyz.data(), 4, goal.quaternion_wxyz);
    std::copy_n(v.data(), 3, goal.velocity_world_m_s);
    std::copy_n(turn.data(), 3, goal.angular_velocity_world_rad_s);
    follower.velocity(ws, q, goal, {}, no_lag, lower, upper, u);
    return u;
  }
  /// Angular and linear velocity of the tip at the posture of the last call.
  [[nodiscard]] Eigen::Matrix<double, 6, 1> twist(const VectorXd& rates) {
    dynamics::Matrix6Xd J(6, model.dof());
    dynamics::frame_jacobian(model, ws, model.robot().tip.link, dynamics::tip_pose(model, ws).p(),
                             J);
    return J * rates;
  }

  model::Model model;
  dynamics::Workspace ws;
  planning::SetupData data;
  hamelin_setup raw;
  planning::Setup setup;
  Follower follower;
  hamelin_goal goal{};
  VectorXd u, lower, upper;
};

const VectorXd regular6 = (VectorXd(6) << 0.3, -0.2, 0.5, 0.4, -0.9, 0.2).finished();
const VectorXd regular7 = (VectorXd(7) << 0.2, -0.3, 0.1, -1.9, 0.2, 1.8, 0.4).finished();

}  // namespace

TEST_CASE("the tip moves exactly as its target in regular postures", "[hybrid][follow]") {
  const Vector3d turn(0.2, -0.1, 0.3), v(0.1, 0.15, -0.05);
  Eigen::Matrix<double, 6, 1> wanted;
  wanted << turn, v;
  Arm six("tests/follow/wrist6.urdf");
  CHECK((six.twist(six.velocity(regular6, turn, v)) - wanted).norm() < 1e-12);
  Arm seven("data/robots/arm7.urdf");
  CHECK((seven.twist(seven.velocity(regular7, turn, v)) - wanted).norm() < 1e-12);
  // comfort moves only what leaves the tip in place
  seven.follower.start(VectorXd::Zero(7));
  const VectorXd with_comfort = seven.velocity(regular7, turn, v, false);
  CHECK((seven.twist(with_comfort) - wanted).norm() < 1e-12);
  CHECK((with_comfort - seven.velocity(regular7, turn, v)).norm() > 0.01);
}

TEST_CASE("a target that only has a position leaves the orientation free", "[hybrid][follow]") {
  Arm arm("tests/follow/wrist6.urdf");
  arm.goal.follows_rotation = 0;
  const Vector3d v(0.1, 0.15, -0.05);
  const auto twist = arm.twist(arm.velocity(regular6, Vector3d::Zero(), v));
  CHECK((twist.tail<3>() - v).norm() < 1e-12);
  CHECK(twist.head<3>().norm() > 0.01);
}

TEST_CASE("joint speeds stay bounded and change little across the wrist's singular posture",
          "[hybrid][follow]") {
  Arm arm("tests/follow/wrist6.urdf");
  const Vector3d turn(0.0, 0.0, 0.3), v(0.0, 0.1, 0.1);  // the turn is the direction that is lost
  VectorXd q = regular6, before;
  q[3] = 0.0;
  double least = infinity;
  for (double angle = -0.3; angle <= 0.3; angle += 0.0005) {
    q[4] = angle;
    const VectorXd u = arm.velocity(q, turn, v);
    least = std::min(least, arm.follower.smallest_singular_value());
    CHECK(u.norm() < 4.0);
    if (before.size() > 0) CHECK((u - before).norm() < 0.05);
    before = u;
    if (std::abs(angle) > 1e-9) continue;
    // directions that are not lost are followed
    const auto twist = arm.twist(u);
    CHECK((twist.tail<3>() - v).norm() < 0.01);
  }
  CHECK(least < 1e-3);
}

TEST_CASE("a stretched arm bends for a target that comes back", "[hybrid][follow]") {
  // A straight arm of four links in a plane, whose target lies inside.
  test::Task task = test::tip_task({0.9, 0.0, 0.0});
  task.joint_limit = 2.0;
  task.goal.type = HAMELIN_GOAL_FOLLOW;
  test::ReactiveScene scene(task);
  const VectorXd straight = VectorXd::Zero(4);
  Follower follower(scene.setup, scene.model);
  follower.set_params({8.0, 0.5, 1.5, 3.0, 0.02, 0.15});
  const VectorXd bound = VectorXd::Constant(4, 10.0);
  VectorXd q = straight, u = straight;
  q[1] = 1e-3;  // nearly: along the line of the links no velocity shortens the arm
  dynamics::Workspace ws(scene.model);
  const auto error = [&] { return (scene.tip(q) - Vector3d(0.9, 0.0, 0.0)).norm(); };
  const double at_first = error();
  for (int i = 0; i < 2000; ++i) {
    dynamics::forward_kinematics(scene.model, ws, q);
    follower.velocity(ws, q, scene.goal(), {}, no_lag, -bound, bound, u);
    q += 0.001 * u;
  }
  CHECK(at_first > 0.09);
  CHECK(error() < 1e-3);
}

TEST_CASE("other joints replace those at their bounds", "[hybrid][follow]") {
  Arm arm("data/robots/arm7.urdf");
  const Vector3d turn(0.1, 0.05, -0.2), v(0.1, -0.1, 0.1);
  const VectorXd free = arm.velocity(regular7, turn, v);
  Eigen::Matrix<double, 6, 1> wanted;
  wanted << turn, v;
  int replaced = 0;
  for (int k = 0; k < 7; ++k) {
    CAPTURE(k);
    const double bound = 0.5 * free[k];
    (bound > 0.0 ? arm.upper : arm.lower)[k] = bound;
    const VectorXd held = arm.velocity(regular7, turn, v);
    CHECK(held[k] == Approx(bound));
    // the others can do it alone if they are not in a singular posture
    if (arm.follower.smallest_singular_value() > 0.08) {
      CHECK((arm.twist(held) - wanted).norm() < 1e-9);
      ++replaced;
    }
    arm.upper[k] = infinity;
    arm.lower[k] = -infinity;
  }
  CHECK(replaced >= 2);
}

TEST_CASE("near an obstacle the tip moves more as its target than by least kinetic energy",
          "[hybrid][follow]") {
  Arm arm("data/robots/arm7.urdf");
  const Vector3d v(0.1, 0.0, -0.2);
  VectorXd u = arm.velocity(regular7, Vector3d::Zero(), v), by_energy = u;
  // a floor below the tip
  NearPoint point{};
  dynamics::Matrix3Xd J(3, 7);
  dynamics::point_jacobian(arm.model, arm.ws, arm.model.robot().tip.link,
                           dynamics::tip_pose(arm.model, arm.ws).p(), J);
  point.row = J.transpose() * Vector3d::UnitZ();
  point.distance = point.margin = 0.01;
  arm.follower.keep_clear({&point, 1}, 3.0, 16.0, arm.lower, arm.upper, u);
  CHECK(point.row.dot(u) > -1e-6);
  Eigen::MatrixXd M(7, 7);
  dynamics::mass_matrix(arm.model, arm.ws, regular7, M);
  const Eigen::MatrixXd W = M.inverse();
  hybrid::SafetyFilter filter(7, 1);
  filter.begin(M, W);
  REQUIRE(filter.add_row(point.row, 0.0, -1e9));
  (void)filter.project(by_energy, 100);
  CHECK(point.row.dot(by_energy) > -1e-6);
  const auto twist = arm.twist(u), energy_twist = arm.twist(by_energy);
  CHECK(twist.head<3>().norm() < 0.6 * energy_twist.head<3>().norm());
  CHECK(std::abs(twist[3] - 0.1) < 0.6 * std::abs(energy_twist[3] - 0.1));
}

TEST_CASE("following allocates nothing", "[hybrid][follow]") {
  Arm arm("data/robots/arm7.urdf");
  (void)arm.velocity(regular7, Vector3d::Zero(), Vector3d::UnitX());
  NearPoint point{};
  point.row = VectorXd::Ones(7);
  point.distance = 0.02;
  VectorXd u = arm.u;
  const VectorXd v = u;
  const long allocations = test::allocations_in([&] {
    arm.follower.observe(arm.ws, v, 0.001);
    arm.follower.velocity(arm.ws, regular7, arm.goal, {&point, 1}, no_lag, arm.lower, arm.upper, u);
    arm.follower.keep_clear({&point, 1}, 3.0, 16.0, arm.lower, arm.upper, u);
  });
  CHECK(allocations == 0);
}

TEST_CASE("an arm that is held back pulls less", "[hybrid][follow]") {
  Arm arm("data/robots/arm7.urdf");
  dynamics::forward_kinematics(arm.model, arm.ws, regular7);
  (void)arm.velocity(regular7, Vector3d::Zero(), Vector3d(0.2, 0.0, 0.0));
  CHECK(arm.follower.progress() == 1.0);
  for (int i = 0; i < 500; ++i) arm.follower.observe(arm.ws, VectorXd::Zero(7), 0.001);
  CHECK(arm.follower.progress() == Approx(std::exp(-5.0)).epsilon(1e-6));
  for (int i = 0; i < 500; ++i) arm.follower.observe(arm.ws, arm.u, 0.001);
  CHECK(arm.follower.progress() == Approx(1.0).margin(0.01));
}

TEST_CASE("a target leaves its place by 5 cm or 0.3 rad", "[hybrid][follow]") {
  hamelin_goal target{};
  target.type = HAMELIN_GOAL_FOLLOW;
  target.follows_rotation = 1;
  target.quaternion_wxyz[0] = 1.0;
  hybrid::TargetAnchor anchor;
  anchor.set(target);
  CHECK(anchor.goal().type == HAMELIN_GOAL_POSE);
  CHECK_FALSE(anchor.left_by(target));
  target.position_world_m[1] = 0.049;
  CHECK_FALSE(anchor.left_by(target));
  target.position_world_m[1] = 0.051;
  CHECK(anchor.left_by(target));
  target.position_world_m[1] = 0.0;
  target.quaternion_wxyz[0] = std::cos(0.16);
  target.quaternion_wxyz[2] = std::sin(0.16);
  CHECK(anchor.left_by(target));
  target.follows_rotation = 0;
  CHECK_FALSE(anchor.left_by(target));
}
