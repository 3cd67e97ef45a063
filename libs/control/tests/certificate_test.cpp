#include "hamelin/control/certificate.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <vector>

#include "hamelin/model/make_chain.hpp"
#ifdef HAMELIN_WITH_FCL
#include "certificate_motions.hpp"
#endif

using namespace hamelin;
using control::Certificate;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

/// A chain of one capsule of 1 m along y that turns about z, and obstacles.
struct Rig {
  explicit Rig(scene::Obstacle obstacle) : Rig(std::vector{std::move(obstacle)}) {}
  explicit Rig(std::vector<scene::Obstacle> obstacles)
      : model(model::make_chain({1, "z", 1.0, 1.0, 0.05})),
        environment(std::nullopt, obstacles, geometry::SE3{}, model.reach(), limit),
        certificate(model, limit, nullptr, 0.0, obstacles.size()),
        ws(model),
        arm(model),
        next(model) {}

  Certificate::Verdict turn(double from, double to, double t0, double t1,
                            double acceleration = 0.0) {
    const VectorXd q = VectorXd::Constant(1, from), p = VectorXd::Constant(1, to);
    const VectorXd v =
        VectorXd::Constant(1, (to - from) / (t1 - t0) - 0.5 * acceleration * (t1 - t0));
    const VectorXd w = VectorXd::Constant(1, v[0] + acceleration * (t1 - t0));
    dynamics::forward_kinematics(model, ws, q);
    arm.place(model, ws);
    dynamics::forward_kinematics(model, ws, p);
    next.place(model, ws);
    before = {environment.clearance(arm.view(), t0, limit)};
    after = {environment.clearance(next.view(), t1, limit)};
    return certificate.check(ws, environment, {q, v, t0, arm.view(), before, {}},
                             {p, w, t1, next.view(), after, {}});
  }

  static constexpr double limit = 0.5;
  model::Model model;
  scene::Environment environment;
  Certificate certificate;
  dynamics::Workspace ws;
  scene::PlacedShapes arm, next;
  std::vector<double> before, after;
};

scene::Obstacle ball(const Vector3d& at, double radius) {
  scene::Obstacle obstacle;
  obstacle.name = "ball";
  obstacle.radius_m = radius;
  obstacle.pose = {Eigen::Matrix3d::Identity(), at};
  return obstacle;
}

}  // namespace

TEST_CASE("a small turn away from everything is proved clear, with nearly its own clearance",
          "[control][unit]") {
  Rig rig(ball({0.2, 1.0, 0.0}, 0.1));
  const auto verdict = rig.turn(0.0, 0.001, 0.0, 0.001);
  CHECK(rig.before[0] == Approx(0.05));
  CHECK(verdict.certified);
  // the tip moves by 1 mm along the gradient: the bound is the clearance at the start, less the
  // curvature term
  CHECK(verdict.margin_m > 0.05 - 1e-6);
  CHECK(verdict.margin_m <= 0.05);
}

TEST_CASE("a capsule that sweeps through a ball between two clear nodes is detected",
          "[control][unit]") {
  Rig rig(ball({-0.5, 0.5, 0.0}, 0.02));
  const auto verdict = rig.turn(0.2, 1.4, 0.0, 0.01);
  REQUIRE(rig.before[0] > 0.1);
  REQUIRE(rig.after[0] > 0.1);
  CHECK_FALSE(verdict.certified);
  CHECK(verdict.contact);
}

TEST_CASE("clearances down to the resolution are proved on a long motion", "[control][unit]") {
  // the closest approach to the ball, at the middle of the motion [m]
  for (const double gap : {1e-2, 1e-3, 2e-4}) {
    CAPTURE(gap);
    Rig rig(ball({0.0, 1.05 + 0.1 + gap, 0.0}, 0.1));
    const auto verdict = rig.turn(-0.3, 0.35, 0.0, 0.01);
    CHECK(verdict.certified);
    CHECK_FALSE(verdict.contact);
    CHECK(verdict.margin_m > 0.0);
    CHECK(verdict.margin_m <= gap + 1e-12);
  }
  Rig touching(ball({0.0, 1.05 + 0.1 + 1e-6, 0.0}, 0.1));
  CHECK_FALSE(touching.turn(-0.3, 0.35, 0.0, 0.01).certified);
}

TEST_CASE("the possible deviation of a trajectory from its line counts in full",
          "[control][unit]") {
  // forth and back within one step: at its middle the joint has turned by a h²/8 = 0.02 rad, the
  // tip moved by 2 cm
  Rig rig(ball({-0.01 - 0.05 - 0.1, 1.0, 0.0}, 0.1));
  CHECK(rig.turn(0.0, 0.0, 0.0, 0.01).certified);
  CHECK_FALSE(rig.turn(0.0, 0.0, 0.0, 0.01, -1600.0).certified);
  Rig farther(ball({-0.05 - 0.05 - 0.1, 1.0, 0.0}, 0.1));
  CHECK(farther.turn(0.0, 0.0, 0.0, 0.01, -1600.0).certified);
}

