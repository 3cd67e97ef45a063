// The parts of the planner, against results that are computed by hand or by brute force.
#include <atomic>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "../src/cost_to_go.hpp"
#include "../src/margins.hpp"
#include "../src/sampler.hpp"
#include "../src/spline.hpp"
#include "../src/tip_path.hpp"
#include "../src/weights.hpp"
#include "../src/workers.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/test/arm_loop.hpp"

using namespace hamelin;
using namespace hamelin::mppi;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

namespace {

constexpr Index dof = 2, count = 24;
constexpr double spacing = 0.05, speed = 2.0, acceleration = 8.0;

Task make_task() {
  Task task(dof, count, 16, Margins(dof, 0.01, 0.001, 0.003, 0.03));
  task.spacing_s = spacing;
  task.cruise_speed = speed;
  task.limits.speed = VectorXd::Constant(dof, speed * spacing);
  task.limits.change = VectorXd::Constant(dof, acceleration * spacing * spacing);
  task.limits.lower = VectorXd::Constant(dof, -0.4);
  task.limits.upper = VectorXd::Constant(dof, 0.9);
  task.noise = 0.5;
  task.seed = 7;
  task.path.add(Vector2d(0.0, 0.0));
  task.path.add(Vector2d(0.5, 0.0));
  task.path.add(Vector2d(0.5, 0.8));
  task.path_to = task.path.length();
  JointState start(dof);
  start.v << 0.6, -0.5;
  set_start(start, spacing, task.mean);
  Sampler::brake(task.limits, task.mean);
  task.best = task.mean;
  return task;
}

// All limits of docs/theory.md (15.3), and rest at the end.
void check_limits(const Task& task, const Rollouts& rollouts) {
  constexpr double rounding = 1e-12;
  for (Index lane = 0; lane < lane_count; ++lane) {
    MatrixXd p(dof, count);
    rollouts.get_lane(lane, p);
    CHECK(p.leftCols<3>() == task.mean.leftCols<3>());
    CHECK(p.col(count - 1) == p.col(count - 3));
    CHECK(p.col(count - 2) == p.col(count - 3));
    for (Index j = 0; j < dof; ++j)
      for (Index i = 3; i < count; ++i) {
        const double step = p(j, i) - p(j, i - 1), before = p(j, i - 1) - p(j, i - 2);
        REQUIRE(std::abs(step) <= task.limits.speed[j] + rounding);
        REQUIRE(std::abs(step - before) <= task.limits.change[j] + rounding);
        REQUIRE(p(j, i) >= task.limits.lower[j] - rounding);
        REQUIRE(p(j, i) <= task.limits.upper[j] + rounding);
      }
  }
}

}  // namespace

TEST_CASE("a cubic B-spline reproduces polynomials", "[mppi]") {
  // With the control points i², the spline is t² + 1/3, where t = i at the middle control point.
  MatrixXd points(1, 6);
  for (Index i = 0; i < 6; ++i) points(0, i) = static_cast<double>(i * i);
  JointState state(1);
  for (const double u : {0.0, 0.3, 1.0}) {
    evaluate(points, 2, u, 0.5, state);
    const double t = 3.0 + u;
    CHECK(state.q[0] == Approx(t * t + 1.0 / 3.0));
    CHECK(state.v[0] == Approx(2.0 * t / 0.5));
    CHECK(state.a[0] == Approx(2.0 / 0.25));
  }
}

TEST_CASE("a spline starts in the given state", "[mppi]") {
  JointState state(2), again(2);
  state.q << 0.3, -1.2;
  state.v << 0.7, 0.1;
  state.a << -3.0, 2.5;
  MatrixXd points = MatrixXd::Constant(2, 4, 9.0);  // the fourth point has no effect at the start
  set_start(state, 0.05, points);
  evaluate(points, 0, 0.0, 0.05, again);
  CHECK((again.q - state.q).norm() < 1e-14);
  CHECK((again.v - state.v).norm() < 1e-12);
  CHECK((again.a - state.a).norm() < 1e-10);
}

