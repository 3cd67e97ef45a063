#include "hamelin/search/tip_constraints.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/core/numbers.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/search/constrained_query.hpp"
#include "hamelin/search/search.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/joint_space_world.hpp"

using namespace hamelin;
using Catch::Contains;
using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;
using search::TipConstraints;

namespace {

constexpr Index dof = 7;

// An axis within 0.3 rad of a slanted direction, and the tip between two planes in a turned frame.
std::vector<scene::TipConstraint> slanted() {
  scene::BoxConstraint box;
  box.pose = {Eigen::AngleAxisd(0.4, Vector3d(1.0, 2.0, -1.0).normalized()).toRotationMatrix(),
              {0.1, 0.2, 0.3}};
  box.low_m = {-infinity, -0.6, -infinity};
  box.high_m = {infinity, 0.5, 0.9};
  return {scene::AxisConstraint{{1.0, 0.5, 0.0}, {0.2, 0.0, 2.0}, 0.9}, box};
}

// The excess of each constraint by its definition.
std::vector<double> excess_at(const model::Model& arm, const VectorXd& q) {
  dynamics::Workspace ws(arm);
  dynamics::forward_kinematics(arm, ws, q);
  const geometry::SE3 tip = dynamics::tip_pose(arm, ws);
  std::vector<double> out;
  for (const scene::TipConstraint& each : slanted()) {
    if (const auto* axis = std::get_if<scene::AxisConstraint>(&each)) {
      const double cosine = (tip.R() * axis->axis).normalized().dot(axis->direction.normalized());
      out.push_back(std::acos(std::clamp(cosine, -1.0, 1.0)) - axis->angle_rad);
    } else {
      const auto& box = std::get<scene::BoxConstraint>(each);
      const Vector3d p = box.pose.inverse() * tip.p();
      double most = -infinity;
      for (Index i = 0; i < 3; ++i)
        most = std::max({most, box.low_m[i] - p[i], p[i] - box.high_m[i]});
      out.push_back(most);
    }
  }
  return out;
}

VectorXd random(Rng& rng, double size) {
  VectorXd out(dof);
  for (double& x : out) x = rng.uniform(-size, size);
  return out;
}

double largest(const std::vector<double>& values) {
  return *std::max_element(values.begin(), values.end());
}

dynamics::JointBox wide_box() {
  return {dof, VectorXd::Constant(dof, -2.5), VectorXd::Constant(dof, 2.5), 0.0};
}

search::Settings within(const dynamics::JointBox& box) {
  search::Settings out;
  out.q_lower = box.lower;
  out.q_upper = box.upper;
  return out;
}

}  // namespace

TEST_CASE("what is proved of the tip holds at every place that is sampled, also beside the motion",
          "[search][property]") {
  const model::Model arm(model::make_chain({static_cast<int>(dof)}));
  TipConstraints kept(arm, slanted());
  Rng rng(4);
  int proved = 0, refused = 0;
  for (int i = 0; i < 400; ++i) {
    VectorXd a = random(rng, 2.0);
    if (!kept.project(a, wide_box())) continue;
    const VectorXd b = a + random(rng, rng.uniform(0.02, 0.6));
    const VectorXd stray = VectorXd::Constant(dof, rng.uniform(0.0, 2e-3));
    const bool claimed = kept.motion_keeps(a, b, stray);
    double most = -infinity;
    for (int k = 0; k <= 200; ++k) {
      VectorXd q = a + k / 200.0 * (b - a);
      for (Index j = 0; j < dof; ++j) q[j] += stray[j] * rng.uniform(-1.0, 1.0);
      most = std::max(most, largest(excess_at(arm, q)));
    }
    if (claimed) CHECK(most <= 0.0);
    ++(claimed ? proved : refused);
    // Motions that keep more than what plans leave, with strays, are proved.
    if (!claimed) CHECK(most > -0.06);
  }
  CHECK(proved > 50);
  CHECK(refused > 50);
}

TEST_CASE("what is measured of a motion bounds what is sampled, and is exact at a configuration",
          "[search][property]") {
  const model::Model arm(model::make_chain({static_cast<int>(dof)}));
  TipConstraints kept(arm, slanted());
  std::vector<double> by(2);
  Rng rng(5);
  for (int i = 0; i < 100; ++i) {
    const VectorXd a = random(rng, 2.0), b = a + random(rng, 0.02);
    kept.measure(a, a, by);
    const std::vector<double> exact = excess_at(arm, a);
    for (std::size_t k = 0; k < 2; ++k) CHECK(by[k] == Approx(exact[k]).margin(1e-7));
    CHECK(kept.excess(a).by == Approx(largest(exact)).margin(1e-7));
    kept.measure(a, b, by);
    std::vector<double> most(2, -infinity);
    for (int s = 0; s <= 20; ++s) {
      const std::vector<double> at = excess_at(arm, a + 0.05 * s * (b - a));
      for (std::size_t k = 0; k < 2; ++k) most[k] = std::max(most[k], at[k]);
    }
    for (std::size_t k = 0; k < 2; ++k) {
      CHECK(by[k] >= most[k] - 1e-7);
      if (most[k] < 0.3) CHECK(by[k] <= most[k] + 0.02);  // sin α is flat near 90°
    }
  }
}

