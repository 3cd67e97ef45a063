#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <catch2/catch.hpp>
#include <memory>

#include "hamelin/core/error.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/arm_loop.hpp"
#include "hamelin/test/robots.hpp"
#include "hamelin/test/single_tick.hpp"

using namespace hamelin;

namespace {

const std::string plugin_file = HAMELIN_TEST_PLUGIN_DIR "/apf.hamelin.so";

test::PublishedLoop example_52(Json params, const model::Robot& robot = test::planar4()) {
  return {plugin_file, std::move(params), robot, test::goal_52, test::ball_52};
}

/// A spatial arm of four joints among three balls, two of them near.
test::PublishedLoop spatial(Json params, const Eigen::Vector3d& gravity = Eigen::Vector3d::Zero()) {
  params["rho0_m"] = 5.0;
  return {plugin_file,      std::move(params), test::random_robot(11, 4),
          {0.3, 0.4, -0.2}, test::three_balls, gravity};
}

}  // namespace

TEST_CASE("apf rests far from the goal in example 5.2", "[apf]") {
  const auto result = example_52(Json::object()).run(40.0);
  CAPTURE(result.time_s, result.distance_m, result.speed_m_s, result.clearance_m);
  CHECK_FALSE(result.reached);
  CHECK(result.speed_m_s < 2e-3);
  CHECK(result.distance_m > 0.2);
  CHECK(result.clearance_m > 0.0);
}

TEST_CASE(
    "apf rests 1.32 m from the goal with the published measurement's gains and links as segments",
    "[apf]") {
  // Spheres of 2.5 mm side by side replace segments. The figure is from an independent
  // implementation.
  const auto result =
      example_52(Json{{"k_p", 29.5}, {"k_v", 19.9}, {"joint_damping", 2.07}, {"eta", 1.84}},
                 test::planar4(200, 0.0025))
          .run(40.0);
  CHECK_FALSE(result.reached);
  CHECK(result.speed_m_s < 2e-3);
  CHECK(result.distance_m == Approx(1.32).margin(0.01));
}

TEST_CASE("apf reaches the goal of example 5.2 when the ball is out of the way", "[apf]") {
  test::PublishedLoop loop(plugin_file, Json::object(), test::planar4(), test::goal_52,
                           {{{-3.0, -3.0, 0.0}, 0.25}});
  CHECK(loop.run(40.0).reached);
}

TEST_CASE("the gradient of apf's potential is the difference quotient of its value", "[apf]") {
  const auto [law, exponent] = GENERATE(table<std::string, double>(
      {{"khatib", 2.0}, {"wang2018", 1.0}, {"wang2018", 2.0}, {"wang2018", 3.5}}));
  const bool joint_goal = GENERATE(false, true);
  INFO(law << " " << exponent << " " << joint_goal);
  test::PublishedLoop loop(
      plugin_file,
      Json{{"mapping", "potential"},
           {"law", law},
           {"goal_exponent", exponent},
           {"joint_damping", 0},
           {"rho0_m", 5.0}},
      test::random_robot(11, 4), {0.3, 0.4, -0.2}, test::three_balls, Eigen::Vector3d::Zero(),
      joint_goal ? Eigen::VectorXd(Eigen::Vector4d(0.5, -0.2, 0.1, 1.0)) : Eigen::VectorXd());
  loop.q << 0.3, -0.5, 0.8, 0.4;
  REQUIRE(loop.tick());
  REQUIRE(loop.contacts().size() > 3);
  const Eigen::VectorXd gradient = loop.buffers.potential_gradient(), q = loop.q;
  REQUIRE(loop.buffers.raw().potential_J > 0.0);
  CHECK(loop.buffers.held_torque().isZero(0.0));
  const double step = 1e-5;
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    double value[2];
    for (const int side : {0, 1}) {
      loop.q = q;
      loop.q[i] += side == 0 ? -step : step;
      REQUIRE(loop.tick());
      value[side] = loop.buffers.raw().potential_J;
    }
    CHECK(gradient[i] == Approx((value[1] - value[0]) / (2.0 * step)).epsilon(1e-7));
  }
}

