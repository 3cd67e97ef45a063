// Paths on which the tip keeps to a line or an arc, and goals that are any of several.
#include "hamelin/search/ways.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/core/rng.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/search/search.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/joint_space_world.hpp"

using namespace hamelin;
using Catch::Contains;
using Eigen::AngleAxisd;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;
using search::TipCurve;

namespace {

struct WayRig {
  explicit WayRig(int dof = 7) : arm(model::make_chain({dof})) {
    settings.q_lower = VectorXd::Constant(dof, -2.5);
    settings.q_upper = VectorXd::Constant(dof, 2.5);
    settings.margin_m = 0.01;
    start = VectorXd::Constant(dof, 0.4);
  }
  [[nodiscard]] geometry::SE3 tip(const VectorXd& q) const {
    dynamics::Workspace ws(arm);
    dynamics::forward_kinematics(arm, ws, q);
    return dynamics::tip_pose(arm, ws);
  }
  // Along a way from the start by so much.
  [[nodiscard]] search::Path along(const Vector3d& by_m, search::Query& query) const {
    scene::Goal goal = scene::position_goal(tip(start).p() + by_m);
    goal.way.emplace();
    search::Problem problem{start, {goal}};
    problem.way = search::way_curve(goal, tip(start));
    return search::Search(arm, settings).search(problem, query);
  }

  model::Model arm;
  search::Settings settings;
  VectorXd start;
};

struct Deviation {
  double m = 0.0, rad = 0.0, back_m = 0.0;
};

// Sampled, and without the product's own measure.
Deviation from_line(const WayRig& rig, const MatrixXd& points, const geometry::SE3& from,
                    const Vector3d& by_m) {
  Deviation most;
  double farthest = 0.0;
  for (Index i = 0; i + 1 < points.cols(); ++i)
    for (int k = 0; k <= 200; ++k) {
      const geometry::SE3 tip =
          rig.tip(points.col(i) + k / 200.0 * (points.col(i + 1) - points.col(i)));
      const Vector3d at = tip.p() - from.p(), along = by_m.normalized();
      const double s = std::clamp(at.dot(along), 0.0, by_m.norm());
      most.m = std::max(most.m, (at - s * along).norm());
      most.rad = std::max(most.rad, AngleAxisd(from.R().transpose() * tip.R()).angle());
      farthest = std::max(farthest, s);
      most.back_m = std::max(most.back_m, farthest - s);
    }
  return most;
}

}  // namespace

TEST_CASE("an arc passes its three points at constant speed", "[search][ways]") {
  Rng rng(3);
  for (int k = 0; k < 50; ++k) {
    const auto draw = [&] { return Vector3d(rng.normal(), rng.normal(), rng.normal()); };
    const geometry::SE3 from(AngleAxisd(rng.normal(), draw().normalized()).toRotationMatrix(),
                             draw()),
        to(AngleAxisd(rng.normal(), draw().normalized()).toRotationMatrix(), draw());
    const Vector3d through = draw();
    const TipCurve arc = TipCurve::arc(from, through, to);
    const double size = arc.length_m();
    CHECK((arc.at(0.0).p() - from.p()).norm() < 1e-9 * size);
    CHECK((arc.at(1.0).p() - to.p()).norm() < 1e-9 * size);
    CHECK((arc.at(1.0).R() - to.R()).norm() < 1e-9);
    const double s = arc.nearest({from.R(), through});
    CHECK(s > 0.0);
    CHECK(s < 1.0);
    CHECK((arc.at(s).p() - through).norm() < 1e-9 * size);
    double length = 0.0, bend = 0.0;
    constexpr double h = 1e-3;
    for (double at = 0.0; at < 1.0 - h / 2; at += h) {
      length += (arc.at(at + h).p() - arc.at(at).p()).norm();
      bend = std::max(
          bend, (arc.at(at + h).p() - 2.0 * arc.at(at).p() + arc.at(at - h).p()).norm() / (h * h));
    }
    CHECK(length == Approx(size).epsilon(1e-5));
    CHECK(bend == Approx(arc.bend_m()).epsilon(1e-4));
  }
  CHECK_THAT(test::error_of([] {
               (void)TipCurve::arc({}, Vector3d(1, 0, 0),
                                   {Eigen::Matrix3d::Identity(), Vector3d(2, 0, 0)});
             }),
             Contains("arc: its ends and the point between them are on a line"));
}

