#include "hamelin/search/search.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <thread>
#include <type_traits>

#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/search/margins.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/joint_space_world.hpp"

using namespace hamelin;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// An arm of three joints, with a ball between start and goal in joint space.
struct SearchRig {
  SearchRig() : arm(model::make_chain({3})) {
    settings.q_lower = VectorXd::Constant(3, -2.0);
    settings.q_upper = VectorXd::Constant(3, 2.0);
    settings.margin_m = 0.05;
    settings.checks_max = 50000;
    problem.start = VectorXd::Constant(3, -1.0);
    problem.goals = {scene::joint_goal(VectorXd::Constant(3, 1.0))};
  }
  static std::vector<test::JointSpaceWorld::Ball> ball() { return {{VectorXd::Zero(3), 0.8}}; }

  model::Model arm;
  search::Settings settings;
  search::Problem problem;
};

// The smallest distance from the balls at many places of a path, without the query's own proof.
double sampled_distance(const test::JointSpaceWorld& world, const MatrixXd& points) {
  double least = 1.0;
  for (Index i = 0; i + 1 < points.cols(); ++i)
    for (int k = 0; k <= 1000; ++k) {
      const VectorXd q = points.col(i) + 1e-3 * k * (points.col(i + 1) - points.col(i));
      least = std::min(least, world.distance(q, q));
    }
  return least;
}

// The shortest way round the ball has two tangents of it with the margin, and an arc between them.
double shortest_length() {
  const double half = std::sqrt(3.0), radius = 0.85;
  return 2.0 * std::sqrt(half * half - radius * radius) +
         radius * (std::numbers::pi - 2.0 * std::acos(radius / half));
}

// Paths may have different numbers of points, which Eigen does not compare.
bool same(const MatrixXd& a, const MatrixXd& b) {
  return a.cols() == b.cols() && a.rows() == b.rows() && a == b;
}

}  // namespace

TEST_CASE("a search finds a path around an obstacle, which keeps the margin", "[search]") {
  SearchRig rig;
  test::JointSpaceWorld world(SearchRig::ball());
  const search::Path path = search::Search(rig.arm, rig.settings).search(rig.problem, world);
  REQUIRE(path.found());
  CHECK(path.cause.empty());
  CHECK(path.points.col(0) == rig.problem.start);
  CHECK(path.points.rightCols(1) == rig.problem.goals[0].q);
  CHECK(path.margin_m == 0.05);
  CHECK(sampled_distance(world, path.points) > 0.05 - 1e-9);
  CHECK(path.points.cwiseAbs().maxCoeff() <= 2.0);
  CHECK(path.checks == world.checks());
  CHECK(path.first_checks > 0);
  CHECK(path.first_checks <= path.checks);
  CHECK(path.roots == 1);
  CHECK(path.length <= search::path_length(path.planned) + 1e-12);
  CHECK(path.length >= shortest_length() - 1e-9);
  CHECK(path.length <= 1.2 * shortest_length());
}

TEST_CASE("a path that is improved comes near to the shortest", "[search]") {
  double length = 10.0;
  for (const long checks : {0L, 1000L, 10000L}) {
    SearchRig rig;
    rig.settings.improve_checks = checks;
    test::JointSpaceWorld world(SearchRig::ball());
    const search::Path path = search::Search(rig.arm, rig.settings).search(rig.problem, world);
    REQUIRE(path.found());
    CHECK(sampled_distance(world, path.points) > 0.05 - 1e-9);
    CHECK(path.length <= length);
    length = path.length;
  }
  CHECK(length <= 1.01 * shortest_length());
}

