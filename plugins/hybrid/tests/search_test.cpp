#include <catch2/catch.hpp>

#include "fixture.hpp"

using namespace hamelin;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Eigen::VectorXd;
using hybrid::JointPath;
using hybrid::Roots;

namespace {

/// Runs a search to its end with some units per tick. @return the number of ticks
int finish(hybrid::Search& search, int units = 6) {
  for (int ticks = 1;; ++ticks) {
    const long before = search.units();
    const bool ended = search.advance(units);
    REQUIRE(search.units() - before <= units);
    if (ended) return ticks;
    REQUIRE(search.units() - before == units);
    REQUIRE(ticks < 100000);
  }
}

JointPath polyline(const MatrixXd& points) {
  JointPath path(points.rows(), points.cols());
  for (Eigen::Index i = 0; i < points.cols(); ++i) path.add(points.col(i));
  return path;
}

bool same(const JointPath& a, const JointPath& b) {
  if (a.size() != b.size()) return false;
  for (Eigen::Index i = 0; i < a.size(); ++i)
    if (a.point(i) != b.point(i)) return false;
  return true;
}

// A sweep of the first joint from −0.9 to 2.2, through the ball.
MatrixXd blocked_sweep() {
  MatrixXd path = MatrixXd::Zero(4, 2);
  path(0, 0) = -0.9;
  path(0, 1) = 2.2;
  return path;
}

/// The largest |angle| of the first joint at which the stretched arm is nearer to the ball than
/// `clear`.
double blocked_until(test::Scene& scene, double clear) {
  double inside = 0.0, outside = 1.5;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (inside + outside);
    (scene.clearance(Vector4d(middle, 0.0, 0.0, 0.0)) > clear ? outside : inside) = middle;
  }
  return outside;
}

}  // namespace

// ---- roots

TEST_CASE("the root of a joint goal is the goal", "[hybrid][roots]") {
  test::Scene scene(test::joint_task(test::above_ball(), test::ball_between));
  scene.roots.begin(scene.goal(), test::below_ball(), nullptr, 0.0);
  REQUIRE(scene.roots.done());
  REQUIRE(scene.roots.count() == 1);
  CHECK(scene.roots.q(0) == test::above_ball());
  Rng rng(1);
  CHECK(scene.roots.advance(100, rng) == 0);
}

TEST_CASE("roots of a tip goal reach it, are clear of obstacles and sorted by distance",
          "[hybrid][roots]") {
  const bool self = GENERATE(false, true);
  CAPTURE(self);
  const Vector3d goal(0.4, 0.4, 0.0);
  auto task = test::tip_task(goal, {{{0.3, 0.05, 0.0}, 0.1}, {{0.1, 0.4, 0.0}, 0.08}});
  task.self_collision = self;
  task.joint_limit = 2.8;
  test::Scene scene(task);
  const VectorXd start = Vector4d(-0.5, 0.3, 0.3, 0.3);
  Rng rng(1);
  auto& roots = scene.roots;
  roots.begin(scene.goal(), start, nullptr, 0.0);
  int used = 0;
  while (!roots.done()) {
    const int now = roots.advance(7, rng);
    REQUIRE(now <= 7);
    used += now;
    REQUIRE(used < 60 * 41 + 1);
  }
  REQUIRE(roots.count() >= 2);
  REQUIRE(roots.count() <= Roots::max_count);
  for (int i = 0; i < roots.count(); ++i) {
    const VectorXd q = roots.q(i);
    CHECK((scene.tip(q) - goal).norm() < 0.01);
    CHECK(scene.clearance(q) > 0.003);
    CHECK(q.lpNorm<Eigen::Infinity>() <= 2.8);
    if (self) {
      scene.surroundings.query(q, 0.01, 0.0);
      CHECK(scene.surroundings.self_contacts().empty());
    }
    if (i > 0) CHECK((roots.q(i - 1) - start).norm() <= (q - start).norm());
  }
}

TEST_CASE("a tip goal out of reach has no roots", "[hybrid][roots]") {
  test::Scene scene(test::tip_task({1.2, 0.3, 0.0}));
  Rng rng(1);
  scene.roots.begin(scene.goal(), test::below_ball(), nullptr, 0.0);
  int used = 0;
  while (!scene.roots.done()) used += scene.roots.advance(50, rng);
  CHECK(scene.roots.count() == 0);
  CHECK(used <= 60 * 41);
}