TEST_CASE("a curve that only turns is measured by its rotation", "[search][ways]") {
  const geometry::SE3 to(AngleAxisd(1.2, Vector3d::UnitZ()).toRotationMatrix(), Vector3d::Zero());
  const TipCurve turn = TipCurve::line({}, to);
  for (const double s : {0.0, 0.3, 1.0}) CHECK(turn.nearest(turn.at(s)) == Approx(s));
  CHECK(TipCurve::line({}, {}).nearest(to) == 1.0);
}

TEST_CASE("a tip keeps to a line within its tolerances, between nodes too, and goes on",
          "[search][ways]") {
  const WayRig rig;
  test::JointSpaceWorld world({});
  const Vector3d by(0.1, -0.2, 0.15);
  const search::Path path = rig.along(by, world);
  REQUIRE(path.found());
  CHECK(path.way_share == 1.0);
  const geometry::SE3 from = rig.tip(rig.start), end = rig.tip(path.points.rightCols<1>());
  CHECK((end.p() - from.p() - by).norm() < 0.001);
  const Deviation off = from_line(rig, path.points, from, by);
  CHECK(off.m < 0.002);
  CHECK(off.rad < 0.02);
  CHECK(off.back_m < 0.002);
}

TEST_CASE("where a way ends, the path up to there is kept, and the reason", "[search][ways]") {
  const WayRig rig;
  test::JointSpaceWorld world({});
  const Vector3d far(20.0, 0.0, 0.0);
  const search::Path path = rig.along(far, world);
  CHECK_FALSE(path.found());
  CHECK_THAT(path.cause, Contains("the way is clear up to "));
  CHECK(path.way_share > 0.0);
  CHECK(path.way_share < 1.0);
  REQUIRE(path.way.cols() > 1);
  const geometry::SE3 from = rig.tip(rig.start), end = rig.tip(path.way.rightCols<1>());
  CHECK((end.p() - from.p() - path.way_share * far).norm() < 0.002);
  CHECK(from_line(rig, path.way, from, far).m < 0.002);
}

TEST_CASE("an obstacle ends the way of an arm with no other posture", "[search][ways]") {
  const WayRig rig(6);
  test::JointSpaceWorld free({});
  const Vector3d by(0.1, -0.2, 0.15);
  const search::Path path = rig.along(by, free);
  REQUIRE(path.found());
  const Index middle = path.points.cols() / 2;
  REQUIRE((path.points.col(middle) - rig.start).norm() > 0.1);
  test::JointSpaceWorld world({{path.points.col(middle), 0.03}});
  const search::Path blocked = rig.along(by, world);
  CHECK_FALSE(blocked.found());
  CHECK_THAT(blocked.cause, Contains("then the arm is not clear"));
  CHECK(blocked.way_share > 0.0);
  CHECK(blocked.way_share < 1.0);
}

TEST_CASE("a path begins with a retreat and ends with an approach", "[search][ways]") {
  WayRig rig;
  VectorXd end = rig.start;
  end[0] += 1.2;
  end[3] -= 0.9;
  scene::Goal goal = scene::joint_goal(end);
  scene::Stretch stretch;
  stretch.distance_m = 0.05;
  goal.approach = stretch;
  goal.approach->direction = -Vector3d::UnitZ();  // from where the arm can reach
  search::Problem problem{rig.start, {goal}};
  problem.shortens = false;
  problem.retreat = stretch;
  problem.retreat->in_world = true;
  test::JointSpaceWorld world({{0.5 * (rig.start + end), 0.1}});
  const search::Path path = search::Search(rig.arm, rig.settings).search(problem, world);
  CAPTURE(path.cause);
  REQUIRE(path.found());
  CHECK(path.points.col(0) == rig.start);
  CHECK(path.points.rightCols<1>() == end);

  const auto while_near = [&](const geometry::SE3& place, const Vector3d& along, bool first) {
    Index count = 1;
    const auto at = [&](Index k) {
      return path.points.col(first ? k : path.points.cols() - 1 - k);
    };
    while ((rig.tip(at(count)).p() - place.p()).norm() < 0.05) ++count;
    MatrixXd points(end.size(), count + 1);
    for (Index k = 0; k <= count; ++k) points.col(k) = at(k);
    const Deviation off = from_line(rig, points, place, 0.06 * along);
    CHECK(off.m < 0.002);
    CHECK(off.rad < 0.02);
  };
  while_near(rig.tip(rig.start), Vector3d::UnitZ(), true);
  const geometry::SE3 there = rig.tip(end);
  while_near(there, there.R().col(2), false);
}