TEST_CASE("a search in slices of any size is the same search", "[search]") {
  SearchRig rig;
  rig.settings.improve_checks = 500;
  test::JointSpaceWorld whole_world(SearchRig::ball());
  const search::Path whole = search::Search(rig.arm, rig.settings).search(rig.problem, whole_world);
  for (const long slice : {1L, 7L, 100L}) {
    search::Search search(rig.arm, rig.settings);
    test::JointSpaceWorld world(SearchRig::ball());
    search.begin(rig.problem, world);
    long before = world.checks();
    while (!search.advance(slice)) {
      CHECK(world.checks() - before <= slice);
      before = world.checks();
    }
    CHECK(same(search.path().points, whole.points));
    CHECK(search.path().checks == whole.checks);
  }
}

TEST_CASE("the steps of a search do not allocate", "[search][allocation]") {
  test::require_allocation_count();
  SearchRig rig;
  test::JointSpaceWorld world(SearchRig::ball());
  search::Search search(rig.arm, rig.settings);
  search.begin(rig.problem, world);
  // until the first path is found, which is copied
  long allocations = 0, steps = 0;
  for (bool ended = false; !ended; ++steps) {
    const long made = test::allocations_in([&] { ended = search.advance(1); });
    if (steps > 3 && made > 0) ++allocations;  // steps that allocate
  }
  CHECK(steps > 30);
  CHECK(allocations <= 2);  // the first path, and the last
}

TEST_CASE("with several goals the path leads to one of them", "[search]") {
  SearchRig rig;
  rig.problem.goals = {scene::joint_goal(VectorXd::Constant(3, 1.0)),
                       scene::joint_goal(Eigen::Vector3d(-1.0, -0.5, -1.0))};
  test::JointSpaceWorld world({{VectorXd::Constant(3, 1.0), 0.3}});
  const search::Path path = search::Search(rig.arm, rig.settings).search(rig.problem, world);
  REQUIRE(path.found());
  CHECK(path.points.rightCols(1) == rig.problem.goals[1].q);
}

TEST_CASE("a search begins with what is clear of a path that was known", "[search]") {
  SearchRig rig;
  test::JointSpaceWorld free({}), blocked(SearchRig::ball());
  rig.problem.known.resize(3, 4);
  // around the ball, from beside the start
  rig.problem.known << -0.9, 1.2, 1.2, 1.0,  //
      -1.0, -1.0, 1.0, 1.0,                  //
      -1.0, -1.0, -0.9, 1.0;
  const search::Path kept = search::Search(rig.arm, rig.settings).search(rig.problem, blocked);
  REQUIRE(kept.found());
  CHECK(kept.planned.col(0) == rig.problem.start);
  CHECK(kept.planned.cols() > 4);  // in pieces of 0.5
  const VectorXd behind = rig.problem.known.col(2);
  CHECK((kept.planned.colwise() - behind).colwise().norm().minCoeff() < 1e-12);
  // a second ball on the second line of it
  auto balls = SearchRig::ball();
  balls.push_back({Eigen::Vector3d(1.2, 0.0, -0.95), 0.3});
  test::JointSpaceWorld world(balls), again(balls);
  const search::Path around = search::Search(rig.arm, rig.settings).search(rig.problem, world);
  REQUIRE(around.found());
  CHECK(sampled_distance(world, around.points) > 0.05 - 1e-9);
  const Eigen::Vector3d before(0.9, -1.0, -1.0);  // on the first line
  double nearest = 1.0;
  for (Index i = 0; i + 1 < around.planned.cols(); ++i)
    for (int k = 0; k <= 100; ++k)
      nearest = std::min(nearest,
                         (around.planned.col(i) +
                          0.01 * k * (around.planned.col(i + 1) - around.planned.col(i)) - before)
                             .norm());
  CHECK(nearest < 0.1);
  // a path that leads elsewhere has no effect
  rig.problem.known.col(3).setConstant(-1.5);
  const search::Path other = search::Search(rig.arm, rig.settings).search(rig.problem, again);
  rig.problem.known.resize(0, 0);
  test::JointSpaceWorld third(balls);
  CHECK(same(other.planned,
             search::Search(rig.arm, rig.settings).search(rig.problem, third).planned));
}

