#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "hamelin/control/live_target.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using Catch::Contains;
using control::LiveTarget;
using control::StreamedTarget;
using control::TargetPose;
using control::TargetReceiver;
using control::TargetTwist;
using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

const Vector3d axis = Vector3d(1.0, -2.0, 0.5).normalized();

TargetPose at(double time_s, const Vector3d& p, double angle = 0.0) {
  return {time_s, {AngleAxisd(angle, axis).toRotationMatrix(), p}};
}

double angle_between(const Matrix3d& a, const Matrix3d& b) {
  return AngleAxisd(a.transpose() * b).angle();
}

// A goal, both ends of its stream, and a tip that stays where it is.
struct Stream {
  explicit Stream(const scene::TargetStream& bounds = {})
      : goal(scene::follow_goal(false, bounds)) {
    receiver.start(bounds);
    live.start(goal, tip);
  }
  const control::TargetState& state(double time_s) { return live.update(time_s, last, tip); }
  template <class Sample>
  void send(const Sample& sample) {
    last = receiver.take(sample);
  }
  template <class Sample>
  std::string refusal(const Sample& sample) {
    try {
      last = receiver.take(sample);
    } catch (const Error& e) {
      return e.what();
    }
    return "no error";
  }

  scene::Goal goal;
  TargetReceiver receiver;
  LiveTarget live;
  StreamedTarget last;
  geometry::SE3 tip{Matrix3d::Identity(), {0.1, 0.2, 0.3}};
};

}  // namespace

TEST_CASE("a target waits at the tip until something arrives", "[control][target]") {
  Stream stream;
  CHECK(stream.state(0.0).waiting);
  CHECK(stream.state(1.0).pose.p() == stream.tip.p());
  CHECK_FALSE(stream.live.state().lost);
  stream.send(at(1.0, {0.5, 0.0, 0.0}));
  CHECK_FALSE(stream.state(1.0).waiting);
  CHECK((stream.live.state().pose.p() - Vector3d(0.5, 0.0, 0.0)).norm() < 1e-15);
}

TEST_CASE("a target goes on with its last twist, for the longest gap, and then rests",
          "[control][target]") {
  Stream stream;
  TargetPose pose = at(2.0, {0.5, 0.0, 0.0}, 0.3);
  pose.velocity_m_s = Vector3d(0.1, -0.2, 0.3);
  pose.angular_velocity_rad_s = 0.5 * axis;
  stream.send(pose);
  for (const double ahead : {0.0, 0.05, 0.2}) {
    const control::TargetState& now = stream.state(2.0 + ahead);
    CHECK_FALSE(now.lost);
    CHECK((now.pose.p() - Vector3d(0.5 + 0.1 * ahead, -0.2 * ahead, 0.3 * ahead)).norm() < 1e-14);
    CHECK(angle_between(now.pose.R(), AngleAxisd(0.3 + 0.5 * ahead, axis).toRotationMatrix()) <
          1e-7);
    CHECK(now.velocity == *pose.velocity_m_s);
  }
  for (const double ahead : {0.201, 5.0}) {
    const control::TargetState& later = stream.state(2.0 + ahead);
    CHECK(later.lost);
    CHECK((later.pose.p() - Vector3d(0.52, -0.04, 0.06)).norm() < 1e-14);
    CHECK(later.velocity.isZero(0.0));
    CHECK(later.angular_velocity.isZero(0.0));
  }
  stream.send(at(9.0, {-0.5, 0.3, 0.2}));  // after a gap it may be anywhere
  CHECK_FALSE(stream.state(9.0).lost);
  CHECK(stream.live.state().pose.p().isApprox(Vector3d(-0.5, 0.3, 0.2)));
}

TEST_CASE("the twist of a target is estimated from its poses", "[control][target]") {
  const double amplitude = 0.25, omega = 0.8;  // 0.2 m/s
  Stream stream;
  double worst_m = 0.0, worst_m_s = 0.0, worst_rad_s = 0.0;
  int k = 0;
  for (double t = 0.0; t < 10.0; t += 0.001) {
    if (t >= 0.02 * k) {
      const double sent = 0.02 * k++;
      stream.send(at(sent, {0.5, amplitude * std::sin(omega * sent), 0.4}, 0.4 * sent));
    }
    const control::TargetState& now = stream.state(t);
    if (t < 2.0) continue;
    const Vector3d p(0.5, amplitude * std::sin(omega * t), 0.4),
        v(0.0, amplitude * omega * std::cos(omega * t), 0.0);
    worst_m = std::max(worst_m, (now.pose.p() - p).norm());
    worst_m_s = std::max(worst_m_s, (now.velocity - v).norm());
    worst_rad_s = std::max(worst_rad_s, (now.angular_velocity - 0.4 * axis).norm());
  }
  CHECK(worst_m < 5e-4);
  CHECK(worst_m_s < 5e-3);
  CHECK(worst_rad_s < 5e-3);
}