TEST_CASE("a blocked approach or retreat is named", "[search][ways]") {
  const WayRig rig;
  VectorXd end = rig.start;
  end[0] += 1.2;
  scene::Goal goal = scene::joint_goal(end);
  goal.approach.emplace();
  goal.approach->distance_m = 30.0;
  search::Problem problem{rig.start, {goal}};
  test::JointSpaceWorld world({});
  search::Path path = search::Search(rig.arm, rig.settings).search(problem, world);
  CHECK_FALSE(path.found());
  CHECK_THAT(path.cause, Contains("the approach to the goal is clear up to "));
  REQUIRE(path.goals.size() == 1);
  CHECK(path.goals[0].blocked > 0);
  problem.retreat = goal.approach;
  path = search::Search(rig.arm, rig.settings).search(problem, world);
  CHECK_THAT(path.cause, Contains("the retreat is clear up to "));
}

TEST_CASE("a path leads to any of several goals, and says which and why not to others",
          "[search][any_of]") {
  WayRig rig;
  VectorXd blocked = rig.start, clear = rig.start;
  blocked[0] += 0.8;
  clear[0] -= 1.0;
  scene::Goal far = scene::pose_goal({Eigen::Matrix3d::Identity(), Vector3d(50.0, 0.0, 0.0)});
  scene::Goal near = scene::pose_goal(rig.tip(clear));
  test::JointSpaceWorld world({{blocked, 0.3}});
  search::Problem problem{rig.start, {scene::joint_goal(blocked), far, near}};
  const search::Path path = search::Search(rig.arm, rig.settings).search(problem, world);
  REQUIRE(path.found());
  CHECK(path.goal == 2);
  CHECK((rig.tip(path.points.rightCols<1>()).p() - near.pose.p()).norm() < near.tolerance_m);
  REQUIRE(path.goals.size() == 3);
  CHECK_THAT(search::why_not(path.goals[0]), Contains("postures are in contact"));
  CHECK_THAT(search::why_not(path.goals[1]), Contains("no posture reaches it"));
  CHECK(path.goals[2].clear > 0);

  problem.goals.pop_back();
  const search::Path none = search::Search(rig.arm, rig.settings).search(problem, world);
  CHECK_FALSE(none.found());
  CHECK_THAT(none.cause, Contains("no clear configuration was found at any of 2 goals"));
}

TEST_CASE("postures at a region are all over it", "[search][any_of]") {
  WayRig rig;
  VectorXd end = rig.start;
  end[0] -= 1.0;
  scene::Goal goal = scene::pose_goal(rig.tip(end));
  goal.free_axis = Vector3d::UnitX();
  goal.low_m = Vector3d::Constant(-0.1);
  goal.high_m = Vector3d::Constant(0.1);
  goal.tolerance_rad = 0.05;
  double farthest = 0.0, most_turned = 0.0;
  for (std::uint64_t number = 0; number < 12; ++number) {
    // many places are not clear, so that others are drawn
    test::JointSpaceWorld world({{end, 0.5}});
    const search::Path path =
        search::Search(rig.arm, rig.settings).search({rig.start, {goal}, number}, world);
    REQUIRE(path.found());
    const geometry::SE3 tip = rig.tip(path.points.rightCols<1>());
    const Vector3d at = goal.pose.R().transpose() * (tip.p() - goal.pose.p());
    CHECK(at.cwiseAbs().maxCoeff() < 0.1 + goal.tolerance_m);
    CHECK((tip.R().col(0) - goal.pose.R().col(0)).norm() < goal.tolerance_rad);
    farthest = std::max(farthest, at.norm());
    most_turned = std::max(most_turned, AngleAxisd(goal.pose.R().transpose() * tip.R()).angle());
  }
  CHECK(farthest > 0.03);
  CHECK(most_turned > 0.5);
}
