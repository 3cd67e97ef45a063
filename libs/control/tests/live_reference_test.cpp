#include "hamelin/control/live_reference.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using control::LiveReference;
using control::ReferenceState;
using Eigen::VectorXd;

namespace {

constexpr double period_s = 0.001, duration_s = 2.0;

// Two joints that swing to and fro once: the end is the start.
scene::Goal there_and_back() {
  scene::JointTrajectory out;
  const int n = 101;
  out.time_s = VectorXd::LinSpaced(n, 0.0, duration_s);
  out.q.resize(2, n);
  out.v.resize(2, n);
  out.a.resize(2, n);
  const double w = 2.0 * std::acos(-1.0) / duration_s;
  for (int i = 0; i < n; ++i) {
    const double t = out.time_s[i];
    out.q.col(i) << 0.5 * (1.0 - std::cos(w * t)), 0.3 * std::sin(w * t);
    out.v.col(i) << 0.5 * w * std::sin(w * t), 0.3 * w * std::cos(w * t);
    out.a.col(i) << 0.5 * w * w * std::cos(w * t), -0.3 * w * w * std::sin(w * t);
  }
  return scene::trajectory_goal(out);
}

struct Follower {
  Follower() : live(2), q(goal.path.col(0)), v(VectorXd::Zero(2)) { live.start(goal); }
  const ReferenceState& update() { return live.update(period_s, q, v); }
  // An arm that is where the reference is.
  void follow(int ticks) {
    for (int k = 0; k < ticks; ++k) q = update().q;
  }

  scene::Goal goal = there_and_back();
  LiveReference live;
  VectorXd q, v;
};

}  // namespace

TEST_CASE("a reference keeps time for an arm that follows it, and ends after its duration",
          "[control][trajectory]") {
  Follower arm;
  arm.follow(1);
  CHECK(arm.live.state().time_s == 0.0);
  CHECK(arm.live.on_the_way());  // although the arm is where the trajectory ends
  arm.follow(700);
  const ReferenceState& now = arm.live.state();
  CHECK(now.time_s == Approx(0.7).epsilon(1e-12));
  CHECK(now.rate == 1.0);
  const double w = std::acos(-1.0);
  CHECK(now.q[0] == Approx(0.5 * (1.0 - std::cos(0.7 * w))).epsilon(1e-6));
  CHECK(now.v[0] == Approx(0.5 * w * std::sin(0.7 * w)).epsilon(1e-6));
  CHECK(now.a[0] == Approx(0.5 * w * w * std::cos(0.7 * w)).epsilon(1e-4));
  arm.follow(1301);
  CHECK(now.ended);
  CHECK_FALSE(arm.live.on_the_way());
  CHECK(now.v == VectorXd::Zero(2));
  CHECK((now.q - arm.goal.q).norm() < 1e-12);
}

TEST_CASE("a reference slows down for an arm that is held up, waits, and goes on",
          "[control][trajectory]") {
  Follower arm;
  arm.follow(400);
  const VectorXd held = arm.q;
  double last_s = arm.live.state().time_s;
  VectorXd last_q = arm.live.state().q, last_v = arm.live.state().v;
  for (int k = 0; k < 2000; ++k) {
    arm.q = held;
    const ReferenceState& now = arm.update();
    CHECK(now.time_s >= last_s);
    // its own derivatives: the velocity contains the rate, the acceleration its change
    CHECK((now.q - last_q - 0.5 * period_s * (now.v + last_v)).norm() < 1e-7);
    CHECK(((now.v - last_v) / period_s - now.a).norm() < 0.1);
    CHECK(now.error < 0.1);
    last_s = now.time_s;
    last_q = now.q;
    last_v = now.v;
  }
  CHECK(arm.live.state().rate < 0.01);
  const double waited_s = arm.live.state().time_s;
  CHECK(waited_s < 0.4 + 0.2);
  arm.follow(1000);
  CHECK(arm.live.state().rate == 1.0);
  CHECK(arm.live.state().time_s > waited_s + 0.9);
}

TEST_CASE("a reference goes on where an arm that has left the trajectory comes near to it again",
          "[control][trajectory]") {
  Follower arm;
  arm.follow(300);
  arm.q += Eigen::Vector2d(0.0, 0.5);
  for (int k = 0; k < 500; ++k) (void)arm.update();
  CHECK_FALSE(arm.live.on_the_way());
  CHECK(arm.live.state().time_s < 0.36);
  CHECK(arm.live.state().rate == 0.0);
  // at 1.2 s, half as fast
  VectorXd a(2);
  arm.goal.trajectory->at(1.2, arm.q, arm.v, a);
  arm.v *= 0.5;
  const ReferenceState& now = arm.update();
  CHECK(now.time_s == Approx(1.2).margin(1e-3));
  CHECK(now.rate == Approx(0.5).margin(1e-2));
  CHECK(now.v.isApprox(arm.v, 1e-2));
  CHECK(arm.live.on_the_way());
}

TEST_CASE("an arm far from a trajectory is expected at its begin", "[control][trajectory]") {
  Follower arm;
  arm.q = Eigen::Vector2d(-1.0, -1.0);
  for (int k = 0; k < 100; ++k) (void)arm.update();
  CHECK(arm.live.state().time_s == 0.0);
  CHECK(arm.live.state().v == VectorXd::Zero(2));
  arm.q = arm.goal.path.col(0);
  arm.follow(200);
  CHECK(arm.live.state().rate == Approx(1.0));
  CHECK(arm.live.state().time_s == Approx(0.2 - 0.05).margin(0.01));
}

TEST_CASE("a reference does not allocate", "[control][trajectory]") {
  test::require_allocation_count();
  Follower arm;
  arm.follow(10);
  CHECK(test::allocations_in([&] {
          for (int k = 0; k < 500; ++k) (void)arm.update();
          arm.q.array() += 0.5;
          for (int k = 0; k < 500; ++k) (void)arm.update();
        }) == 0);
}
