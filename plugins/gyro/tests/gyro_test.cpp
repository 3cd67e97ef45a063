#include <catch2/catch.hpp>
#include <numbers>

#include "hamelin/test/allocations.hpp"
#include "hamelin/test/arm_loop.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;

namespace {

const std::string plugin_file = HAMELIN_TEST_PLUGIN_DIR "/gyro.hamelin.so";

test::ArmLoop example_52(Json params, const model::Robot& robot = test::planar4()) {
  return {plugin_file, std::move(params), robot, test::goal_52, test::ball_52};
}

test::ArmLoop spatial(Json params, const std::vector<test::Ball>& balls) {
  params["rho0_m"] = 5.0;
  params["gravity_compensation"] = false;
  return {plugin_file, std::move(params), test::random_robot(11, 4), {0.3, 0.4, -0.2}, balls};
}
const std::vector<test::Ball> three_balls{{{1.2, 0.4, 0.3}, 0.1}, {{-0.8, 0.9, 0.1}, 0.2}, {{0.1, -1.4, 0.8}, 0.15}};

}  // namespace

TEST_CASE("gyro arrives in example 5.2, where apf rests", "[gyro]") {
  const std::string variant = GENERATE("published", "energy-neutral");
  const auto result = example_52(Json{{"variant", variant}}).run(40.0);
  CAPTURE(variant, result.time_s, result.distance_m, result.speed_m_s, result.clearance_m);
  CHECK(result.reached);
  CHECK(result.clearance_m > 0.0);
}

TEST_CASE("gyro arrives in 3.7 s at 0.17 m with the published measurement's gains and links as segments", "[gyro]") {
  // Spheres of 2.5 mm side by side stand for segments. Figures: SPEC §4, an independent implementation.
  const auto result =
      example_52(Json{{"variant", "published"}, {"k_p", 29.5}, {"k_v", 19.9}, {"joint_damping", 2.07}, {"k_obs", 4.74}},
                 test::planar4(200, 0.0025))
          .run(40.0);
  CHECK(result.reached);
  CHECK(result.time_s == Approx(3.7).margin(0.05));
  CHECK(result.clearance_m == Approx(0.17).margin(0.005));
}

TEST_CASE("the energy-neutral form does no work, the published one does", "[gyro]") {
  const auto neutral = example_52(Json{{"variant", "energy-neutral"}}).run(40.0);
  CHECK(neutral.reached);
  CHECK(neutral.gyroscopic_work_J < 1e-12);
  // At one state: the published torque has power, the neutral one has none.
  auto a = spatial(Json{{"variant", "published"}, {"k_p", 0}, {"k_v", 0}}, three_balls);
  auto b = spatial(Json{{"variant", "energy-neutral"}, {"k_p", 0}, {"k_v", 0}}, three_balls);
  for (auto* loop : {&a, &b}) {
    loop->q << 0.3, -0.5, 0.8, 0.4;
    loop->v << 0.7, 0.2, -0.4, 0.5;
    REQUIRE(loop->tick());
  }
  CHECK(std::abs(a.buffers.held_torque().dot(a.v)) > 1e-3);
  const Eigen::VectorXd torque = b.gyroscopic_torque();
  REQUIRE(torque.norm() > 1e-3);
  CHECK(std::abs(torque.dot(b.v)) < 1e-14 * torque.norm() * b.v.norm() * 100.0);
}

TEST_CASE("the neutral torque is Jᵀ ½(MΓ + ΓM) ẋ with Γ of (20)", "[gyro]") {
  // One ball; (19)–(21) written out with matrices.
  const std::vector<test::Ball> ball{{{1.2, 0.4, 0.3}, 0.1}};
  auto loop = spatial(Json{{"k_p", 0}, {"k_v", 0}}, ball);
  loop.q << 0.3, -0.5, 0.8, 0.4;
  loop.v << 0.7, 0.2, -0.4, 0.5;
  const model::Model model(test::random_robot(11, 4), geometry::SE3{}, Eigen::Vector3d::Zero());
  dynamics::Workspace ws(model);
  const auto contacts = loop.contacts();
  Eigen::VectorXd neutral = Eigen::VectorXd::Zero(4), published = neutral;
  int turned = 0;
  for (const auto& c : contacts) {  // one sphere a link, so each is its link's nearest
    const int link = c.sphere;
    const Eigen::Vector3d x = Eigen::Map<const Eigen::Vector3d>(c.arm_point_world_m);
    const Eigen::Vector3d rho = Eigen::Map<const Eigen::Vector3d>(c.obstacle_point_world_m) - x;
    dynamics::forward_kinematics(model, ws, loop.q);
    dynamics::Matrix3Xd J(3, 4);
    dynamics::point_jacobian(model, ws, link, x, J);
    const Eigen::Vector3d velocity = J * loop.v;
    if (rho.dot(velocity) <= 0.0) continue;
    ++turned;
    const Eigen::Vector3d axis = rho.cross(velocity).normalized();
    const double size = 3.0 * std::exp(std::acos(rho.dot(velocity) / (rho.norm() * velocity.norm())) - 1.0) /
                        rho.norm() / (1.0 + std::exp(rho.norm() - 5.0));
    Eigen::Matrix3d gamma;
    gamma << 0, -axis.z(), axis.y(), axis.z(), 0, -axis.x(), -axis.y(), axis.x(), 0;
    gamma *= size;
    const Eigen::Matrix3d M = dynamics::operational_inertia(model, ws, loop.q, J);
    neutral += J.transpose() * (0.5 * (M * gamma + gamma * M) * velocity);
    published += J.transpose() * (M * gamma * velocity);
  }
  REQUIRE(turned > 0);
  REQUIRE(loop.tick());
  CHECK((loop.gyroscopic_torque() - neutral).norm() < 1e-9 * neutral.norm());
  auto other = spatial(Json{{"k_p", 0}, {"k_v", 0}, {"variant", "published"}}, ball);
  other.q = loop.q;
  other.v = loop.v;
  REQUIRE(other.tick());
  CHECK((other.buffers.held_torque() - published).norm() < 1e-9 * published.norm());
}