TEST_CASE("a tip goal that can only be reached in contact has no roots", "[hybrid][roots]") {
  test::Scene scene(test::tip_task({0.7, 0.0, 0.0}, {{{0.7, 0.0, 0.0}, 0.15}}));
  Rng rng(1);
  scene.roots.begin(scene.goal(), test::below_ball(), nullptr, 0.0);
  while (!scene.roots.done()) (void)scene.roots.advance(50, rng);
  CHECK(scene.roots.count() == 0);
}

TEST_CASE("roots of a path are clear, behind its blocked stretch and at its end",
          "[hybrid][roots]") {
  auto task = test::joint_task(blocked_sweep().col(1), test::ball_between);
  test::Scene scene(task);
  const JointPath path = polyline(blocked_sweep());
  const double exit = 0.9 + blocked_until(scene, 0.003);  // along the path
  Rng rng(1);
  auto& roots = scene.roots;
  roots.begin(scene.goal(), test::below_ball(), &path, 0.0);
  while (!roots.done()) (void)roots.advance(3, rng);
  REQUIRE(roots.count() == 4);
  VectorXd q(4);
  for (int i = 0; i < roots.count(); ++i) {
    CHECK(roots.arc_length(i) > exit);
    path.at(roots.arc_length(i), q);
    CHECK(q == roots.q(i));
    CHECK(scene.clearance(q) > 0.003);
  }
  // The offsets hold up to the step in which the path is searched.
  CHECK(roots.arc_length(0) == Approx(exit + 0.1).margin(0.041));
  CHECK(roots.arc_length(1) == Approx(exit + 0.4).margin(0.041));
  CHECK(roots.arc_length(2) == Approx(exit + 0.9).margin(0.041));
  CHECK(roots.arc_length(3) == path.length());
}

TEST_CASE("a path without a blocked stretch ahead has its end as root", "[hybrid][roots]") {
  test::Scene scene(test::joint_task(blocked_sweep().col(1), test::ball_between));
  const JointPath path = polyline(blocked_sweep());
  Rng rng(1);
  scene.roots.begin(scene.goal(), test::above_ball(), &path, 1.8);
  while (!scene.roots.done()) (void)scene.roots.advance(1, rng);
  REQUIRE(scene.roots.count() == 1);
  CHECK(scene.roots.arc_length(0) == path.length());
  CHECK(scene.roots.q(0) == path.end());
}

TEST_CASE("a path with a blocked end has its end as the only root", "[hybrid][roots]") {
  test::Scene scene(test::joint_task(VectorXd::Zero(4), test::ball_between));
  MatrixXd points = blocked_sweep();
  points(0, 1) = 0.0;
  const JointPath path = polyline(points);
  Rng rng(1);
  scene.roots.begin(scene.goal(), test::below_ball(), &path, 0.0);
  while (!scene.roots.done()) (void)scene.roots.advance(1, rng);
  REQUIRE(scene.roots.count() == 1);
  CHECK(scene.roots.arc_length(0) == path.length());
}

TEST_CASE("random joint vectors stay in the box, and within the radius around a centre",
          "[hybrid][roots]") {
  auto task = test::joint_task(VectorXd::Zero(4));
  task.joint_limit = 1.5;
  test::Scene scene(task);
  Rng rng(2);
  VectorXd q(4);
  const VectorXd middle = Vector4d(1.4, 0.0, -0.3, -1.4);
  for (int i = 0; i < 1000; ++i) {
    scene.box.draw(rng, q);
    REQUIRE(q.lpNorm<Eigen::Infinity>() <= 1.5);
    scene.box.draw_near(rng, middle, 0.7, q);
    REQUIRE(q.lpNorm<Eigen::Infinity>() <= 1.5);
    REQUIRE((q - middle).norm() <= 0.7 + 1e-12);
  }
}

// ---- the tree

