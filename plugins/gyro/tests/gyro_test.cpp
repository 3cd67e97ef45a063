#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <memory>
#include <numbers>

#include "hamelin/core/error.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/arm_loop.hpp"
#include "hamelin/test/robots.hpp"
#include "hamelin/test/single_tick.hpp"

using namespace hamelin;

namespace {

const std::string plugin_file = HAMELIN_TEST_PLUGIN_DIR "/gyro.hamelin.so";

test::PublishedLoop example_52(Json params, const model::Robot& robot = test::planar4()) {
  return {plugin_file, std::move(params), robot, test::goal_52, test::ball_52};
}

test::PublishedLoop spatial(Json params, const std::vector<test::Ball>& balls) {
  params["rho0_m"] = 5.0;
  params["gravity_compensation"] = false;
  return {plugin_file, std::move(params), test::random_robot(11, 4), {0.3, 0.4, -0.2}, balls};
}

Eigen::Vector3d vec(const double (&x)[3]) {
  return {x[0], x[1], x[2]};
}

/// A contact of one link with one ball, computed without the planner's own helpers.
struct ReferenceContact {
  Eigen::Vector3d rho, velocity;  ///< unit vector to the obstacle; of the arm's point
  double distance;
  Eigen::Matrix3d M;
};

/// All contacts of an arm with one sphere per link, computed with separate kinematics.
std::vector<ReferenceContact> reference_contacts(test::PublishedLoop& loop,
                                                 const model::Robot& robot) {
  const model::Model model(robot, geometry::SE3{}, Eigen::Vector3d::Zero());
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, loop.q);
  std::vector<ReferenceContact> all;
  for (const auto& c : loop.contacts()) {
    dynamics::Matrix3Xd J(3, model.dof());
    dynamics::point_jacobian(model, ws, c.shape, vec(c.arm_point_world_m), J);
    ReferenceContact contact;
    contact.velocity = J * loop.v;
    contact.rho = -vec(c.direction_world);  // in contact the two points are interchanged
    contact.distance = c.distance_m;
    contact.M = dynamics::operational_inertia(model, ws, loop.q, J);
    all.push_back(contact);
  }
  return all;
}

/// A point mass in the plane, the setting of Chang and Marsden: two prismatic joints along x and y.
model::Robot point_mass() {
  model::Robot robot;
  robot.name = "point";
  for (int i = 0; i < 2; ++i) {
    model::Link link;
    link.name = i == 0 ? "x" : "y";
    link.parent = i - 1;
    link.joint.name = link.name;
    link.joint.type = model::JointType::prismatic;
    link.joint.screw << 0.0, 0.0, 0.0, i == 0 ? 1.0 : 0.0, i == 0 ? 0.0 : 1.0, 0.0;
    link.mass_kg = i == 0 ? 1e-6 : 1.0;
    link.inertia_kg_m2.setIdentity();
    if (i == 1) link.spheres.push_back({Eigen::Vector3d::Zero(), 0.05});
    robot.links.push_back(link);
  }
  robot.tip = {"tip", 1, geometry::SE3{}};
  return robot;
}

/// Runs data/scenes/paper_52_gyro.json as the program does.
log::Result run_52(const std::vector<std::string>& settings) {
  const std::filesystem::path file =
      std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/scenes/paper_52_gyro.json";
  Json document = read_json(file);
  for (const auto& setting : settings) scene::set_pointer(document, setting);
  return simulation::run(scene::scene_from_json(document, file.parent_path(), file.string()),
                         {HAMELIN_TEST_PLUGIN_DIR}, {});
}

}  // namespace

TEST_CASE("gyro arrives in example 5.2, where apf rests", "[gyro]") {
  const std::string variant = GENERATE("published", "energy-neutral", "chang-marsden", "garimella");
  const auto result = example_52(Json{{"variant", variant}}).run(40.0);
  CAPTURE(variant, result.time_s, result.distance_m, result.speed_m_s, result.clearance_m);
  CHECK(result.reached);
  CHECK(result.clearance_m > 0.0);
}