TEST_CASE("poses of a target that cannot be believed are refused, and nothing changes",
          "[control][target]") {
  Stream stream, undisturbed;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto send = [&](const TargetPose& pose) {
    stream.send(pose);
    undisturbed.send(pose);
  };
  send(at(0.0, {0.5, 0.0, 0.0}));
  send(at(0.02, {0.502, 0.0, 0.0}));
  TargetPose wrong = at(0.04, {0.504, nan, 0.0});
  CHECK(stream.refusal(wrong) == "target: the position is not finite, expected finite numbers");
  wrong = at(0.04, {0.504, 0.0, 0.0});
  wrong.velocity_m_s = Vector3d(nan, 0.0, 0.0);
  CHECK_THAT(stream.refusal(wrong), Contains("a velocity or acceleration is not finite"));
  CHECK_THAT(stream.refusal(at(nan, {0.504, 0.0, 0.0})), Contains("time_s is not finite"));
  CHECK(stream.refusal(at(0.02, {0.504, 0.0, 0.0})) ==
        "target: time_s is 0.02, expected a time after that of the last one, 0.02");
  CHECK_THAT(stream.refusal(at(0.04, {0.504, 0.2, 0.0})),
             Contains("the position jumps by") && Contains("expected at most 0.1 m"));
  CHECK_THAT(stream.refusal(at(0.04, {0.504, 0.0, 0.0}, 0.6)),
             Contains("the orientation jumps by 0.6 rad, expected at most 0.5 rad"));
  CHECK_THAT(stream.refusal(TargetTwist{0.04, {nan, 0.0, 0.0}}),
             Contains("the twist is not finite"));
  send(at(0.04, {0.504, 0.0, 0.0}));
  CHECK(stream.state(0.05).pose.p() == undisturbed.state(0.05).pose.p());
  CHECK(stream.state(0.05).velocity == undisturbed.state(0.05).velocity);
}

TEST_CASE("a twist moves a target on a leash from the tip, until it expires", "[control][target]") {
  scene::TargetStream bounds;
  bounds.leash_m = 0.04;
  bounds.leash_rad = 0.1;
  Stream stream(bounds);
  const auto run = [&](double from, double to, const Vector3d& v, const Vector3d& w) {
    for (double t = from; t < to; t += 0.001) {
      stream.send(TargetTwist{t, v, w});
      (void)stream.state(t);
    }
  };
  run(0.0, 0.1005, {0.2, 0.0, 0.0}, {0.0, 0.0, 0.5});
  CHECK((stream.live.state().pose.p() - stream.tip.p() - Vector3d(0.02, 0.0, 0.0)).norm() < 1e-9);
  CHECK(angle_between(stream.live.state().pose.R(),
                      AngleAxisd(0.05, Vector3d::UnitZ()).toRotationMatrix()) < 1e-7);
  run(0.101, 1.0, {0.2, 0.0, 0.0}, {0.0, 0.0, 0.5});  // the tip stays
  CHECK((stream.live.state().pose.p() - stream.tip.p()).norm() == Approx(0.04));
  CHECK(angle_between(stream.live.state().pose.R(), stream.tip.R()) == Approx(0.1));
  CHECK_FALSE(stream.live.state().lost);
  CHECK(stream.state(1.3).lost);  // nothing arrived for 0.3 s
  CHECK(stream.live.state().velocity.isZero(0.0));
  stream.send(TargetTwist{1.31});  // a joystick that is let go
  CHECK_FALSE(stream.state(1.32).lost);
  CHECK_FALSE(stream.state(9.0).lost);
}

TEST_CASE("a target that moves by its scene is where the scene says", "[control][target]") {
  scene::Goal goal = scene::follow_goal();
  goal.pose = {AngleAxisd(0.7, axis).toRotationMatrix(), {0.4, 0.0, 0.5}};
  goal.motion = scene::SineMotion{{0.0, 0.1, 0.0}, 4.0};
  LiveTarget live;
  live.start(goal, {});
  const long allocations = test::allocations_in([&] { (void)live.update(0.5, {}, {}); });
  CHECK(allocations == 0);
  const double omega = std::acos(-1.0) / 2.0;
  CHECK((live.state().pose.p() - Vector3d(0.4, 0.1 * std::sin(0.5 * omega), 0.5)).norm() < 1e-14);
  CHECK((live.state().velocity - Vector3d(0.0, 0.1 * omega * std::cos(0.5 * omega), 0.0)).norm() <
        1e-14);
  CHECK(live.state().pose.R() == goal.pose.R());
  CHECK_FALSE(live.state().waiting);
}
