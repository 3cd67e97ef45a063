#include "shield/mover_check.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/robots.hpp"
#include "shield/move_time.hpp"
#include "shield/shield.hpp"

using namespace hamelin;
using control::FailSafe;
using control::MoverCheck;
using control::MoverProof;
using control::Shield;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

scene::Obstacle swinging_ball(const Vector3d& middle, const Vector3d& amplitude, double period_s) {
  scene::Obstacle ball;
  ball.name = "ball";
  ball.radius_m = 0.06;
  ball.pose = {Eigen::Matrix3d::Identity(), middle};
  ball.motion = scene::SineMotion{amplitude, period_s};
  return ball;
}

scene::Obstacle turning_box(const Vector3d& middle) {
  const double s = std::sqrt(0.5);
  scene::Obstacle box;
  box.name = "box";
  box.shape = scene::Shape::box;
  box.size_m = {0.4, 0.06, 0.06};
  box.prediction = scene::Prediction::path;
  box.motion = scene::WaypointMotion{std::make_shared<const scene::WaypointPath>(
      std::vector<scene::Waypoint>{{0.0, middle, {1.0, 0.0, 0.0, 0.0}},
                                   {1.0, middle, {s, 0.0, 0.0, s}},
                                   {2.0, middle, {0.0, 0.0, 0.0, 1.0}}},
      scene::WaypointPath::Options{}, "test")};
  return box;
}

scene::Scene arm7_scene(std::vector<scene::Obstacle> obstacles) {
  scene::Scene scene = scene::read_scene(HAMELIN_SOURCE_DIR "/data/scenes/shelf.json");
  scene.map.reset();
  scene.obstacles = std::move(obstacles);
  return scene;
}

/// A fail-safe motion from a random state with a move.
FailSafe random_motion(const model::Model& model, Rng& rng, bool moves) {
  const VectorXd q = test::random_within_limits(model, rng),
                 v = test::random_joints(rng, model.dof(), 1.5);
  FailSafe motion(model.dof());
  motion.set_stop(q, v, VectorXd::Zero(model.dof()), {6.0, 0.0, 0.0});
  if (moves) motion.set_move(motion.stop().end() + test::random_joints(rng, model.dof(), 0.4), 0.5);
  return motion;
}

}  // namespace

TEST_CASE("a fail-safe motion is smooth where its move begins, and ends at its target",
          "[shield]") {
  const VectorXd q = VectorXd::LinSpaced(3, -1.0, 1.0), v = VectorXd::LinSpaced(3, 0.5, -1.5),
                 target = VectorXd::LinSpaced(3, 0.3, 0.7);
  FailSafe motion(3);
  motion.set_stop(q, v, VectorXd::Zero(3), {8.0, 0.0, 0.0});
  motion.set_move(target, 0.4);
  VectorXd at(3), rate(3), before(3), rate_before(3);
  motion.at(0.0, before, rate_before);
  CHECK((before - q).norm() < 1e-14);
  const int steps = 20000;
  const double h = motion.duration_s() / steps;
  double fastest = 0.0, hardest = 0.0;
  for (int k = 1; k <= steps; ++k) {
    motion.at(k * h, at, rate);
    CHECK((at - before - 0.5 * h * (rate + rate_before)).norm() < 1e-9);
    if (k * h > motion.stop_s() + h) {
      fastest = std::max(fastest, rate.norm());
      hardest = std::max(hardest, (rate - rate_before).norm() / h);
    }
    before = at;
    rate_before = rate;
  }
  CHECK((at - target).norm() < 1e-12);
  CHECK(rate.norm() < 1e-12);
  const double way = motion.way().norm();
  CHECK(fastest == Approx(FailSafe::peak_velocity * way / 0.4).epsilon(1e-4));
  CHECK(hardest == Approx(FailSafe::peak_acceleration * way / 0.16).epsilon(1e-3));
}