TEST_CASE(
    "gyro arrives in 3.7 s at 0.17 m with the published measurement's gains and links as segments",
    "[gyro]") {
  // Spheres of 2.5 mm side by side replace segments. The figures are from an independent
  // implementation.
  const auto result = example_52(Json{{"variant", "published"},
                                      {"k_p", 29.5},
                                      {"k_v", 19.9},
                                      {"joint_damping", 2.07},
                                      {"k_obs", 4.74}},
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
  // At one state the published torque has power, docs/theory.md (9.13), and the neutral one has
  // none.
  auto a = spatial(Json{{"variant", "published"}, {"k_p", 0}, {"k_v", 0}}, test::three_balls);
  auto b = spatial(Json{{"variant", "energy-neutral"}, {"k_p", 0}, {"k_v", 0}}, test::three_balls);
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

TEST_CASE("the neutral torque is Jᵀ ½(MΓ + ΓM) ẋ with the published Γ", "[gyro]") {
  // One ball; docs/theory.md (9.10), (9.11), (9.12), (9.14) are written out with matrices.
  const std::vector<test::Ball> ball{{{1.2, 0.4, 0.3}, 0.1}};
  auto loop = spatial(Json{{"k_p", 0}, {"k_v", 0}}, ball);
  loop.q << 0.3, -0.5, 0.8, 0.4;
  loop.v << 0.7, 0.2, -0.4, 0.5;
  const model::Model model(test::random_robot(11, 4), geometry::SE3{}, Eigen::Vector3d::Zero());
  dynamics::Workspace ws(model);
  const auto contacts = loop.contacts();
  Eigen::VectorXd neutral = Eigen::VectorXd::Zero(4), published = neutral;
  int turned = 0;
  for (const auto& c : contacts) {  // one sphere per link, so each is its link's nearest
    const int link = c.shape;
    const Eigen::Vector3d x = Eigen::Map<const Eigen::Vector3d>(c.arm_point_world_m);
    const Eigen::Vector3d rho = Eigen::Map<const Eigen::Vector3d>(c.obstacle_point_world_m) - x;
    dynamics::forward_kinematics(model, ws, loop.q);
    dynamics::Matrix3Xd J(3, 4);
    dynamics::point_jacobian(model, ws, link, x, J);
    const Eigen::Vector3d velocity = J * loop.v;
    if (rho.dot(velocity) <= 0.0) continue;
    ++turned;
    const Eigen::Vector3d axis = rho.cross(velocity).normalized();
    const double size =
        3.0 * std::exp(std::acos(rho.dot(velocity) / (rho.norm() * velocity.norm())) - 1.0) /
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
  // The arm is stretched along x and turns as one body about the root. The ball is exactly in the
  // way of the point at 2.5 m, up to rounding. With two coordinates of ρ zero, the rule for space
  // would choose x.
  const std::string variant = GENERATE("energy-neutral", "chang-marsden", "garimella");
  CAPTURE(variant);
  test::PublishedLoop loop(plugin_file, Json{{"variant", variant}}, test::planar4(25, 1e-10),
                           test::goal_52, {{{2.5, 0.4, 0.0}, 0.1}});
  loop.v << 1.0, 0.0, 0.0, 0.0;
  REQUIRE(loop.tick());
  REQUIRE(loop.buffers.gyroscopic().size() == 1);
  const Eigen::Vector3d w = vec(loop.buffers.gyroscopic()[0].w_world);
  CHECK(w.head<2>().norm() < 1e-15 * w.norm());
  CHECK(w.z() > 1e-3);
}

TEST_CASE("head-on in space the side is defined and the same each time", "[gyro]") {
  const std::string variant = GENERATE("energy-neutral", "chang-marsden", "garimella");
  CAPTURE(variant);
  const auto answer = [&] {
    auto loop = spatial(Json{{"k_p", 0}, {"k_v", 0}}, {});
    loop.q << 0.3, -0.5, 0.8, 0.4;
    loop.v << 0.7, 0.2, -0.4, 0.5;
    // Put a ball straight ahead of the last link's sphere.
    const model::Model model(test::random_robot(11, 4), geometry::SE3{}, Eigen::Vector3d::Zero());
    dynamics::Workspace ws(model);
    dynamics::forward_kinematics(model, ws, loop.q);
    const Eigen::Vector3d center =
        dynamics::point_position(model, ws, 3, model.robot().links[3].spheres[0].center_m);
    Eigen::Vector3d ahead = dynamics::point_velocity(model, ws, 3, center, loop.v).normalized();
    // The velocities of the surface point and the centre differ; a few iterations find a common
    // direction.
    for (int i = 0; i < 200; ++i)
      ahead = dynamics::point_velocity(model, ws, 3, center + 0.05 * ahead, loop.v).normalized();
    auto with_ball =
        spatial(Json{{"k_p", 0}, {"k_v", 0}, {"variant", variant}}, {{center + 0.5 * ahead, 0.1}});
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

TEST_CASE("at rest there is no steering and the goal attracts", "[gyro]") {
  const std::string variant = GENERATE("published", "energy-neutral", "chang-marsden", "garimella");
  CAPTURE(variant);
  auto loop = example_52(Json{{"k_p", 1}, {"variant", variant}});
  loop.q << 0.8, 0.1, -0.1, 0.2;
  REQUIRE(loop.tick());
  REQUIRE(!loop.contacts().empty());
  CHECK(loop.buffers.gyroscopic().empty());
  CHECK(loop.buffers.held_torque().norm() > 1e-3);
}

TEST_CASE("Algorithm II switches the attraction off while steering, keep_attraction does not",
          "[gyro]") {
  const std::string variant = GENERATE("energy-neutral", "chang-marsden", "garimella");
  CAPTURE(variant);
  for (const bool keep : {false, true}) {
    auto loop = example_52(
        Json{{"variant", variant}, {"algorithm", keep ? "keep_attraction" : "published"}});
    loop.q << 0.6, 0.1, -0.1, 0.2;
    loop.v << 1.0, 0.0, 0.0, 0.0;
    REQUIRE(loop.tick());
    REQUIRE(!loop.buffers.gyroscopic().empty());
    CHECK((loop.buffers.held_torque().norm() > 0.0) == keep);
  }
}

TEST_CASE("a joint goal attracts every joint with k_p times its error", "[gyro]") {
  const Eigen::Vector4d to(0.5, -0.2, 0.1, 1.0), q(0.3, -0.5, 0.8, 0.4);
  test::PublishedLoop loop(plugin_file, Json{{"k_p", 2}}, test::random_robot(11, 4),
                           Eigen::Vector3d::Zero(), {}, Eigen::Vector3d::Zero(), to);
  loop.q = q;
  REQUIRE(loop.tick());
  const model::Model model(test::random_robot(11, 4), geometry::SE3{}, Eigen::Vector3d::Zero());
  dynamics::Workspace ws(model);
  Eigen::VectorXd a(4);
  dynamics::solve_mass(model, ws, q, loop.buffers.held_torque(), a);
  CHECK((a + 2.0 * (q - to)).norm() < 1e-12);
}

TEST_CASE("gyro does not allocate in a tick", "[gyro]") {
  test::require_allocation_count();
  const std::string variant = GENERATE("published", "energy-neutral", "chang-marsden", "garimella");
  auto loop = spatial(Json{{"variant", variant}}, test::three_balls);
  loop.v << 0.7, 0.2, -0.4, 0.5;
  REQUIRE(loop.tick());
  CHECK(test::allocations_in([&] { (void)loop.tick(); }) == 0);
}

TEST_CASE("steering that is energy-neutral does no work at 200 random states", "[gyro]") {
  const std::string variant = GENERATE("energy-neutral", "chang-marsden", "garimella");
  CAPTURE(variant);
  auto loop = spatial(Json{{"variant", variant}}, test::three_balls);
  Rng rng(7);
  int terms = 0;
  for (int k = 0; k < 200; ++k) {
    loop.q = test::random_joints(rng, 4, 3.0);
    loop.v = test::random_joints(rng, 4, 2.0);
    REQUIRE(loop.tick());
    double size = 0.0;  // of the terms that cancel
    for (const auto& c : reference_contacts(loop, test::random_robot(11, 4)))
      size += c.velocity.squaredNorm();
    for (const auto& term : loop.buffers.gyroscopic()) {
      ++terms;
      size += vec(term.w_world).norm() * loop.v.squaredNorm();
    }
    CHECK(std::abs(loop.gyroscopic_torque().dot(loop.v)) <= 1e-13 * size);
  }
  CHECK(terms > 200);
}

TEST_CASE(
    "each neutral variant turns only approaching points, with its gain and away from the ball",
    "[gyro]") {
  const std::string variant = GENERATE("energy-neutral", "chang-marsden", "garimella");
  CAPTURE(variant);
  const model::Robot robot = test::random_robot(11, 4);
  const std::vector<test::Ball> ball{{{1.2, 0.4, 0.3}, 0.1}};
  auto loop = spatial(Json{{"variant", variant}, {"k_obs", 2.5}}, ball);
  Rng rng(8);
  int approaching = 0, receding = 0;
  for (int k = 0; k < 100; ++k) {
    loop.q = test::random_joints(rng, 4, 3.0);
    loop.v = test::random_joints(rng, 4, 2.0);
    const auto all = reference_contacts(loop, robot);
    REQUIRE(loop.tick());
    std::size_t at = 0;
    for (const auto& c : all) {
      const double cosine = c.rho.dot(c.velocity) / c.velocity.norm();
      if (cosine <= 0.0) {
        ++receding;
        continue;
      }
      ++approaching;
      REQUIRE(at < loop.buffers.gyroscopic().size());
      const Eigen::Vector3d w = vec(loop.buffers.gyroscopic()[at++].w_world);
      const double d = std::max(c.distance, 1e-3);
      const double gain = 2.5 * (variant == "chang-marsden" ? 1.0 / d
                                 : variant == "garimella" ? (1.0 / d - 1.0 / 5.0) * cosine * cosine
                                                          : std::exp(std::acos(cosine) - 1.0) / d /
                                                                (1.0 + std::exp(c.distance - 5.0)));
      const Eigen::Vector3d e = gain * c.rho.cross(c.velocity).normalized();
      const Eigen::Vector3d expected = 0.5 * (c.M.trace() * e - c.M * e);
      CHECK((w - expected).norm() <= 1e-9 * expected.norm());
      const Eigen::Vector3d force = w.cross(c.velocity);  // docs/theory.md (9.16)
      CHECK(force.dot(-c.rho) >= -1e-12 * force.norm());
      CHECK(std::abs(force.dot(c.velocity)) <= 1e-14 * force.norm() * c.velocity.norm());
    }
    CHECK(at == loop.buffers.gyroscopic().size());
  }
  CHECK(approaching > 50);
  CHECK(receding > 50);
}

TEST_CASE("outside rho0_m there is no steering, and the goal attracts", "[gyro]") {
  const std::string variant = GENERATE("published", "energy-neutral", "chang-marsden", "garimella");
  CAPTURE(variant);
  // The ball is in the way of link 4's only sphere, with a distance of 0.4 m between them.
  const auto held = [&](double rho0, double k_p) {
    test::PublishedLoop loop(
        plugin_file, Json{{"variant", variant}, {"rho0_m", rho0}, {"k_p", k_p}}, test::planar4(1),
        test::goal_52, {{{3.5, 0.4 + 0.02 + 0.1, 0.0}, 0.1}});
    loop.v << 1.0, 0.0, 0.0, 0.0;
    REQUIRE(loop.tick());
    CHECK(loop.buffers.gyroscopic().size() == (rho0 > 0.4 && variant != "published" ? 1U : 0U));
    return Eigen::VectorXd(loop.buffers.held_torque());
  };
  CHECK(held(0.401, 11.0) == held(0.401, 1.0));
  CHECK((held(0.399, 11.0) - held(0.399, 1.0)).norm() > 1.0);
}

TEST_CASE("garimella fades at rho0_m and towards tangential motion, chang-marsden jumps",
          "[gyro]") {
  // Link 4's only sphere moves at right angles to the link. |w| over the mass is the gain; the mass
  // is the same for both variants, so the ratio of |w| is the ratio of the gains.
  const auto turn = [](const char* variant, double gap, double bearing) {
    test::PublishedLoop loop(
        plugin_file, Json{{"variant", variant}}, test::planar4(1), test::goal_52,
        {{{3.5 + (gap + 0.12) * std::sin(bearing), (gap + 0.12) * std::cos(bearing), 0.0}, 0.1}});
    loop.q << 0.0, 0.0, 0.0, 0.0;
    loop.v << 1.0, 0.0, 0.0, 0.0;
    REQUIRE(loop.tick());
    return loop.buffers.gyroscopic().empty() ? 0.0
                                             : vec(loop.buffers.gyroscopic()[0].w_world).norm();
  };
  const double edge = 0.5;
  CHECK(turn("chang-marsden", edge - 1e-9, 0.3) > 1.0);
  CHECK(turn("garimella", edge - 1e-9, 0.3) < 1e-8 * turn("chang-marsden", edge - 1e-9, 0.3));
  CHECK(turn("garimella", edge - 1e-4, 0.3) ==
        Approx(10.0 * turn("garimella", edge - 1e-5, 0.3)).epsilon(0.01));
  // The surface point moves at slightly less than a right angle to the link; find the tangential
  // bearing.
  double low = 1.0, high = 2.0;
  for (int i = 0; i < 60; ++i)
    (turn("chang-marsden", 0.2, 0.5 * (low + high)) > 0.0 ? low : high) = 0.5 * (low + high);
  CHECK(high == Approx(std::numbers::pi / 2.0).margin(0.02));
  CHECK(turn("chang-marsden", 0.2, low - 1e-6) > 1.0);
  CHECK(turn("chang-marsden", 0.2, high + 1e-6) == 0.0);
  CHECK(turn("garimella", 0.2, low - 1e-6) < 1e-10);
  CHECK(turn("garimella", 0.2, low - 1e-2) ==
        Approx(100.0 * turn("garimella", 0.2, low - 1e-3)).epsilon(0.05));
}

TEST_CASE("a point mass passes the ball on any line, with the gain of Chang and Marsden",
          "[gyro]") {
  // π V_max with V_max from the energy at the start: ½ k_p 3² for a mass of 1 kg, so V_max = 3 m/s
  // at k_p = 1.
  const double offset = GENERATE(0.3, 0.1, 0.02, 1e-4, -0.1, -0.3);
  CAPTURE(offset);
  test::PublishedLoop loop(plugin_file,
                           Json{{"variant", "chang-marsden"},
                                {"algorithm", "keep_attraction"},
                                {"k_p", 1},
                                {"k_v", 1.5},
                                {"joint_damping", 0},
                                {"k_obs", 3.0 * std::numbers::pi}},
                           point_mass(), {3.0, 0.0, 0.0}, {{{1.5, 0.0, 0.0}, 0.4}});
  loop.q << 0.0, offset;
  const auto result = loop.run(60.0);
  CAPTURE(result.time_s, result.distance_m, result.clearance_m);
  CHECK(result.reached);
  CHECK(result.clearance_m > 0.0);
  CHECK(result.gyroscopic_work_J < 1e-12);
}

TEST_CASE(
    "paper_52_gyro.json ends as the README says, without contact and without work of the steering",
    "[gyro]") {
  const auto [variant, outcome] =
      GENERATE(table<std::string, log::Outcome>({{"published", log::Outcome::reached},
                                                 {"energy-neutral", log::Outcome::reached},
                                                 {"chang-marsden", log::Outcome::reached},
                                                 {"garimella", log::Outcome::timeout}}));
  const auto result = run_52({"/planner/params/variant=" + variant});
  INFO(variant << " " << result.time_s << " s, clearance " << result.min_clearance_m.value() << " "
               << result.cause);
  CHECK(result.outcome == outcome);
  CHECK(*result.min_clearance_m > 0.0);
  CHECK(result.certified_share == 1.0);
  CHECK(std::abs(result.gyroscopic_work_J) < 1e-13);
}

TEST_CASE("velocities whose squares underflow are turned, too", "[gyro]") {
  const std::string variant = GENERATE("published", "energy-neutral", "chang-marsden", "garimella");
  auto loop = example_52(Json{{"variant", variant}});
  loop.q << 0.6, 0.1, -0.1, 0.2;
  loop.v << 1e-200, 0.0, 0.0, 0.0;
  CAPTURE(variant);
  CHECK(loop.tick());
  CHECK(loop.buffers.gyroscopic().empty() == (variant == "published"));
}

TEST_CASE("gyro refuses parameters that contradict each other", "[gyro]") {
  CHECK_THROWS_WITH(example_52(Json{{"rho0_m", 0.01}, {"distance_min_m", 0.1}}),
                    Catch::EndsWith("/distance_min_m: above rho0_m, expected at most rho0_m"));
  CHECK_THROWS_WITH(example_52(Json{{"variant", "chang"}}), Catch::Contains("/variant"));
  CHECK_THROWS_WITH(example_52(Json{{"variant", "predicted"}}),
                    Catch::EndsWith("/variant: predicted needs algorithm arm, expected another "
                                    "variant"));
}

TEST_CASE("gyro uses only the end of a path and the position of a pose, and ignores self contacts",
          "[gyro]") {
  const std::string variant = GENERATE("published", "energy-neutral", "chang-marsden", "garimella");
  const Json params{{"variant", variant}, {"algorithm", "keep_attraction"}};
  CAPTURE(params);
  test::check_ignores_path_and_self_contacts(plugin_file, params);
}

TEST_CASE("algorithm arm of gyro turns approaching points without work and keeps the attraction",
          "[gyro]") {
  const std::string variant = GENERATE("energy-neutral", "chang-marsden", "garimella");
  CAPTURE(variant);
  test::ArmLoop loop(plugin_file, Json{{"variant", variant}}, test::planar4(), test::goal_52,
                     {{{3.5, 0.04 + 0.12, 0.0}, 0.1}});
  loop.v << 0.2, 0.0, 0.0, 0.1;
  REQUIRE(loop.tick());
  REQUIRE(!loop.buffers.gyroscopic().empty());
  CHECK(loop.buffers.held_torque().norm() > 1e-3);
  const Eigen::VectorXd torque = loop.gyroscopic_torque();
  CHECK(torque.norm() > 1e-4);
  CHECK(std::abs(torque.dot(loop.v)) < 1e-13 * torque.norm());
  CHECK(loop.buffers.raw().state == HAMELIN_PLANNER_DETECTS_STALLS);
  // Beyond rho0_m there is none, and none if the arm recedes.
  test::ArmLoop far(plugin_file, Json{{"variant", variant}, {"rho0_m", 0.03}}, test::planar4(),
                    test::goal_52, {{{3.5, 0.04 + 0.12, 0.0}, 0.1}});
  far.v = loop.v;
  REQUIRE(far.tick());
  CHECK(far.buffers.gyroscopic().empty());
  loop.v *= -1.0;
  REQUIRE(loop.tick());
  CHECK(loop.buffers.gyroscopic().empty());
}

TEST_CASE(
    "the gyroscopic terms of algorithm arm are chosen by k_obs, and its published form works "
    "through the held torque",
    "[gyro]") {
  const auto tick = [](Json params) {
    auto loop = std::make_unique<test::ArmLoop>(
        plugin_file, std::move(params), test::planar4(), test::goal_52,
        std::vector<test::Ball>{{{3.5, 0.04 + 0.12, 0.0}, 0.1}});
    loop->v << 0.2, 0.0, 0.0, 0.1;
    REQUIRE(loop->tick());
    return loop;
  };
  const auto one = tick({{"k_obs", 0.1}}), two = tick({{"k_obs", 0.2}}),
             none = tick({{"k_obs", 0}}),
             published = tick({{"k_obs", 0.1}, {"variant", "published"}});
  CHECK((two->gyroscopic_torque() - 2.0 * one->gyroscopic_torque()).norm() < 1e-9);
  CHECK(none->gyroscopic_torque().norm() == 0.0);
  CHECK(published->buffers.gyroscopic().empty());
  CHECK((published->buffers.held_torque() - none->buffers.held_torque()).norm() > 1e-4);
}

TEST_CASE("algorithm arm of gyro does not allocate in a tick", "[gyro]") {
  test::require_allocation_count();
  test::ArmLoop loop(plugin_file, Json::object(), test::planar4(), test::goal_52,
                     {{{3.5, 0.14, 0.0}, 0.1}});
  loop.v << 0.5, 0.0, 0.0, 0.0;
  REQUIRE(loop.tick());
  REQUIRE(!loop.buffers.gyroscopic().empty());
  CHECK(test::allocations_in([&] { (void)loop.tick(); }) == 0);
}