TEST_CASE("the tree finds a path around the ball at which a straight rollout stalls",
          "[hybrid][tree]") {
  const std::uint64_t seed = GENERATE(1u, 2u, 3u, 4u, 5u, 6u);
  CAPTURE(seed);
  auto task = test::joint_task(test::above_ball(), test::ball_between);
  task.seed = seed;
  test::Scene scene(task);
  scene.rollout.begin(test::below_ball(), 300);
  auto step = hybrid::Rollout::Step::moved;
  while (step == hybrid::Rollout::Step::moved) step = scene.rollout.step();
  REQUIRE(step == hybrid::Rollout::Step::ended);

  auto tree = scene.tree(3000);
  tree.begin(scene.goal(), test::below_ball(), nullptr, 0.0);
  finish(tree);
  REQUIRE(tree.arrives());
  const JointPath& path = tree.path();
  CHECK(path.point(0) == test::below_ball());
  CHECK(path.end() == test::above_ball());
  CHECK(scene.clearance(path, 0.01) > 0.0);
  CHECK(scene.clearance(path, 0.01) < 0.1);  // so the ball blocks the direct path
}

TEST_CASE("the path of the tree does not depend on the number of units per tick",
          "[hybrid][tree]") {
  const auto find_path = [](std::uint64_t seed, int units) {
    auto task = test::joint_task(test::above_ball(), test::ball_between);
    task.seed = seed;
    test::Scene scene(task);
    auto tree = scene.tree(3000);
    tree.begin(scene.goal(), test::below_ball(), nullptr, 0.0);
    finish(tree, units);
    return tree.path();
  };
  const JointPath first = find_path(11, 6);
  REQUIRE_FALSE(first.empty());
  CHECK(same(first, find_path(11, 6)));
  CHECK(same(first, find_path(11, 1)));
  CHECK(same(first, find_path(11, 1000)));
  CHECK_FALSE(same(first, find_path(12, 6)));
}

TEST_CASE("a unit queries the host at most once, and no more units are used than given",
          "[hybrid][tree]") {
  test::Scene scene(test::joint_task(test::above_ball(), test::ball_between));
  auto tree = scene.tree(3000);
  tree.begin(scene.goal(), test::below_ball(), nullptr, 0.0);
  const long before = scene.queries();
  finish(tree, 5);
  CHECK(scene.queries() - before <= tree.units());
}

TEST_CASE("in free space the path of the tree is straight", "[hybrid][tree]") {
  test::Scene scene(test::joint_task(test::above_ball()));
  auto tree = scene.tree(3000);
  tree.begin(scene.goal(), test::below_ball(), nullptr, 0.0);
  finish(tree);
  REQUIRE(tree.arrives());
  CHECK(tree.path().length() ==
        Approx((test::above_ball() - test::below_ball()).norm()).epsilon(0.03));
}

TEST_CASE("the tree finds a tip goal behind the ball", "[hybrid][tree]") {
  test::Scene scene(test::tip_task({0.45, 0.45, 0.0}, test::ball_between));
  auto tree = scene.tree(3000);
  tree.begin(scene.goal(), test::below_ball(), nullptr, 0.0);
  finish(tree);
  REQUIRE(tree.arrives());
  CHECK(tree.path().point(0) == test::below_ball());
  CHECK((scene.tip(tree.path().end()) - Vector3d(0.45, 0.45, 0.0)).norm() < 0.01);
  CHECK(scene.clearance(tree.path(), 0.01) > 0.0);
}

TEST_CASE("the tree rejoins a path behind its blocked stretch", "[hybrid][tree]") {
  test::Scene scene(test::joint_task(blocked_sweep().col(1), test::ball_between));
  const JointPath path = polyline(blocked_sweep());
  auto tree = scene.tree(3000);
  tree.begin(scene.goal(), test::below_ball(), &path, 0.0);
  finish(tree);
  REQUIRE(tree.arrives());
  CHECK(tree.rejoin_arc_length() > 0.9 + blocked_until(scene, 0.003));
  VectorXd back(4);
  path.at(tree.rejoin_arc_length(), back);
  CHECK(tree.path().end() == back);
  CHECK(scene.clearance(tree.path(), 0.01) > 0.0);
}