TEST_CASE("the torques of a move reach their limits and do not pass them", "[shield]") {
  const scene::Scene scene = arm7_scene({});
  const model::Model model = control::load_model(scene);
  control::MoveTime::Limits limits;
  limits.effort_max =
      0.8 * control::joint_limits(model.robot(), &model::Joint::effort_max, infinity);
  control::MoveTime time(model, limits);
  dynamics::Workspace ws(model);
  Rng rng(7);
  for (int i = 0; i < 100; ++i) {
    const VectorXd q = test::random_within_limits(model, rng),
                   way = test::random_joints(rng, model.dof(), 0.5);
    const auto found = time.find(q, way);
    if (!found) continue;
    const auto used = [&](double duration) {
      double most = 0.0;
      VectorXd tau(model.dof());
      for (int k = 0; k <= 200; ++k) {
        const auto at = FailSafe::profile(k / 200.0);
        dynamics::inverse_dynamics(model, ws, q + at.position * way, at.velocity / duration * way,
                                   at.acceleration / (duration * duration) * way, tau);
        most = std::max(most, (tau.array().abs() / limits.effort_max.array()).maxCoeff());
      }
      return most;
    };
    CHECK(used(*found) < 1.06);  // between the eight points, too
    CHECK(used(0.8 * *found) > 1.0);
  }
}

TEST_CASE("what is proved clear of moving obstacles is clear by dense sampling", "[shield]") {
  scene::Obstacle ball = swinging_ball({0.4, 0.0, 0.5}, {0.0, 0.25, 0.1}, 3.0);
  const scene::Scene scene = arm7_scene({ball, turning_box({0.3, 0.3, 0.6})});
  const model::Model model = control::load_model(scene);
  const scene::Environment environment = scene::make_environment(scene, model, 0.2);
  const scene::Levers levers(model, nullptr);
  MoverCheck check(model, levers);
  dynamics::Workspace ws(model);
  scene::PlacedShapes arm(model);
  const std::vector<int> movers{0, 1};
  Rng rng(11);
  VectorXd q(model.dof()), v(model.dof());
  const auto smallest = [&](const FailSafe& motion, double now_s, double until_s) {
    double least = MoverCheck::far_m;
    for (int k = 0; k <= 1000; ++k) {
      const double ahead = until_s * k / 1000.0;
      motion.at(ahead, q, v);
      dynamics::forward_kinematics(model, ws, q);
      arm.place(model, ws);
      least = environment.clearance(arm.view(), {now_s, ahead}, least, scene::View::judge, {},
                                    scene::Among::moving);
    }
    return least;
  };
  int proved = 0, refuted = 0, open = 0;
  for (int start = 0; start < 150; ++start) {
    FailSafe motion = random_motion(model, rng, start % 2 == 0);
    // the later checks of a motion rest on what is remembered of the earlier ones
    for (int step = 0; step < 4; ++step) {
      const double now = 0.01 * start + 0.002 * step;
      const auto proof = check.check(ws, {environment, now, 0.0, movers}, motion, 0.0, 1.0, 0.005);
      const double least = smallest(motion, now, 1.0);
      if (proof.clear_s > 0.0) CHECK(proof.least_m <= smallest(motion, now, proof.clear_s));
      if (proof.clear_s >= 1.0) {
        ++proved;
        CHECK(least > 0.005);
      } else {
        ++(least <= 0.005 ? refuted : open);
      }
    }
  }
  CHECK(proved > 100);
  CHECK(refuted > 50);
  CHECK(open < 0.1 * proved);  // clear, but not proved
}