TEST_CASE("a search depends on seed, number and problem alone", "[search][threads]") {
  const auto search = [&](std::uint64_t seed, std::uint64_t number) {
    SearchRig own;
    own.settings.seed = seed;
    own.problem.number = number;
    test::JointSpaceWorld world(SearchRig::ball());
    return search::Search(own.arm, own.settings).search(own.problem, world);
  };
  const search::Path first = search(7, 2);
  (void)search(8, 2);
  (void)search(7, 3);
  const search::Path again = search(7, 2);
  CHECK(same(again.points, first.points));
  CHECK(same(again.planned, first.planned));
  CHECK(again.checks == first.checks);
  CHECK_FALSE(same(search(8, 2).planned, first.planned));
  CHECK_FALSE(same(search(7, 3).planned, first.planned));
  std::vector<search::Path> paths(3);
  std::vector<std::thread> threads;
  for (auto& path : paths) threads.emplace_back([&] { path = search(7, 2); });
  for (auto& thread : threads) thread.join();
  for (const auto& path : paths) CHECK(same(path.points, first.points));
}

TEST_CASE("a path to a goal of the tip ends within its tolerances", "[search]") {
  const model::Model arm(model::make_chain({}));
  dynamics::Workspace ws(arm);
  Rng rng(5);
  for (const bool turns : {false, true}) {
    const VectorXd reached = VectorXd::NullaryExpr(7, [&] { return rng.uniform(-1.0, 1.0); });
    dynamics::forward_kinematics(arm, ws, reached);
    const geometry::SE3 tip = dynamics::tip_pose(arm, ws);
    search::Problem problem;
    problem.start = VectorXd::Zero(7);
    problem.goals = {turns ? scene::pose_goal(tip) : scene::position_goal(tip.p())};
    test::JointSpaceWorld world({{VectorXd::Constant(7, 0.3), 0.1}});
    const search::Path path = search::Search(arm, {}).search(problem, world);
    REQUIRE(path.found());
    CHECK(path.roots >= 1);
    dynamics::forward_kinematics(arm, ws, VectorXd(path.points.rightCols(1)));
    const geometry::SE3 end = dynamics::tip_pose(arm, ws);
    CHECK((end.p() - tip.p()).norm() < problem.goals[0].tolerance_m);
    if (turns)
      CHECK(Eigen::AngleAxisd(end.R().transpose() * tip.R()).angle() <
            problem.goals[0].tolerance_rad);
  }
}

TEST_CASE("a search says why it found no path, and keeps to its checks", "[search]") {
  SearchRig rig;
  rig.settings.checks_max = 2000;
  const auto search = [&](const VectorXd& center, double radius) {
    test::JointSpaceWorld world({{center, radius}});
    return search::Search(rig.arm, rig.settings).search(rig.problem, world);
  };
  CHECK(search(rig.problem.start, 0.1).cause == "the arm is in contact where it is");
  CHECK(search(rig.problem.goals[0].q, 0.2).cause ==
        "no clear configuration was found at the goal");
  // a ball that is wider than the joint limits, but contains neither start nor goal
  rig.problem.start = VectorXd::Constant(3, -2.0);
  rig.problem.goals[0].q = VectorXd::Constant(3, 2.0);
  test::JointSpaceWorld wall({{VectorXd::Zero(3), 3.2}});
  const search::Path path = search::Search(rig.arm, rig.settings).search(rig.problem, wall);
  CHECK_FALSE(path.found());
  CHECK(path.points.cols() == 0);
  CHECK(path.cause == "no path was found within 2000 checks");
  CHECK(path.checks < 2010);
}