TEST_CASE("without a solution the tree uses its budget and returns no path", "[hybrid][tree]") {
  SECTION("nothing reaches the goal") {
    test::Scene scene(test::tip_task({1.3, 0.0, 0.0}));
    auto tree = scene.tree(500);
    tree.begin(scene.goal(), test::below_ball(), nullptr, 0.0);
    finish(tree);
    CHECK_FALSE(tree.arrives());
    CHECK(tree.path().empty());
  }
  SECTION("the goal is in contact") {
    test::Scene scene(test::joint_task(VectorXd::Zero(4), test::ball_between));
    auto tree = scene.tree(500);
    tree.begin(scene.goal(), test::below_ball(), nullptr, 0.0);
    finish(tree);
    CHECK_FALSE(tree.arrives());
    CHECK(tree.path().empty());
    CHECK(tree.units() >= 500);
    CHECK(tree.units() <= 502);
  }
  SECTION("a later search succeeds") {
    test::Scene scene(test::joint_task(test::above_ball(), test::ball_between));
    auto tree = scene.tree(3000);
    tree.begin(scene.goal(), VectorXd::Zero(4), nullptr, 0.0);  // in contact
    finish(tree);
    CHECK(tree.path().empty());
    tree.begin(scene.goal(), test::below_ball(), nullptr, 0.0);
    finish(tree);
    CHECK(tree.arrives());
    CHECK(tree.path().point(0) == test::below_ball());
  }
}

// ---- vias

TEST_CASE("rollouts through vias lead around the ball", "[hybrid][vias]") {
  int arrived = 0;
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    CAPTURE(seed);
    auto task = test::joint_task(test::above_ball(), test::ball_between);
    task.seed = seed;
    test::Scene scene(task);
    auto vias = scene.vias();
    vias.begin(scene.goal(), test::below_ball(), nullptr, 0.0);
    finish(vias);
    const JointPath& path = vias.path();
    REQUIRE_FALSE(path.empty());
    REQUIRE(path.point(0) == test::below_ball());
    REQUIRE(scene.clearance(path, 0.01) > 0.0);
    if (!vias.arrives()) continue;
    ++arrived;
    REQUIRE((path.end() - test::above_ball()).lpNorm<Eigen::Infinity>() < 0.02);
  }
  CHECK(arrived >= 5);
}

TEST_CASE("the seed decides the vias, for any number of units per tick", "[hybrid][vias]") {
  const auto find_path = [](std::uint64_t seed, int units) {
    auto task = test::joint_task(test::above_ball(), test::ball_between);
    task.seed = seed;
    test::Scene scene(task);
    auto vias = scene.vias();
    vias.begin(scene.goal(), test::below_ball(), nullptr, 0.0);
    finish(vias, units);
    return vias.path();
  };
  CHECK(same(find_path(3, 6), find_path(3, 6)));
  CHECK(same(find_path(3, 6), find_path(3, 1)));
  CHECK_FALSE(same(find_path(3, 6), find_path(4, 6)));
}

TEST_CASE("vias that do not arrive lead away, and the search ends", "[hybrid][vias]") {
  // The goal is in contact.
  test::Scene scene(test::joint_task(VectorXd::Zero(4), test::ball_between));
  auto vias = scene.vias();
  vias.begin(scene.goal(), test::below_ball(), nullptr, 0.0);
  finish(vias);
  CHECK_FALSE(vias.arrives());
  REQUIRE_FALSE(vias.path().empty());
  CHECK((vias.path().end() - test::below_ball()).norm() > 0.1);
  CHECK(scene.clearance(vias.path(), 0.01) > 0.0);
  CHECK(vias.units() <= 64 * (25 + 60 + 4));
}

TEST_CASE("vias rejoin a path behind its blocked stretch", "[hybrid][vias]") {
  int arrived = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    CAPTURE(seed);
    auto task = test::joint_task(blocked_sweep().col(1), test::ball_between);
    task.seed = seed;
    test::Scene scene(task);
    const JointPath path = polyline(blocked_sweep());
    auto vias = scene.vias();
    vias.begin(scene.goal(), test::below_ball(), &path, 0.0);
    finish(vias);
    if (!vias.arrives()) continue;
    ++arrived;
    VectorXd back(4);
    path.at(vias.rejoin_arc_length(), back);
    REQUIRE(vias.rejoin_arc_length() > 0.9 + blocked_until(scene, 0.003));
    REQUIRE((vias.path().end() - back).lpNorm<Eigen::Infinity>() < 0.04);
  }
  CHECK(arrived >= 2);
}