TEST_CASE("an obstacle counts with its speed, and from the start of the step in which it appears",
          "[control][unit]") {
  scene::Obstacle swinging = ball({0.0, 1.35, 0.0}, 0.1);
  swinging.motion =
      scene::SineMotion{{0.0, -0.3, 0.0}, 0.02};  // to the arm and back in half a period
  Rig rig(swinging);
  const auto verdict = rig.turn(0.0, 0.0, 0.0, 0.01);
  REQUIRE(rig.before[0] == Approx(0.2));
  REQUIRE(rig.after[0] == Approx(0.2));
  CHECK_FALSE(verdict.certified);
  CHECK(verdict.contact);

  // exists in the last third of a step, but the arm passes its place in the first: not proved, and
  // no contact
  scene::Obstacle sudden = ball({-0.5, 0.5, 0.0}, 0.02);
  sudden.appears_s = 0.007;
  Rig late(sudden);
  const auto passed = late.turn(0.5, 1.4, 0.0, 0.01);
  CHECK_FALSE(passed.certified);
  CHECK_FALSE(passed.contact);
  // the arm passes its place while it exists
  sudden.appears_s = 0.001;
  Rig early(sudden);
  CHECK(early.turn(0.5, 1.4, 0.0, 0.01).contact);
  // one that appears far away does not matter
  scene::Obstacle far = ball({0.0, -1.0, 0.0}, 0.1);
  far.appears_s = 0.007;
  CHECK(Rig(far).turn(0.5, 1.4, 0.0, 0.01).certified);
}

TEST_CASE("a fast obstacle that is far away does not weaken the bound, a near one does",
          "[control][unit]") {
  const scene::Obstacle standing = ball({0.2, 1.0, 0.0}, 0.1);
  const auto alone = Rig(standing).turn(0.0, 0.001, 0.0, 0.001);
  REQUIRE(alone.certified);
  const auto with = [&](const Vector3d& at) {
    scene::Obstacle fast = ball(at, 0.1);
    fast.motion = scene::LinearMotion{{0.0, 0.0, 200.0}};  // 0.2 m in the step
    return Rig(std::vector{standing, fast}).turn(0.0, 0.001, 0.0, 0.001);
  };
  const auto far = with({-4.0, 0.0, 0.0});
  CHECK(far.certified);
  CHECK(far.margin_m == alone.margin_m);
  // 0.1 m from the arm: proved on pieces of the step, whose bounds count its speed
  const auto near = with({-0.25, 0.5, 0.0});
  CHECK(near.certified);
  CHECK(near.margin_m < 0.7 * alone.margin_m);
  const auto touching = with({0.0, 0.5, -0.25});
  CHECK_FALSE(touching.certified);
}

TEST_CASE("the travel of a prismatic joint without limits is bounded by its motion",
          "[control][unit]") {
  model::Robot robot = model::make_chain({2, "z", 0.2, 1.0, 0.05});
  robot.links[1].joint.type = model::JointType::prismatic;
  robot.links[1].joint.screw << Vector3d::Zero(), Vector3d::UnitY();
  const model::Model model(robot);
  // a turn about z with the slide extended by 4 m: the end of the last capsule is 4.4 m from the
  // axis
  scene::Obstacle post = ball({-4.4 * std::sin(0.05), 4.4 * std::cos(0.05), 0.0}, 0.04);
  const scene::Environment environment(std::nullopt, {post}, geometry::SE3{}, 10.0, 0.5);
  Certificate certificate(model, 0.5, nullptr, 0.0, 1);
  dynamics::Workspace ws(model);
  scene::PlacedShapes arm(model), next(model);
  const Eigen::Vector2d q(0.0, 4.0), p(0.1, 4.0);
  dynamics::forward_kinematics(model, ws, q);
  arm.place(model, ws);
  dynamics::forward_kinematics(model, ws, p);
  next.place(model, ws);
  std::vector<double> before, after;
  for (std::size_t s = 0; s < 2; ++s) {
    before.push_back(environment.clearance(arm.view().single(s), 0.0, 0.5));
    after.push_back(environment.clearance(next.view().single(s), 0.0, 0.5));
  }
  REQUIRE(before[1] > 0.1);
  REQUIRE(after[1] > 0.1);
  const VectorXd v = (p - q) / 0.01;
  const auto verdict = certificate.check(ws, environment, {q, v, 0.0, arm.view(), before, {}},
                                         {p, v, 0.01, next.view(), after, {}});
  CHECK_FALSE(verdict.certified);
  CHECK(verdict.contact);
}

#ifdef HAMELIN_WITH_FCL
TEST_CASE("no random motion is certified that dense sampling with FCL finds in contact",
          "[control][property]") {
  std::uint64_t seed = 1;
  for (test::ArmInMap& arm : test::arms_in_maps(std::filesystem::temp_directory_path())) {
    CAPTURE(arm.name);
    test::MotionJudge judge(std::move(arm), seed++);
    test::MotionCounts counts;
    judge.run(200, counts);
    CHECK(counts.contradictions == 0);
    CHECK(counts.motions > 150);
    CHECK(counts.contacts > 10);
    CHECK(counts.certified > counts.motions / 2);
    // free motions that are not certified: the clearance is smaller than the possible deviation
    // from the line
    CHECK(counts.free_uncertified < counts.motions / 4);
  }
}
#endif
