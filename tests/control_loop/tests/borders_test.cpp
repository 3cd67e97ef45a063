// What a controller decides for itself, and what it answers where numbers cannot be used.
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "../loop.hpp"
#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using Catch::Contains;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::Loop;
using test::not_finite;
using test::refusal;
using test::sampled;

namespace {

bool all_finite(const control::Answer& answer) {
  return answer.torque.allFinite() && answer.q_next.allFinite() && answer.v_next.allFinite();
}

scene::Scene clutter() {
  return scene::read_scene(test::data_folder / "scenes/clutter.json");
}

/// Torques of the first ticks.
std::vector<VectorXd> torques(const scene::Scene& scene, int ticks) {
  Loop loop(scene);
  std::vector<VectorXd> out;
  for (int k = 0; k < ticks; ++k) {
    out.emplace_back(loop.tick().torque);
    loop.step(out.back());
  }
  return out;
}

}  // namespace

TEST_CASE("what a controller drives decides the bounds of safety, not the file of the scene",
          "[control][borders]") {
  // for a scene of ideal actuation, also if a program changes it afterwards
  scene::Scene as_read = clutter();
  as_read.actuation.type = scene::ActuationType::ideal;
  as_read.guide.type = scene::GuideType::none;  // nothing that takes its own time
  scene::Scene changed = as_read, stated = as_read;
  changed.actuation.type = stated.actuation.type = scene::ActuationType::sampled;
  stated.safety.tracking_rad = 2e-4;
  stated.safety.torque_share = 0.8;
  constexpr int ticks = 600;
  const auto expected = torques(stated, ticks);
  CHECK(torques(changed, ticks) == expected);
  CHECK(torques(as_read, ticks) == expected);

  Loop loop(as_read);
  for (int k = 0; k < 3000; ++k) {
    const VectorXd torque = loop.tick().torque;
    if (k == 700) loop.controller.stop("a request of the test");
    loop.step(torque);
  }
  REQUIRE(loop.controller.shield_report()->counts.refused > 1000);
  CHECK(loop.controller.shield_report()->counts.strayed > 0.0);
  CHECK(loop.controller.shield_report()->counts.strayed_share < 1.0);
}

TEST_CASE("a controller has a shield for what is added to an empty world", "[control][borders]") {
  scene::Scene scene = clutter();
  scene.map.reset();
  scene.obstacles.clear();
  scene.model.joint_limits = scene.model.velocity_limits = scene.model.self_collision = false;
  scene.safety.type.reset();
  scene.planner->name = "template";  // drives straight to its goal
  REQUIRE(scene::safety_type(scene) == scene::SafetyType::none);
  const auto nearest = [&](bool shielded) {
    scene::Scene chosen = scene;
    if (!shielded) chosen.safety.type = scene::SafetyType::none;
    Loop loop(chosen);
    CHECK((loop.controller.shield() != nullptr) == shielded);
    double least = 1.0;
    for (int k = 0; k < 3000; ++k) {
      if (k == 100) {  // on the way of the elbow and the hand
        scene::Obstacle ball;
        ball.name = "ball";
        ball.radius_m = 0.1;
        VectorXd half = 0.5 * (loop.state.q + scene.goals[0].q);
        dynamics::Workspace ws(loop.arm);
        dynamics::forward_kinematics(loop.arm, ws, half);
        ball.pose = {Eigen::Matrix3d::Identity(), dynamics::tip_pose(loop.arm, ws).p()};
        loop.controller.world().set_obstacle(ball);
      }
      loop.step(VectorXd(loop.tick().torque));
      if (k > 100) least = std::min(least, loop.controller.view().clearance_m());
    }
    return least;
  };
  CHECK(nearest(true) > 0.0);
  CHECK(nearest(false) < 0.0);
  control::Controller::Options fixed;
  fixed.fixed_world = true;
  CHECK(Loop(scene, fixed).controller.shield() == nullptr);
}