TEST_CASE("both mappings of wang2018 apply Ge and Cui's forces, as forces or as accelerations",
          "[apf]") {
  // docs/theory.md (9.9): F_rep1 = η (1/ρ − 1/ρ0) (1/ρ²) r^n away from the obstacle, at the link's
  // point; F_rep2 = (n/2) η (1/ρ − 1/ρ0)² r^(n−1) towards the goal, at the tip; r = |x_e − x_d|.
  const double n = GENERATE(1.0, 2.0, 3.0), eta = 2.0, rho0 = 5.0;
  CAPTURE(n);
  const Eigen::Vector3d goal(0.3, 0.4, -0.2);
  const model::Model model(test::random_robot(11, 4), geometry::SE3{}, Eigen::Vector3d::Zero());
  dynamics::Workspace ws(model);
  for (const std::string mapping : {"operational", "potential"}) {
    CAPTURE(mapping);
    auto loop = spatial(Json{
        {"law", "wang2018"}, {"goal_exponent", n}, {"eta", eta}, {"k_p", 0}, {"mapping", mapping}});
    loop.q << 0.3, -0.5, 0.8, 0.4;
    REQUIRE(loop.tick());
    dynamics::forward_kinematics(model, ws, loop.q);
    Eigen::VectorXd expected = Eigen::VectorXd::Zero(4);
    dynamics::Matrix3Xd J(3, 4);
    const auto add = [&](int link, const Eigen::Vector3d& x, const Eigen::Vector3d& f) {
      dynamics::point_jacobian(model, ws, link, x, J);
      const Eigen::Vector3d force =
          mapping == "operational"
              ? Eigen::Vector3d(dynamics::operational_inertia(model, ws, loop.q, J) * f)
              : f;
      expected += J.transpose() * force;
    };
    const Eigen::Vector3d tip = dynamics::tip_pose(model, ws).p(),
                          to_goal = (goal - tip).normalized();
    const double r = (goal - tip).norm();
    for (const auto& c : loop.contacts()) {  // one sphere per link, so each is its link's nearest
      const double s = 1.0 / c.distance_m - 1.0 / rho0;
      const Eigen::Vector3d away = Eigen::Map<const Eigen::Vector3d>(c.direction_world);
      add(c.shape, Eigen::Map<const Eigen::Vector3d>(c.arm_point_world_m),
          eta * s / (c.distance_m * c.distance_m) * std::pow(r, n) * away);
      add(model.robot().tip.link, tip, 0.5 * n * eta * s * s * std::pow(r, n - 1.0) * to_goal);
    }
    const Eigen::VectorXd got = mapping == "operational"
                                    ? loop.buffers.held_torque()
                                    : Eigen::VectorXd(-loop.buffers.potential_gradient());
    CHECK((got - expected).norm() < 1e-11 * expected.norm());
  }
}

TEST_CASE("below distance_min_m the repulsion is constant", "[apf]") {
  // A ball beside the middle of the last link; k_p is zero, so only the repulsion acts.
  const auto at = [](double x) {
    test::PublishedLoop loop(
        plugin_file,
        Json{{"mapping", "potential"}, {"k_p", 0}, {"rho0_m", 0.2}, {"distance_min_m", 0.05}},
        test::planar4(), test::goal_52, {{{3.5, x, 0.0}, 0.1}});
    REQUIRE(loop.tick());
    return std::pair(loop.buffers.raw().potential_J,
                     Eigen::VectorXd(loop.buffers.potential_gradient()));
  };
  const auto [far_value, far] = at(0.1 + 0.02 + 0.05);
  const auto [near_value, near] = at(0.1 + 0.02 + 0.01);
  const auto [inside_value, inside] = at(0.1 + 0.02 - 0.01);
  CHECK((near - far).norm() < 1e-9 * far.norm());
  CHECK((inside - far).norm() < 1e-9 * far.norm());
  // The value continues along that slope: V' = −η (1/ρ − 1/ρ0)/ρ², docs/theory.md (9.3).
  const double force = 13.0 * (1.0 / 0.05 - 1.0 / 0.2) / (0.05 * 0.05);
  CHECK(near_value - far_value == Approx(force * 0.04).epsilon(1e-9));
  CHECK(inside_value - far_value == Approx(force * 0.06).epsilon(1e-9));
}

TEST_CASE("gravity compensation holds the arm at rest, and can be switched off", "[apf]") {
  const Eigen::Vector3d gravity{1.0, -9.0, 2.0};
  auto with = spatial(Json{{"k_p", 0}, {"eta", 0}}, gravity);
  auto without = spatial(Json{{"k_p", 0}, {"eta", 0}, {"gravity_compensation", false}}, gravity);
  REQUIRE(with.tick());
  REQUIRE(without.tick());
  const model::Model model(test::random_robot(11, 4), geometry::SE3{}, gravity);
  dynamics::Workspace ws(model);
  Eigen::VectorXd expected(4);
  dynamics::gravity_torque(model, ws, Eigen::VectorXd::Zero(4), expected);
  CHECK((with.buffers.held_torque() - expected).norm() < 1e-12);
  CHECK(expected.norm() > 1.0);
  CHECK(without.buffers.held_torque().isZero(0.0));
}