TEST_CASE("a goal that is not clear is replaced by a clear place within its tolerance",
          "[search]") {
  SearchRig rig;
  rig.problem.goals[0].tolerance_rad = 0.2;
  test::JointSpaceWorld world({{rig.problem.goals[0].q, 0.05}});
  const search::Path path = search::Search(rig.arm, rig.settings).search(rig.problem, world);
  REQUIRE(path.found());
  const VectorXd end = path.points.rightCols(1);
  CHECK(world.distance(end, end) > 0.0);
  CHECK((end - rig.problem.goals[0].q).lpNorm<Eigen::Infinity>() < 0.2);
}

TEST_CASE("tight starts and goals are reached with the clearance that they have", "[search]") {
  SearchRig rig;
  const VectorXd beside = VectorXd::Unit(3, 0);
  test::JointSpaceWorld world({{rig.problem.start + 0.31 * beside, 0.3},
                               {rig.problem.start - 0.31 * beside, 0.3},
                               {rig.problem.goals[0].q + 0.32 * beside, 0.3}});
  const search::Path path = search::Search(rig.arm, rig.settings).search(rig.problem, world);
  REQUIRE(path.found());
  CHECK(sampled_distance(world, path.points) > 0.009);
}

// A search with a temporary model must not compile.
static_assert(std::is_constructible_v<search::Search, const model::Model&, search::Settings> &&
              !std::is_constructible_v<search::Search, model::Model, search::Settings>);

TEST_CASE("bad settings and problems are refused in one line", "[search]") {
  SearchRig rig;
  test::JointSpaceWorld world({});
  const auto error = [&] {
    return test::error_of(
        [&] { (void)search::Search(rig.arm, rig.settings).search(rig.problem, world); });
  };
  rig.problem.start = VectorXd::Zero(2);
  CHECK(error() ==
        "search: start: 2 values given, expected 3 finite numbers (one per joint of 'chain3')");
  rig.problem.start = VectorXd::Constant(3, std::nan(""));
  CHECK(error().starts_with("search: start: 3 values given, expected 3 finite numbers"));
  rig.problem.start = VectorXd::Zero(3);
  rig.problem.goals[0].q = VectorXd::Zero(4);
  CHECK(error().starts_with("search: goal: 4 values given"));
  rig.problem.goals = {};
  CHECK(error() == "search: goals: none given, expected at least one");
  rig.problem.goals = {scene::follow_goal()};
  CHECK(error() == "search: goal: follows a target, expected a goal that stays where it is");
  rig.problem.goals[0] = scene::position_goal({std::nan(""), 0.0, 0.0});
  CHECK(error() == "search: goal: is not finite, expected finite numbers");
  rig.problem.goals[0] = scene::joint_goal(VectorXd::Zero(3));
  rig.problem.known = MatrixXd::Zero(2, 3);
  CHECK(error() == "search: known path: 2 rows given, expected 3 of finite numbers");
  rig.problem.known = {};
  rig.settings.q_lower = VectorXd::Zero(1);
  CHECK(error() == "search: 1 joint limits given, expected 3");
  rig.settings.q_lower = {};
  rig.settings.checks_max = 0;
  CHECK(error().starts_with("search: margins and checks_max:"));
}

TEST_CASE("the least margin on a line is that of its configurations", "[search]") {
  Rng rng(3);
  const auto draw = [&] {
    return VectorXd(VectorXd::NullaryExpr(4, [&] { return rng.uniform(-1.0, 1.0); }));
  };
  for (int i = 0; i < 200; ++i) {
    search::Margins margins(0.02);
    margins.add(draw(), 0.005, 0.2, 0.9);
    margins.add(draw(), 0.001, 0.02, 0.3);
    margins.add(draw(), 0.05, 0.2, 0.9);  // has no effect
    const VectorXd a = draw(), b = draw();
    double least = 1.0;
    for (int k = 0; k <= 2000; ++k)
      least = std::min(least, margins.required(a + 5e-4 * k * (b - a)));
    CHECK(margins.least(a, b) <= least + 1e-15);
    CHECK(margins.least(a, b) > least - 1e-4);
  }
}