TEST_CASE("weights of costs are those of the definition", "[mppi]") {
  // exp(0) = 1, exp(−ln 2) = 1/2, exp(−ln 4) = 1/4: in sum 7/4.
  std::vector<double> costs{5.0 + 0.1 * std::log(2.0), 5.0, 5.0 + 0.1 * std::log(4.0)};
  const double effective = weights_of_costs(costs, 0.1);
  CHECK(costs[0] == Approx(2.0 / 7.0));
  CHECK(costs[1] == Approx(4.0 / 7.0));
  CHECK(costs[2] == Approx(1.0 / 7.0));
  CHECK(effective == Approx(49.0 / 21.0));
  std::vector<double> equal(8, 3.0);
  CHECK(weights_of_costs(equal, 0.1) == Approx(8.0));
}

TEST_CASE("steps leave room to brake before a position limit", "[mppi]") {
  StepLimits limits;
  limits.speed = VectorXd::Constant(1, 1.0);
  limits.change = VectorXd::Constant(1, 0.1);
  limits.lower = VectorXd::Constant(1, -10.0);
  limits.upper = VectorXd::Constant(1, 1.0);
  using One = Eigen::Array<double, 1, 1>;
  // At rest 0.3 before the limit, steps of 0.2 and 0.1 come to rest at it.
  CHECK(limits.limit<One>(0, One(0.9), One(0.7), One(0.2), 100.0)[0] == Approx(0.2));
  // Two steps are left after this one: 0.3, 0.2, 0.1 and then rest.
  CHECK(limits.limit<One>(0, One(0.9), One(-5.0), One(0.35), 2.0)[0] == Approx(0.3));
  // The second difference bounds in any case.
  CHECK(limits.limit<One>(0, One(0.9), One(-5.0), One(0.35), 100.0)[0] == Approx(0.45));
  CHECK(limits.limit<One>(0, One(-0.9), One(-5.0), One(0.35), 100.0)[0] == Approx(0.25));
}

TEST_CASE("all rollouts keep their limits and end at rest", "[mppi]") {
  const Task task = make_task();
  Sampler sampler(dof, count);
  Rollouts rollouts(dof, count);
  sampler.propose(task, rollouts);
  check_limits(task, rollouts);
  for (std::size_t block = 1; block < 20; ++block) {
    sampler.sample(task, block, rollouts);
    check_limits(task, rollouts);
  }
}

TEST_CASE("the basis of the noise adds up to one", "[mppi]") {
  const Sampler sampler(dof, count);
  for (Index i = 0; i < count; ++i) CHECK(sampler.basis(i).sum() == Approx(1.0));
}

TEST_CASE("the random numbers of a block depend on seed, plan and block only", "[mppi]") {
  Task task = make_task();
  Sampler first(dof, count), second(dof, count);
  Rollouts a(dof, count), b(dof, count);
  first.sample(task, 3, a);
  first.sample(task, 4, b);
  CHECK((a.points != b.points).any());
  second.sample(task, 3, b);
  CHECK((a.points == b.points).all());
  ++task.plan;
  second.sample(task, 3, b);
  CHECK((a.points != b.points).any());
}

TEST_CASE("following reaches the end of the path exactly", "[mppi]") {
  Task task = make_task();
  task.path.clear();
  task.path.add(Vector2d(0.0, 0.0));
  task.path.add(Vector2d(0.15, 0.1));
  task.path_to = task.path.length();
  task.mean.setZero();
  Sampler sampler(dof, count);
  Rollouts rollouts(dof, count);
  sampler.propose(task, rollouts);
  MatrixXd p(dof, count);
  rollouts.get_lane(Sampler::proposal_follow, p);
  CHECK((p.col(count - 1) - Vector2d(0.15, 0.1)).norm() < 1e-12);
}

