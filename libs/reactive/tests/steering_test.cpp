#include "hamelin/reactive/steering.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/test/allocations.hpp"
#include "hamelin/test/reactive_scene.hpp"

using namespace hamelin;
using Eigen::VectorXd;
using reactive::Prediction;
using reactive::Steering;
using reactive::Turn;
using reactive::TurnKinds;

namespace {

Turn no_turn() {
  return {VectorXd::Zero(4)};
}

/// Runs a prediction to its end. @return the number of postures
int finish(Prediction& prediction) {
  int count = 1;
  while (prediction.step()) ++count;
  return count;
}

/// Follows the law with steering, as (10.39) without dynamics, for some ticks of 4 ms.
VectorXd follow(test::ReactiveScene& scene, Steering& steering, VectorXd q, int ticks) {
  reactive::Law law(scene.setup, scene.model, test::law_params);
  reactive::Glide glide(scene.setup, scene.model, scene.margins, scene.surroundings);
  const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(4, 4);
  Eigen::MatrixXd M = identity;
  dynamics::Workspace ws(scene.model);
  VectorXd u(4);
  for (int k = 0; k < ticks; ++k) {
    REQUIRE(glide.place(q, -1.0, 0.05));
    const double distance = law.distance(scene.model, glide.ws(), q, {&scene.goal()});
    steering.advance(0.004 * k, q, distance, scene.goal(), false);
    law.attract(scene.model, glide.ws(), q, {&scene.goal()}, u);
    dynamics::mass_matrix(scene.model, ws, q, M);
    steering.apply(M, u);
    glide.filter(law.margin_weight(scene.model, glide.ws(), q, scene.goal()), identity, identity,
                 u);
    q += 0.004 * u;
  }
  return q;
}

}  // namespace

TEST_CASE("a prediction arrives where nothing is in the way", "[reactive][prediction]") {
  test::ReactiveScene scene(test::joint_task(test::above_ball()));
  Prediction prediction(scene.setup, scene.model, test::law_params, scene.margins,
                        scene.surroundings);
  prediction.begin(test::below_ball(), scene.goal(), no_turn(), false);
  finish(prediction);
  CHECK(prediction.arrives());
  // 1.8 rad at the cruise speed of 2 rad/s
  CHECK(prediction.time_s() == Approx(0.9).margin(0.07));
}

TEST_CASE("a prediction ends where an obstacle balances the attraction", "[reactive][prediction]") {
  test::ReactiveScene scene(test::joint_task(test::above_ball(), test::ball_between));
  Prediction prediction(scene.setup, scene.model, test::law_params, scene.margins,
                        scene.surroundings);
  prediction.begin(test::below_ball(), scene.goal(), no_turn(), false);
  CHECK(finish(prediction) < 80);
  CHECK_FALSE(prediction.arrives());
  CHECK_FALSE(prediction.is_lost());
  CHECK(prediction.distance() == Approx((test::above_ball() - prediction.end()).norm()));
  CHECK(scene.clearance(prediction.end()) > 0.0);
  CHECK(scene.clearance(prediction.end()) < 0.03);

  // What holds the arm back is moved along the obstacle by either direction.
  Eigen::MatrixXd sideways = Eigen::MatrixXd::Zero(4, Prediction::sideways_max);
  const int count = prediction.sideways(sideways);
  REQUIRE(count >= 2);
  constexpr double step = 1e-5;
  const VectorXd q = prediction.end();
  for (int k = 0; k < count; ++k) {
    if (sideways.col(k).norm() < 1e-9) continue;  // out of the plane of a planar arm
    const VectorXd direction = sideways.col(k).normalized();
    const double rate =
        (scene.clearance(q + step * direction) - scene.clearance(q - step * direction)) /
        (2.0 * step);
    CHECK(std::abs(rate) < 0.15);
  }
}

TEST_CASE("steering leads an arm around an obstacle that stops it", "[reactive][steering]") {
  test::ReactiveScene scene(test::joint_task(test::above_ball(), test::ball_between));
  const auto left = [&](const VectorXd& q) { return (test::above_ball() - q).norm(); };
  Steering idle(scene.planner_host(), scene.setup, scene.model, test::law_params, scene.margins,
                {TurnKinds::all, 0});
  CHECK(left(follow(scene, idle, test::below_ball(), 2500)) > 0.5);
  const auto kinds = GENERATE(TurnKinds::tangents, TurnKinds::axes, TurnKinds::all);
  Steering steering(scene.planner_host(), scene.setup, scene.model, test::law_params, scene.margins,
                    {kinds});
  CHECK(left(follow(scene, steering, test::below_ball(), 2500)) < 0.02);
  CHECK(steering.arrives());
}

TEST_CASE("steering depends on counts and seed alone, and does not allocate",
          "[reactive][steering]") {
  test::ReactiveScene scene(test::joint_task(test::above_ball(), test::ball_between));
  const auto run = [&] {
    Steering steering(scene.planner_host(), scene.setup, scene.model, test::law_params,
                      scene.margins, {});
    return follow(scene, steering, test::below_ball(), 700);
  };
  CHECK(run() == run());

  Steering steering(scene.planner_host(), scene.setup, scene.model, test::law_params, scene.margins,
                    {});
  const VectorXd q = test::below_ball();
  const long allocations = test::allocations_in([&] {
    for (int k = 0; k < 500; ++k) steering.advance(0.004 * k, q, 1.8, scene.goal(), false);
  });
  CHECK(allocations == 0);  // zero, too, in builds that do not count them
  CHECK(steering.units() > 500);
}

TEST_CASE("steering tells when all that it knows was in vain", "[reactive][steering]") {
  // A wall of balls around a goal that is behind them.
  test::Task task = test::joint_task(Eigen::Vector4d(1.2, 0.0, 0.0, 0.0));
  for (int k = 0; k < 12; ++k)
    task.balls.push_back({{0.15 + 0.09 * k, 0.35 + 0.01 * k, 0.0}, 0.06});
  test::ReactiveScene scene(task);
  Steering steering(scene.planner_host(), scene.setup, scene.model, test::law_params, scene.margins,
                    {});
  CHECK(steering.looks_in_vain() == 0);
  const VectorXd q = VectorXd::Zero(4);
  for (int k = 0; k < 20000; ++k) steering.advance(0.004 * k, q, 1.2, scene.goal(), false);
  CHECK(steering.looks_in_vain() > 20);
  CHECK(steering.in_vain_since_s() == 0.0);
  steering.restart();
  CHECK(steering.looks_in_vain() == 0);
}