TEST_CASE("an arm at rest leaves the way of an obstacle that comes", "[shield]") {
  // The ball comes at constant speed to where the hand is; nobody asks the arm to move.
  scene::Scene scene = arm7_scene({});
  const model::Model bare = control::load_model(scene);
  dynamics::Workspace ws(bare);
  const VectorXd q = scene.start_q;
  dynamics::forward_kinematics(bare, ws, q);
  scene::PlacedShapes arm(bare);
  arm.place(bare, ws);
  const Vector3d hand = arm.view().centers[arm.view().size() - 1];
  scene::Obstacle ball;
  ball.name = "ball";
  ball.radius_m = 0.06;
  ball.pose = {Eigen::Matrix3d::Identity(), hand + Vector3d(0.0, 0.0, 0.8)};
  ball.motion = scene::LinearMotion{{0.0, 0.0, -0.4}, 0.0, 4.0};
  ball.prediction = scene::Prediction::constant_velocity;
  scene.obstacles = {ball};
  scene.safety.type = scene::SafetyType::shield;
  scene.safety.torque_share = 0.8;
  const scene::Environment environment = scene::make_environment(scene, bare, 0.2);
  Shield shield(scene, bare, nullptr, 0.001, {});
  const VectorXd zero = VectorXd::Zero(bare.dof());
  Shield::Surroundings world{environment, 0, 0.0};
  shield.start(world, {q, zero});
  VectorXd at = q, v = zero, next_q(bare.dof()), next_v(bare.dof());
  double least = 1.0;
  bool moved = false;
  const auto step = [&](int k) {
    world.time_s = 0.001 * k;
    const Shield::Node here{at, v};
    const VectorXd& hold = here.q;  // the planner stays
    if (shield.accept(world, {here, v, {hold, zero}, zero, zero, zero})) {
      v = zero;
    } else {
      shield.stop().point(next_q, next_v);
      at = next_q;
      v = next_v;
      moved = moved || shield.stop().motion().moves();
    }
    dynamics::forward_kinematics(bare, ws, at);
    arm.place(bare, ws);
    least = environment.clearance(arm.view(), world.time_s + 0.001, least);
  };
  const auto made = test::allocations_in([&] {
    for (int k = 0; k < 2500; ++k) step(k);
  });
  if (test::counts_allocations()) CHECK(made == 0);
  CHECK(moved);
  CHECK(least > 0.0);
  CHECK(shield.counts().evasions >= 1);
  // without the evasion the ball would have gone through the hand
  dynamics::forward_kinematics(bare, ws, q);
  arm.place(bare, ws);
  CHECK(environment.clearance(arm.view(), 2.0, 1.0) < 0.0);
}

TEST_CASE("of an obstacle of bounded speed it is proved that the arm rests when it is touched",
          "[shield]") {
  scene::Scene scene = arm7_scene({});
  const model::Model model = control::load_model(scene);
  dynamics::Workspace ws(model);
  scene::PlacedShapes arm(model);
  dynamics::forward_kinematics(model, ws, scene.start_q);
  arm.place(model, ws);
  const Vector3d hand = arm.view().centers[arm.view().size() - 1];
  scene::Obstacle ball = swinging_ball(hand + Vector3d(0.0, 0.3, 0.0), {0.0, 0.1, 0.0}, 3.0);
  ball.prediction = scene::Prediction::speed_bound;
  ball.speed_max_m_s = 0.25;
  scene.obstacles = {ball};
  scene.safety.type = scene::SafetyType::shield;
  const scene::Environment environment = scene::make_environment(scene, model, 0.2);
  const scene::Levers levers(model, nullptr);
  MoverCheck check(model, levers);
  const std::vector<int> movers{0};
  // The hand moves towards the ball, or away from it, and takes long to stop.
  VectorXd towards(model.dof());
  dynamics::forward_kinematics(model, ws, scene.start_q);
  dynamics::point_jacobian_transpose(model, ws, model.shapes().back().link, hand, Vector3d::UnitY(),
                                     towards);
  towards /= towards.norm();
  const auto retreats = [&](double speed, double rate) {
    FailSafe motion(model.dof());
    motion.set_stop(scene.start_q, speed * towards, VectorXd::Zero(model.dof()), {rate, 0.0, 0.0});
    return check.retreats(ws, {environment, 0.0, 0.0, movers}, motion, 0.0, motion.duration_s(),
                          0.005);
  };
  CHECK(retreats(0.05, 10.0));      // rests long before the ball can be there
  CHECK_FALSE(retreats(0.5, 1.0));  // meets it on the way
  CHECK(retreats(-0.5, 1.0));       // goes away from it
}
