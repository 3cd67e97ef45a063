#include "hamelin/reactive/rollout.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/test/reactive_scene.hpp"

using namespace hamelin;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Eigen::VectorXd;
using Step = reactive::Rollout::Step;

namespace {

struct Ended {
  Step step;
  int steps;
};

/// Runs a rollout to its end and calls `each` with every configuration that it moves to.
template <class Each>
Ended run(reactive::Rollout& rollout, Each&& each) {
  for (int steps = 0;; ++steps) {
    const Step step = rollout.step();
    if (step != Step::moved) return {step, steps};
    each(rollout.q());
  }
}

const auto nothing = [](const VectorXd&) {};

VectorXd random_joints(Rng& rng, double size) {
  VectorXd q(4);
  for (auto& x : q) x = rng.uniform(-size, size);
  return q;
}

}  // namespace

TEST_CASE("in free space a rollout arrives", "[reactive][rollout]") {
  test::ReactiveScene scene(test::joint_task(Vector4d(0.5, -0.4, 0.3, 0.2)));
  auto& rollout = scene.rollout;
  SECTION("at a joint vector") {
    const VectorXd to = Vector4d(1.0, -0.5, 0.7, 0.1);
    rollout.begin(VectorXd::Zero(4), to, 100, 0.01);
    const auto end = run(rollout, nothing);
    CHECK(end.step == Step::arrived);
    CHECK((rollout.q() - to).lpNorm<Eigen::Infinity>() < 0.01);
    // 2 rad/s in steps of 0.06 s
    CHECK(end.steps <= std::ceil(to.norm() / 0.12) + 1);
  }
  SECTION("at a joint goal, within the share of its tolerance") {
    rollout.begin(VectorXd::Zero(4), 100);
    CHECK(run(rollout, nothing).step == Step::arrived);
    CHECK((rollout.q() - Vector4d(0.5, -0.4, 0.3, 0.2)).lpNorm<Eigen::Infinity>() < 0.8 * 0.02);
  }
}

TEST_CASE("in free space a rollout takes the tip to its goal", "[reactive][rollout]") {
  test::ReactiveScene scene(test::tip_task({0.5, 0.5, 0.0}));
  const VectorXd start = Vector4d(0.1, 0.4, -0.3, 0.2);
  scene.rollout.begin(start, 300);
  CHECK(run(scene.rollout, nothing).step == Step::arrived);
  CHECK((scene.tip(scene.rollout.q()) - Vector3d(0.5, 0.5, 0.0)).norm() < 0.8 * 0.01);
  CHECK(scene.rollout.goal_distance(start) ==
        Approx(2.0 * (scene.tip(start) - Vector3d(0.5, 0.5, 0.0)).norm()));
}

TEST_CASE("a rollout ends after its number of steps", "[reactive][rollout]") {
  test::ReactiveScene scene(test::joint_task(VectorXd::Zero(4)));
  scene.rollout.begin(VectorXd::Zero(4), Vector4d(3.0, 0.0, 0.0, 0.0), 5, 0.01);
  int moved = 0;
  CHECK(run(scene.rollout, [&](const VectorXd&) { ++moved; }).step == Step::ended);
  CHECK(moved == 5);
}

TEST_CASE("a rollout keeps joint limits", "[reactive][rollout]") {
  auto task = test::joint_task(VectorXd::Zero(4));
  task.joint_limit = 1.0;
  test::ReactiveScene scene(task);
  scene.rollout.begin(VectorXd::Zero(4), Vector4d(2.0, -2.0, 0.5, 0.0), 100, 0.01);
  double most = 0.0;
  const auto end = run(scene.rollout, [&](const VectorXd& q) {
    most = std::max(most, q.lpNorm<Eigen::Infinity>());
  });
  CHECK(end.step == Step::ended);
  CHECK(most <= 1.0);
  CHECK(most > 0.95);
}

TEST_CASE("a rollout stops in front of a wall", "[reactive][rollout]") {
  // The wall is a large ball with its surface at x = 0.8.
  test::ReactiveScene scene(test::joint_task(VectorXd::Zero(4), {{{100.8, 0.0, 0.0}, 100.0}}));
  const VectorXd start = Vector4d(1.4, 0.0, 0.0, 0.0);
  REQUIRE(scene.clearance(start) > 0.1);
  scene.rollout.begin(start, VectorXd::Zero(4), 200, 0.02);
  double least = 1.0;
  const auto end =
      run(scene.rollout, [&](const VectorXd& q) { least = std::min(least, scene.clearance(q)); });
  CHECK(end.step == Step::ended);
  CHECK(end.steps < 200);
  CHECK(least > 0.0);
  // It stops at its margin, close to the wall.
  CHECK(scene.clearance(scene.rollout.q()) < 0.02);
}

TEST_CASE("configurations that a rollout keeps are never in contact",
          "[reactive][rollout][property]") {
  const bool to_goal = GENERATE(false, true);
  CAPTURE(to_goal);
  int arrived = 0, ended = 0, touched = 0;
  for (std::uint64_t seed = 1; seed <= 150; ++seed) {
    CAPTURE(seed);
    Rng rng(seed);
    std::vector<test::Ball> balls;
    for (int i = 0; i < 4; ++i) {
      // The range of the radius leaves the base free.
      const double at = rng.uniform(-3.0, 3.0), radius = rng.uniform(0.4, 0.95);
      balls.push_back(
          {Vector3d(radius * std::cos(at), radius * std::sin(at), 0.0), rng.uniform(0.05, 0.15)});
    }
    test::ReactiveScene scene(test::joint_task(random_joints(rng, 2.0), balls));
    VectorXd start = random_joints(rng, 2.0);
    while (scene.clearance(start) < 0.0) start = random_joints(rng, 2.0);
    if (to_goal)
      scene.rollout.begin(start, 60);
    else
      scene.rollout.begin(start, random_joints(rng, 2.0), 60, 0.05);
    // Only the last configuration can be in contact, and then it is reported.
    VectorXd last = start;
    bool clear = true;
    const auto end = run(scene.rollout, [&](const VectorXd& q) {
      clear = clear && scene.clearance(last) >= -0.002;
      last = q;
    });
    REQUIRE(clear);
    REQUIRE((scene.clearance(scene.rollout.q()) < -0.002) == (end.step == Step::touched));
    (end.step == Step::arrived ? arrived : end.step == Step::ended ? ended : touched)++;
  }
  CAPTURE(arrived, ended, touched);
  CHECK(arrived > 10);
  CHECK(ended > 10);
  CHECK(touched < 15);
}

TEST_CASE("a rollout that starts in contact reports it at once", "[reactive][rollout]") {
  test::ReactiveScene scene(test::joint_task(VectorXd::Zero(4), {{{0.5, 0.0, 0.0}, 0.1}}));
  scene.rollout.begin(VectorXd::Zero(4), 10);
  CHECK(scene.rollout.step() == Step::touched);
}