TEST_CASE("bounds that a program sets are checked as those of files", "[control][borders]") {
  scene::Scene scene = clutter();
  scene.safety.torque_share = 1.5;
  CHECK_THAT(refusal([&] { Loop{scene}; }), Contains("/safety/torque_share: 1.5, expected"));
  scene = clutter();
  scene.safety.mass_error = -0.1;
  CHECK_THAT(refusal([&] { Loop{scene}; }), Contains("/safety/mass_error: -0.1, expected 0 to 1"));
  scene = clutter();
  scene.actuation.delay_s = std::numeric_limits<double>::infinity();
  CHECK_THAT(refusal([&] { Loop{scene}; }), Contains("/actuation/delay_s: inf, expected 0 to 1"));
  for (const double period_s :
       {0.0, -0.001, not_finite, 1e9, std::numeric_limits<double>::infinity()}) {
    control::Controller::Options options;
    options.period_s = period_s;
    CHECK_THAT(refusal([&] { Loop(clutter(), options); }),
               Contains("period_s: ") && Contains("expected more than 0 and at most 1 s"));
  }
}

TEST_CASE("channels whose sum is not finite stop the arm, and what is sent stays finite",
          "[control][borders]") {
  const std::string how = GENERATE("huge", "huge velocity");
  const bool position = GENERATE(false, true);
  CAPTURE(how, position);
  scene::Scene scene = sampled("clutter.json");
  scene.planner->name = "breaking";
  control::Controller::Options options;
  options.position = position;
  Loop loop(scene, options, {{"at_tick", 100}, {"how", how}});
  VectorXd q = scene.start_q, v = VectorXd::Zero(7);
  for (int k = 0; k < 1500; ++k) {
    const control::Answer& answer = loop.controller.tick(0.001 * k, q, v);
    REQUIRE(all_finite(answer));
    REQUIRE((answer.state == control::ControlState::stopping) == (k >= 100));
    if (k >= 100) CHECK_THAT(std::string(answer.cause), Contains("the planner's channels"));
    if (position) {
      q = answer.q_next;
      v = answer.v_next;
    } else {
      loop.step(VectorXd(answer.torque));
      q = loop.state.q;
      v = loop.v;
    }
  }
  CHECK(v.lpNorm<Eigen::Infinity>() < 1e-3);
}

TEST_CASE("a time that is not finite or falls stops the arm, and hides no obstacle",
          "[control][borders]") {
  const double bad = GENERATE(not_finite, std::numeric_limits<double>::infinity(), 0.3, -5.0);
  CAPTURE(bad);
  scene::Scene scene = sampled("clutter.json");
  Loop loop(scene);
  scene::Obstacle ball;
  ball.name = "ball";
  ball.radius_m = 0.05;
  for (int k = 0; k < 2000; ++k) {
    const double time_s = k < 400 ? 0.001 * k : bad;
    if (k == 100) {
      ball.pose = {Eigen::Matrix3d::Identity(), loop.controller.tip().p() + Vector3d(0, 0.2, 0)};
      loop.controller.world().set_obstacle(ball);
    }
    const control::Answer& answer = loop.controller.tick(time_s, loop.state.q, loop.v);
    REQUIRE(all_finite(answer));
    CHECK((answer.state == control::ControlState::stopping) == (k >= 400));
    if (k == 400)
      CHECK_THAT(std::string(answer.cause), std::isfinite(bad)
                                                ? Contains("is before that of the last tick, 0.399")
                                                : Contains("time_s: is not finite"));
    if (const auto& verdict = loop.controller.verdict()) REQUIRE(verdict->certified);
    const double to_ball = (loop.controller.tip().p() - ball.pose.p()).norm();
    if (k > 100 && to_ball < 0.2) REQUIRE(loop.controller.view().clearance_m() < 0.2);
    loop.step(VectorXd(answer.torque));
  }
  CHECK(loop.v.lpNorm<Eigen::Infinity>() < 1e-3);
  // the first time of a new start may be any
  loop.controller.reset();
  CHECK(loop.controller.tick(-7.0, loop.state.q, loop.v).state != control::ControlState::stopping);
}