TEST_CASE("the operational mapping accelerates the tip by the attraction, up to the damping of M_x",
          "[apf]") {
  // No repulsion, at rest, no gravity: the tip's acceleration is Λ⁻¹ M_x f with Λ⁻¹ = J M⁻¹ Jᵀ, and
  // M_x has the eigenvalues d/(d² + λ²), so each direction keeps the share d²/(d² + λ²) of f:
  // docs/theory.md (9.5).
  auto loop = spatial(Json{{"eta", 0}});
  loop.q << 0.3, -0.5, 0.8, 0.4;
  REQUIRE(loop.tick());
  const model::Model model(test::random_robot(11, 4), geometry::SE3{}, Eigen::Vector3d::Zero());
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, loop.q);
  const Eigen::Vector3d tip = dynamics::tip_pose(model, ws).p();
  dynamics::Matrix3Xd J(3, 4);
  dynamics::point_jacobian(model, ws, model.robot().tip.link, tip, J);
  Eigen::MatrixXd M(4, 4);
  dynamics::mass_matrix(model, ws, loop.q, M);
  const Eigen::MatrixXd inverse = M.inverse();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(
      Eigen::Matrix3d(J * inverse * J.transpose()));
  const Eigen::Array3d d2 = eigen.eigenvalues().array().square();
  const Eigen::Vector3d f = -11.0 * (tip - Eigen::Vector3d(0.3, 0.4, -0.2));
  const Eigen::Vector3d kept = (d2 / (d2 + 1e-6)).matrix();
  const Eigen::Vector3d expected =
      eigen.eigenvectors() * kept.asDiagonal() * eigen.eigenvectors().transpose() * f;
  const Eigen::Vector3d acceleration = J * inverse * loop.buffers.held_torque();
  CHECK((acceleration - expected).norm() < 1e-10 * f.norm());
  CHECK((expected - f).norm() < 0.1 * f.norm());
}

TEST_CASE("a joint goal attracts every joint with k_p times its error", "[apf]") {
  const Eigen::Vector4d to(0.5, -0.2, 0.1, 1.0), q(0.3, -0.5, 0.8, 0.4);
  const auto answer = [&](const char* mapping) {
    auto loop = std::make_unique<test::PublishedLoop>(
        plugin_file, Json{{"mapping", mapping}, {"k_p", 2}}, test::random_robot(11, 4),
        Eigen::Vector3d::Zero(), std::vector<test::Ball>{}, Eigen::Vector3d::Zero(), to);
    loop->q = q;
    REQUIRE(loop->tick());
    return loop;
  };
  const auto held = answer("operational");
  const model::Model model(test::random_robot(11, 4), geometry::SE3{}, Eigen::Vector3d::Zero());
  dynamics::Workspace ws(model);
  Eigen::VectorXd a(4);
  dynamics::solve_mass(model, ws, q, held->buffers.held_torque(), a);
  CHECK((a + 2.0 * (q - to)).norm() < 1e-12);
  const auto kicks = answer("potential");
  CHECK((kicks->buffers.potential_gradient() - 2.0 * (q - to)).norm() < 1e-14);
  CHECK(kicks->buffers.raw().potential_J == Approx((q - to).squaredNorm()).epsilon(1e-14));
}

TEST_CASE("wang2018's repulsion vanishes at the goal, khatib's does not", "[apf]") {
  const model::Robot robot = test::planar4();
  const Eigen::Vector4d q(0.4, 0.3, -0.2, 0.5);
  const model::Model model(robot, geometry::SE3{}, Eigen::Vector3d::Zero());
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, q);
  const Eigen::Vector3d tip = dynamics::tip_pose(model, ws).p();
  const auto torque = [&](const char* law, double exponent) {
    test::PublishedLoop loop(plugin_file, Json{{"law", law}, {"goal_exponent", exponent}}, robot,
                             tip, {{tip + Eigen::Vector3d(0.3, 0.3, 0.0), 0.1}});
    loop.q = q;
    REQUIRE(loop.tick());
    REQUIRE(!loop.contacts().empty());
    return loop.buffers.held_torque().norm();
  };
  CHECK(torque("wang2018", 2.0) < 1e-12);
  CHECK(torque("wang2018", 1.5) < 1e-4);  // |x_e − x_d| is 1e-16 or zero here
  CHECK(std::isfinite(torque("wang2018", 1.0)));
  CHECK(torque("khatib", 2.0) > 1.0);
}