TEST_CASE("the cost to go is the least over all places of the path", "[mppi]") {
  planning::JointPath path(2, 8);
  path.add(Vector2d(0.0, 0.0));
  path.add(Vector2d(1.0, 0.0));
  path.add(Vector2d(1.0, 2.0));
  CHECK(path.length() == Approx(3.0));
  CHECK(path.turn(1) == Approx(std::sqrt(2.0)));
  Rng rng(1);
  Vector2d at;
  for (int k = 0; k < 200; ++k) {
    const Vector2d q(rng.uniform(-1.0, 2.0), rng.uniform(-1.0, 3.0));
    const double from = rng.uniform(0.0, 2.0), to = from + rng.uniform(0.1, 1.0);
    double least = 1e9;
    VectorXd p(2);
    for (int i = 0; i <= 20000; ++i) {
      const double s = from + (to - from) * i / 20000.0;
      path.at(s, p);
      least = std::min(least, 3.0 - s + 3.0 * (q - p).norm());
    }
    const auto place = cost_to_go(path, q, from, to);
    CHECK(place.cost == Approx(least).margin(2e-4));
    CHECK(place.s >= from - 1e-12);
    CHECK(place.s <= to + 1e-12);
  }
}

TEST_CASE("margins are less at a tight goal and where the arm is", "[mppi]") {
  Margins margins(2, 0.01, 0.001, 0.003, 0.03);
  const Vector2d goal(1.0, 0.0), start(-1.0, 0.0), far(0.0, 3.0);
  CHECK(margins.required(goal).margin_m == 0.01);
  margins.set_goal(goal, 0.006);
  margins.set_start(start, 0.005);
  CHECK(margins.required(goal).margin_m == Approx(0.003));
  CHECK(margins.required(goal).range_m == Approx(0.006));
  CHECK(margins.required(start).margin_m == Approx(0.0048));
  CHECK(margins.required(start).range_m == Approx(0.03));
  CHECK(margins.required(far).margin_m == Approx(0.01));
  // Halfway between the distances 0.1 and 0.8 half of the reduction remains.
  CHECK(margins.required(Vector2d(1.45, 0.0)).margin_m == Approx(0.0065));
  margins.set_goal(goal, 0.5);
  CHECK(margins.required(goal).margin_m == Approx(0.01));
}

TEST_CASE("the path of the tip is that of the knots", "[mppi]") {
  const model::Model model(test::planar4(), geometry::SE3{}, Eigen::Vector3d::Zero());
  dynamics::Workspace ws(model);
  // The first joint turns by 0.1 per control point, so the tip is on a circle of radius 4.
  MatrixXd points = MatrixXd::Zero(4, 6);
  for (Index i = 0; i < 6; ++i) points(0, i) = 0.1 * static_cast<double>(i);
  std::vector<Eigen::Vector3d> tips(8);
  REQUIRE(tip_path(model, ws, points, tips) == 4);
  for (std::size_t i = 0; i < 4; ++i) {
    const double angle = 0.1 * static_cast<double>(i + 1);
    CHECK((tips[i] - Eigen::Vector3d(4.0 * std::cos(angle), 4.0 * std::sin(angle), 0.0)).norm() <
          1e-12);
  }
  CHECK(tip_path(model, ws, points, {tips.data(), 2}) == 2);
}

TEST_CASE("a path without length costs the distance from it", "[mppi]") {
  planning::JointPath path(2, 4);
  path.add(Vector2d(1.0, 0.0));
  path.add(Vector2d(1.0, 0.0));
  CHECK(cost_to_go(path, Vector2d(1.0, 2.0), 0.0, 2.0).cost == Approx(2.0));
}

TEST_CASE("workers do each unit once and wait for all", "[mppi][threads]") {
  std::vector<std::atomic<int>> done(100);
  {
    Workers workers(3, [&](int, int unit) { ++done[static_cast<std::size_t>(unit)]; });
    workers.wait();  // nothing was started
    for (int job = 1; job <= 50; ++job) {
      workers.start(100);
      workers.wait();
      for (const auto& n : done) REQUIRE(n == job);
    }
    workers.start(10);
  }  // the destructor waits for a job in work
  for (std::size_t i = 0; i < 10; ++i) CHECK(done[i] >= 50);
}