TEST_CASE("measurements that are missing, too large or of another size are refused or stop the arm",
          "[control][borders]") {
  const scene::Scene scene = sampled("clutter.json");
  const VectorXd zero = VectorXd::Zero(7);
  Loop loop(scene);
  for (const int size : {0, 3, 9}) {
    const VectorXd other = VectorXd::Zero(size);
    CHECK_THAT(refusal([&] { (void)loop.controller.tick(0.0, other, zero); }),
               Contains("values given, expected 7 each"));
    CHECK_THAT(refusal([&] { (void)loop.controller.tick(0.0, scene.start_q, other); }),
               Contains("values given, expected 7 each"));
  }
  CHECK_THAT(refusal([&] { (void)loop.controller.tick(not_finite, scene.start_q, zero); }),
             Contains("time_s: is not finite"));
  CHECK_THAT(
      refusal([&] { (void)loop.controller.tick(0.0, VectorXd::Constant(7, not_finite), zero); }),
      Contains("the measured q or v is not finite"));
  (void)loop.controller.tick(0.0, scene.start_q, zero);  // what was refused left nothing behind
  for (const double bad : {not_finite, 1e7, -1e300}) {
    VectorXd v = zero;
    v[4] = bad;
    const control::Answer& answer = loop.controller.tick(0.001, scene.start_q, v);
    CHECK(answer.state == control::ControlState::stopping);
    CHECK(all_finite(answer));
    loop.controller.reset();
    CHECK(loop.controller.tick(0.0, scene.start_q, zero).state == control::ControlState::running);
  }
}

TEST_CASE(
    "parameters that are set between the halves of a tick hold for a load attached there, too",
    "[control][borders]") {
  scene::Scene scene = sampled("clutter.json");
  const scene::Payload can = test::small_can();
  const auto fastest = [&](bool attaches) {
    Loop loop(scene, test::with_room());
    double most = 0.0;
    for (int k = 0; k < 1200; ++k) {
      loop.controller.observe(loop.state.time_s, loop.state.q, loop.v);
      if (k == 5) {
        if (attaches) loop.controller.attach(can, loop.state.q);
        loop.controller.set_planner_params({{"cruise_speed", 0.05}});
      }
      loop.controller.decide();
      loop.step(VectorXd(loop.controller.answer().torque));
      if (k > 5) most = std::max(most, loop.v.lpNorm<Eigen::Infinity>());
    }
    CHECK(loop.controller.answer().load == (attaches ? 1 : 0));
    return most;
  };
  const double without = fastest(false), with = fastest(true);
  CHECK(without < 0.5);
  CHECK(with < 2.0 * without);
}

TEST_CASE("why an arm is held is told for longer than the planner that failed exists",
          "[control][borders]") {
  scene::Scene scene = sampled("clutter.json");
  scene.planner->name = "breaking";
  Loop loop(scene, test::with_room(), {{"at_tick", 3}, {"how", "throw"}});
  for (int k = 0; k < 5; ++k) loop.step(VectorXd(loop.tick().torque));
  REQUIRE(loop.controller.answer().state == control::ControlState::stopping);
  const std::string cause(loop.controller.answer().cause);
  REQUIRE_FALSE(cause.empty());
  // each change makes a planner, and the second one frees the first planner
  for (int i = 0; i < 4; ++i) {
    if (i % 2 == 0)
      loop.controller.attach(test::small_can(), loop.state.q);
    else
      loop.controller.detach("can", loop.state.q);
    loop.step(VectorXd(loop.tick().torque));
  }
  CHECK(std::string(loop.controller.answer().cause) == cause);
}

TEST_CASE("a tick that refuses a load does not allocate", "[control][borders]") {
  test::require_allocation_count();
  scene::Scene scene = sampled("clutter.json");
  if (GENERATE(true, false)) scene.safety.type = scene::SafetyType::none;
  control::Controller::Options options;
  options.payload_reach_m = 0.5;
  options.payload_shapes_max = 4;
  Loop loop(scene, options);
  for (int k = 0; k < 5; ++k) loop.step(VectorXd(loop.tick().torque));
  scene::Payload anvil;
  anvil.name = "an anvil whose name is far too long for the memory of a short string";
  anvil.mass_kg = 60.0;
  anvil.inertia_kg_m2 = Eigen::Matrix3d::Identity();
  anvil.spheres.push_back({{0.0, 0.0, 0.05}, 0.02});
  scene::Obstacle post;
  post.name = "a post whose name is far too long for the memory of a short string, too";
  post.radius_m = 0.03;
  post.pose = {Eigen::Matrix3d::Identity(), loop.controller.tip() * Vector3d(0.0, 0.0, 0.05)};
  loop.controller.world().set_obstacle(post);
  loop.controller.attach(anvil, loop.state.q);
  const long made = test::allocations_in([&] { (void)loop.tick(); });
  CHECK(loop.controller.answer().refused_load == 1);
  CHECK_FALSE(loop.controller.answer().load_refusal.empty());
  CHECK(made == 0);
}
