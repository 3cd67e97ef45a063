#include "hamelin/test/allocations.hpp"

#include <Eigen/LU>
#include <catch2/catch.hpp>

#include "../src/memory.hpp"
#include "fixture.hpp"
#include "hamelin/test/random_mass.hpp"

using namespace hamelin;
using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::allocations_in;

namespace {

// Runs two searches to their ends, one after the other.
long allocations_of(hybrid::Search& search, const hamelin_goal& goal,
                    const hybrid::JointPath* path = nullptr) {
  const VectorXd start = test::below_ball();
  return allocations_in([&] {
    for (int again = 0; again < 2; ++again) {
      search.begin(goal, start, path, 0.0);
      while (!search.advance(6)) {
      }
    }
  });
}

test::Task round_ball(bool self_collision = true) {
  auto task = test::joint_task(test::above_ball(), test::ball_between);
  task.self_collision = self_collision;
  return task;
}

}  // namespace

TEST_CASE("the safety filter does not allocate", "[hybrid][allocation]") {
  test::require_allocation_count();
  Rng rng(1);
  const MatrixXd M = test::random_mass(rng, 7), W = M.inverse();
  const VectorXd a = test::random_numbers(rng, 7), low = VectorXd::Constant(7, -1.0),
                 high = VectorXd::Constant(7, 1.0);
  VectorXd x = test::random_numbers(rng, 7, 3.0);
  const VectorXd from = 0.1 * x;
  hybrid::SafetyFilter filter(7, 8);
  CHECK(allocations_in([&] {
          filter.begin(M, W);
          (void)filter.add_row(a, -0.1, -0.2);
          filter.set_box(low, high);
          filter.set_momentum_box(low, high);
          (void)filter.braking_room(a, from);
          (void)filter.project(x, 12);
        }) == 0);
}

TEST_CASE("a rollout does not allocate", "[hybrid][allocation]") {
  test::require_allocation_count();
  test::Scene scene(round_ball());
  const VectorXd start = test::below_ball(), to = test::above_ball();
  CHECK(allocations_in([&] {
          scene.rollout.begin(start, to, 100, 0.02);
          while (scene.rollout.step() == hybrid::Rollout::Step::moved) {
          }
          scene.rollout.begin(start, 100);
          while (scene.rollout.step() == hybrid::Rollout::Step::moved) {
          }
        }) == 0);
}

TEST_CASE("searches do not allocate", "[hybrid][allocation]") {
  test::require_allocation_count();
  SECTION("towards a joint goal") {
    test::Scene scene(round_ball());
    auto tree = scene.tree(3000);
    auto vias = scene.vias();
    CHECK(allocations_of(tree, scene.goal()) == 0);
    CHECK(tree.arrives());
    CHECK(allocations_of(vias, scene.goal()) == 0);
  }
  SECTION("towards a tip goal") {
    test::Scene scene(test::tip_task({0.45, 0.45, 0.0}, test::ball_between));
    auto tree = scene.tree(3000);
    auto vias = scene.vias();
    CHECK(allocations_of(tree, scene.goal()) == 0);
    CHECK(tree.arrives());
    CHECK(allocations_of(vias, scene.goal()) == 0);
  }
  SECTION("back to a path") {
    test::Scene scene(round_ball());
    hybrid::JointPath path(4, 2);
    path.add(test::below_ball());
    path.add(test::above_ball());
    auto tree = scene.tree(3000);
    auto vias = scene.vias();
    CHECK(allocations_of(tree, scene.goal(), &path) == 0);
    CHECK(allocations_of(vias, scene.goal(), &path) == 0);
  }
  SECTION("without a solution") {
    auto task = test::joint_task(VectorXd::Zero(4), test::ball_between);
    test::Scene scene(task);
    auto tree = scene.tree(1000);
    auto vias = scene.vias();
    CHECK(allocations_of(tree, scene.goal()) == 0);
    CHECK(tree.path().empty());
    CHECK(allocations_of(vias, scene.goal()) == 0);
  }
}

TEST_CASE("the memory of stalls does not allocate", "[hybrid][allocation]") {
  test::require_allocation_count();
  test::Scene scene(round_ball());
  hybrid::EscapeMemory memory(scene.setup, scene.box, 5);
  const VectorXd stall = test::below_ball(), goal = test::above_ball();
  CHECK(allocations_in([&] {
          for (int i = 0; i < 20; ++i)
            memory.next(
                stall, [&](const VectorXd& q) { return (q - goal).norm(); },
                [&](const VectorXd& q) { return scene.surroundings.is_clear(q, 0.01, 0.005); });
        }) == 0);
}