TEST_CASE("head-on, a planar arm is turned about the plane's normal", "[gyro]") {
  // Stretched along x, turning as one about the root: the ball stands exactly in a sphere's way.
  auto loop =
      test::ArmLoop(plugin_file, Json::object(), test::planar4(), test::goal_52, {{{2.5 + 0.02, 0.4, 0.0}, 0.1}});
  loop.v << 1.0, 0.0, 0.0, 0.0;
  REQUIRE(loop.tick());
  REQUIRE(loop.buffers.gyroscopic().size() >= 1);
  for (const auto& term : loop.buffers.gyroscopic()) {
    CHECK(term.w_world[0] == Approx(0.0).margin(1e-15));
    CHECK(term.w_world[1] == Approx(0.0).margin(1e-15));
    CHECK(std::abs(term.w_world[2]) > 1e-3);
  }
}

TEST_CASE("head-on in space the side is defined and the same each time", "[gyro]") {
  const auto answer = [] {
    auto loop = spatial(Json{{"k_p", 0}, {"k_v", 0}}, {});
    loop.q << 0.3, -0.5, 0.8, 0.4;
    loop.v << 0.7, 0.2, -0.4, 0.5;
    // Put a ball straight ahead of the last link's sphere.
    const model::Model model(test::random_robot(11, 4), geometry::SE3{}, Eigen::Vector3d::Zero());
    dynamics::Workspace ws(model);
    dynamics::forward_kinematics(model, ws, loop.q);
    const Eigen::Vector3d center = dynamics::point_position(model, ws, 3, model.robot().links[3].spheres[0].center_m);
    Eigen::Vector3d ahead = dynamics::point_velocity(model, ws, 3, center, loop.v).normalized();
    // The surface point moves otherwise than the centre; a few rounds find the direction both agree on.
    for (int i = 0; i < 200; ++i)
      ahead = dynamics::point_velocity(model, ws, 3, center + 0.05 * ahead, loop.v).normalized();
    auto with_ball = spatial(Json{{"k_p", 0}, {"k_v", 0}}, {{center + 0.5 * ahead, 0.1}});
    with_ball.q = loop.q;
    with_ball.v = loop.v;
    REQUIRE(with_ball.tick());
    REQUIRE(!with_ball.buffers.gyroscopic().empty());
    const auto& term = with_ball.buffers.gyroscopic().back();
    return Eigen::Vector4d(term.link, term.w_world[0], term.w_world[1], term.w_world[2]);
  };
  const Eigen::Vector4d first = answer();
  CHECK(first[0] == 3.0);
  CHECK(first.allFinite());
  CHECK(first.tail<3>().norm() > 1e-6);
  CHECK(answer() == first);
}

TEST_CASE("at rest nothing turns and the goal pulls", "[gyro]") {
  auto loop = example_52(Json{{"k_p", 1}});
  loop.q << 0.8, 0.1, -0.1, 0.2;
  REQUIRE(loop.tick());
  REQUIRE(!loop.contacts().empty());
  CHECK(loop.buffers.gyroscopic().empty());
  CHECK(loop.buffers.held_torque().norm() > 1e-3);
}

TEST_CASE("Algorithm II lets go of the goal while turning, keep_attraction does not", "[gyro]") {
  for (const bool keep : {false, true}) {
    auto loop = example_52(Json{{"algorithm", keep ? "keep_attraction" : "published"}});
    loop.q << 0.6, 0.1, -0.1, 0.2;
    loop.v << 1.0, 0.0, 0.0, 0.0;
    REQUIRE(loop.tick());
    REQUIRE(!loop.buffers.gyroscopic().empty());
    CHECK((loop.buffers.held_torque().norm() > 0.0) == keep);
  }
}

TEST_CASE("a joint goal pulls every joint with k_p times its error", "[gyro]") {
  const Eigen::Vector4d to(0.5, -0.2, 0.1, 1.0), q(0.3, -0.5, 0.8, 0.4);
  test::ArmLoop loop(plugin_file, Json{{"k_p", 2}}, test::random_robot(11, 4), Eigen::Vector3d::Zero(), {},
                     Eigen::Vector3d::Zero(), to);
  loop.q = q;
  REQUIRE(loop.tick());
  const model::Model model(test::random_robot(11, 4), geometry::SE3{}, Eigen::Vector3d::Zero());
  dynamics::Workspace ws(model);
  Eigen::VectorXd a(4);
  dynamics::solve_mass(model, ws, q, loop.buffers.held_torque(), a);
  CHECK((a + 2.0 * (q - to)).norm() < 1e-12);
}

TEST_CASE("gyro does not allocate in a tick", "[gyro]") {
#ifndef HAMELIN_SANITIZED
  const std::string variant = GENERATE("published", "energy-neutral");
  auto loop = spatial(Json{{"variant", variant}}, three_balls);
  loop.v << 0.7, 0.2, -0.4, 0.5;
  REQUIRE(loop.tick());
  CHECK(test::allocations_in([&] { (void)loop.tick(); }) == 0);
#endif
}