TEST_CASE("apf does not allocate in a tick", "[apf]") {
  test::require_allocation_count();
  const std::string mapping = GENERATE("operational", "potential");
  auto loop = spatial(Json{{"mapping", mapping}, {"law", "wang2018"}});
  REQUIRE(loop.tick());
  CHECK(test::allocations_in([&] { (void)loop.tick(); }) == 0);
}

TEST_CASE("apf refuses parameters that contradict each other", "[apf]") {
  CHECK_THROWS_WITH(example_52(Json{{"rho0_m", 0.01}, {"distance_min_m", 0.1}}),
                    Catch::EndsWith("/distance_min_m: above rho0_m, expected at most rho0_m"));
  CHECK_THROWS_WITH(example_52(Json{{"mapping", "potentail"}}), Catch::Contains("/mapping"));
}

TEST_CASE("apf uses only the end of a path and the position of a pose, and ignores self contacts",
          "[apf]") {
  const std::string mapping = GENERATE("operational", "potential"),
                    law = GENERATE("khatib", "wang2018");
  const Json params{{"algorithm", "published"}, {"mapping", mapping}, {"law", law}};
  CAPTURE(params);
  test::check_ignores_path_and_self_contacts(plugin_file, params);
}

TEST_CASE("apf by default arrives beside two balls, and rests before one that is in its way",
          "[apf]") {
  const auto run = [](const std::vector<test::Ball>& balls) {
    // At this speed the points of the arm, which is 4 m long, can be stopped within 0.1 m.
    test::ArmLoop loop(plugin_file, Json{{"cruise_speed", 0.2}}, test::planar4(), {0.0, 4.0, 0.0},
                       balls, Eigen::Vector3d::Zero(), Eigen::Vector4d(1.5708, 0.0, 0.0, 0.0));
    return loop.run(20.0);
  };
  const auto free = run({{{-1.0, 1.0, 0.0}, 0.2}, {{1.0, -1.0, 0.0}, 0.2}});
  CAPTURE(free.distance_m, free.time_s);
  CHECK(free.reached);
  CHECK(free.clearance_m > 0.0);
  const auto held = run({{{2.0, 2.0, 0.0}, 0.2}});
  CAPTURE(held.clearance_m, held.distance_m, held.speed_m_s);
  CHECK_FALSE(held.reached);
  CHECK(held.clearance_m > 0.0);
  CHECK(held.speed_m_s < 0.01);
}

TEST_CASE("algorithm arm of apf does not allocate in a tick and detects its stalls itself",
          "[apf]") {
  test::require_allocation_count();
  test::ArmLoop loop(plugin_file, Json::object(), test::planar4(), test::goal_52,
                     {{{3.5, 0.14, 0.0}, 0.1}});
  loop.v << 0.5, 0.0, 0.0, 0.0;
  REQUIRE(loop.tick());
  REQUIRE(!loop.contacts().empty());
  CHECK(loop.buffers.raw().state == HAMELIN_PLANNER_DETECTS_STALLS);
  CHECK(test::allocations_in([&] { (void)loop.tick(); }) == 0);
}

TEST_CASE("apf repels within rho0_m by its parameters, null for those of the algorithm", "[apf]") {
  const auto push = [](const Json& params, double gap) {
    test::ArmLoop loop(plugin_file, params, test::planar4(), test::goal_52,
                       {{{3.5, gap + 0.12, 0.0}, 0.1}}, Eigen::Vector3d::Zero(),
                       Eigen::Vector4d(1.0, 0.0, 0.0, 0.0));
    REQUIRE(loop.tick());
    return Eigen::VectorXd(loop.buffers.held_torque());
  };
  const Eigen::VectorXd nothing = push(Json{{"eta", 0}}, 0.01);
  CHECK((push(Json{{"eta", nullptr}}, 0.01) - push(Json{{"eta", 1e-6}}, 0.01)).norm() == 0.0);
  CHECK((push(Json::object(), 0.01) - nothing).norm() > 1e-3);
  CHECK((push(Json::object(), 0.026) - nothing).norm() < 1e-9);
}
