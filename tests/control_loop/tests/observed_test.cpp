// Arms among obstacles whose poses are streamed, with noise and latency, as from a camera.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "../loop.hpp"
#include "hamelin/core/rng.hpp"

using namespace hamelin;
using Eigen::Vector3d;
using Eigen::VectorXd;
using test::Loop;

namespace {

constexpr double camera_period_s = 1.0 / 60.0, latency_s = 0.02, noise_m = 0.001;

VectorXd turned(double angle) {
  VectorXd q(7);
  q << angle, -0.3, 0.0, -2.0, 0.0, 1.7, 0.0;
  return q;
}

/// The arm turns about its base, from one side to the other and back, five times in all.
scene::Scene turning() {
  scene::Scene scene = test::sampled("clutter.json");
  scene.map.reset();
  scene.obstacles.clear();
  scene.start_q = turned(-0.9);
  scene.goals.clear();
  for (const double angle : {0.9, -0.9, 0.9, -0.9, 0.9})
    scene.goals.push_back(scene::joint_goal(turned(angle)));
  return scene;
}

/// A sphere that swings ±0.25 m across the middle of the tip's path.
scene::Obstacle crossing(const scene::Scene& scene, double period_s) {
  const model::Model arm = control::load_model(scene);
  dynamics::Workspace ws(arm);
  dynamics::forward_kinematics(arm, ws, turned(0.0));
  scene::Obstacle sphere;
  sphere.name = "hand";
  sphere.radius_m = 0.1;
  sphere.pose = {Eigen::Matrix3d::Identity(), dynamics::tip_pose(arm, ws).p()};
  sphere.motion = scene::SineMotion{{0.25, 0.0, 0.0}, period_s};
  return sphere;
}

/// Measures poses of an obstacle and passes them to a world when they are old.
class Camera {
 public:
  Camera(const scene::Obstacle& truth, std::uint64_t seed) : truth_(truth), rng_(seed) {}

  void pass_to(control::World& world, double now_s) {
    for (; camera_period_s * frame_ + latency_s <= now_s; ++frame_) {
      const double time_s = camera_period_s * frame_;
      geometry::SE3 pose = scene::motion_at(truth_, time_s).pose;
      const Vector3d noise(rng_.normal(), rng_.normal(), rng_.normal());
      pose = {pose.R(), pose.p() + noise_m * noise};
      world.observe_obstacle(truth_.name, {time_s, pose});
    }
  }

 private:
  scene::Obstacle truth_;
  Rng rng_;
  int frame_ = 0;
};

struct ObservedRun {
  bool reached = false;
  double time_s = 0.0;
  double clearance_m = 1.0;  ///< the least, from the true obstacle
};

ObservedRun run_among(const scene::Obstacle& truth, scene::Prediction prediction, bool observed,
                      std::uint64_t seed) {
  const scene::Scene scene = turning();
  Loop loop(scene);
  scene::Obstacle known = truth;
  known.motion.reset();
  known.prediction = prediction;
  known.speed_max_m_s = scene::max_speed(truth);
  loop.controller.world().set_obstacle(known);
  Camera camera(truth, seed);
  const scene::Environment alone(std::nullopt, {truth}, scene.base, 2.0, 0.5);
  dynamics::Workspace ws(loop.arm);
  scene::PlacedShapes placed(loop.arm);
  ObservedRun run;
  for (int k = 0; k < 60000 && !run.reached; ++k) {
    run.time_s = loop.state.time_s;
    if (observed) camera.pass_to(loop.controller.world(), run.time_s);
    const control::Answer& answer = loop.tick();
    run.reached = answer.state == control::ControlState::reached;
    dynamics::forward_kinematics(loop.arm, ws, loop.state.q);
    placed.place(loop.arm, ws);
    run.clearance_m = std::min(run.clearance_m, alone.clearance(placed.view(), run.time_s, 1.0));
    loop.step(answer.torque);
  }
  return run;
}

}  // namespace

TEST_CASE("an arm passes a swinging sphere of which it gets noisy poses, late",
          "[control][controller][hybrid][movers][tracking]") {
  const double period_s = GENERATE(3.0, 6.0);
  const auto prediction =
      GENERATE(scene::Prediction::constant_acceleration, scene::Prediction::constant_velocity,
               scene::Prediction::speed_bound);
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    CAPTURE(period_s, to_string(prediction), seed);
    const ObservedRun run = run_among(crossing(turning(), period_s), prediction, true, seed);
    CAPTURE(run.time_s, run.clearance_m);
    CHECK(run.reached);
    CHECK(run.clearance_m > 0.0);
  }
}

TEST_CASE("an arm that gets no poses of the swinging sphere touches it",
          "[control][controller][hybrid][movers][tracking]") {
  const ObservedRun run =
      run_among(crossing(turning(), 3.0), scene::Prediction::constant_acceleration, false, 1);
  CHECK(run.clearance_m < 0.0);
}