TEST_CASE("configurations are brought to where the tip keeps its constraints",
          "[search][property]") {
  const model::Model arm(model::make_chain({static_cast<int>(dof)}));
  TipConstraints kept(arm, slanted());
  const dynamics::JointBox box = wide_box();
  Rng rng(6);
  int brought = 0;
  for (int i = 0; i < 200; ++i) {
    VectorXd q = random(rng, 2.5);
    if (!kept.project(q, box)) continue;
    ++brought;
    CHECK(largest(excess_at(arm, q)) <= 0.0);
    CHECK((q.array() >= box.lower.array()).all());
    CHECK((q.array() <= box.upper.array()).all());
  }
  CHECK(brought > 160);
}

TEST_CASE("a path keeps what the tip has to keep, also where the straight one would not",
          "[search]") {
  const model::Model arm(model::make_chain({static_cast<int>(dof)}));
  TipConstraints kept(arm, slanted());
  const dynamics::JointBox box = wide_box();
  search::Settings settings = within(box);
  settings.margin_m = 0.05;
  Rng rng(7);
  int found = 0, straight = 0;
  for (std::uint64_t i = 0; i < 10; ++i) {
    VectorXd start = random(rng, 2.0), goal = random(rng, 2.0);
    if (!kept.project(start, box) || !kept.project(goal, box)) continue;
    test::JointSpaceWorld world({{0.5 * (start + goal), 0.3}});
    search::ConstrainedQuery query(world, kept);
    const search::Path path =
        search::Search(arm, settings).search({start, {scene::joint_goal(goal)}, i}, query);
    double most = -infinity;
    for (int k = 0; k <= 100; ++k)
      most = std::max(most, largest(excess_at(arm, start + 0.01 * k * (goal - start))));
    straight += most <= 0.0 ? 1 : 0;
    if (!path.found()) continue;
    ++found;
    for (Index c = 0; c + 1 < path.points.cols(); ++c)
      for (int k = 0; k <= 100; ++k) {
        const VectorXd q =
            path.points.col(c) + 0.01 * k * (path.points.col(c + 1) - path.points.col(c));
        CHECK(largest(excess_at(arm, q)) <= 0.0);
      }
  }
  CHECK(found >= 8);
  CHECK(straight < found);
}

TEST_CASE("starts and goals that a constraint excludes are named in one line", "[search]") {
  const model::Model arm(model::make_chain({static_cast<int>(dof)}));
  const dynamics::JointBox box = wide_box();
  search::Settings settings = within(box);
  settings.checks_max = 2000;
  Rng rng(8);
  VectorXd good = random(rng, 2.0), bad = random(rng, 2.0);
  TipConstraints kept(arm, slanted());
  REQUIRE(kept.project(good, box));
  while (largest(excess_at(arm, bad)) < 0.1) bad = random(rng, 2.0);
  test::JointSpaceWorld world({});
  search::ConstrainedQuery query(world, kept);
  search::Search search(arm, settings);
  CHECK_THAT(search.search({bad, {scene::joint_goal(good)}}, query).cause,
             Contains("where the arm is, constraint"));
  scene::Goal goal = scene::joint_goal(bad);
  goal.tolerance_rad = 1e-3;
  CHECK_THAT(search.search({good, {goal}}, query).cause,
             Contains("at the goal, constraint") && Contains("is exceeded by"));
}

TEST_CASE("constraints that make no sense are refused in one line", "[search]") {
  const model::Model arm(model::make_chain({static_cast<int>(dof)}));
  const auto refused = [&](const scene::TipConstraint& constraint, const char* message) {
    CHECK_THAT(test::error_of([&] { TipConstraints kept(arm, {constraint}); }), Contains(message));
  };
  refused(scene::AxisConstraint{{0, 0, 0}, {0, 0, 1}, 0.1}, "constraint 1: axis: has no direction");
  refused(scene::AxisConstraint{{0, 0, 1}, {0, std::nan(""), 1}, 0.1}, "constraint 1: direction");
  refused(scene::AxisConstraint{{0, 0, 1}, {0, 0, 1}, 0.0}, "angle_rad: 0 given");
  refused(scene::AxisConstraint{{0, 0, 1}, {0, 0, 1}, 3.0}, "angle_rad: 3 given");
  scene::BoxConstraint box;
  refused(box, "low_m is not below high_m");
  box.low_m.setConstant(-infinity);
  box.high_m.setConstant(infinity);
  refused(box, "the box has no side");
}
