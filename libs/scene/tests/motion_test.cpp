#include "hamelin/scene/motion.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/geometry/so3.hpp"
#include "hamelin/scene/obstacles.hpp"
#include "hamelin/test/robots.hpp"
#include "hamelin/test/scene_queries.hpp"
#include "hamelin/test/temporary.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;
using Catch::Matchers::Contains;
using Catch::Matchers::Equals;
using Eigen::Matrix3d;
using Eigen::Vector3d;

Quaternion quaternion(const Vector3d& rotation_vector) {
  const Eigen::Vector4d q = geometry::quaternion_wxyz(geometry::SO3::exp(rotation_vector).R());
  return {q[0], q[1], q[2], q[3]};
}

// Way-points at uneven times that turn by less than half a turn from one to the next.
std::vector<Waypoint> random_waypoints(Rng& rng, int count, bool closed = false) {
  std::vector<Waypoint> out;
  double time = rng.uniform(-1.0, 1.0);
  for (int i = 0; i < count; ++i) {
    out.push_back({time, test::random_vector(rng, 0.5), quaternion(test::random_vector(rng, 0.6))});
    time += rng.uniform(0.1, 0.6);
  }
  if (closed) {
    out.back().position_m = out.front().position_m;
    out.back().quaternion_wxyz = out.front().quaternion_wxyz;
  }
  return out;
}

std::shared_ptr<const WaypointPath> random_path(Rng& rng, bool repeat = false) {
  WaypointPath::Options options;
  options.repeat = repeat;
  return std::make_shared<WaypointPath>(random_waypoints(rng, 8, repeat), options, "path");
}

Matrix3d rotation(const Waypoint& w) {
  return Eigen::Quaterniond(w.quaternion_wxyz[0], w.quaternion_wxyz[1], w.quaternion_wxyz[2],
                            w.quaternion_wxyz[3])
      .toRotationMatrix();
}

geometry::SE3 random_pose(Rng& rng) {
  return {geometry::SO3::exp(test::random_vector(rng, 1.5)).R(), test::random_vector(rng, 0.5)};
}

// Sine in way-points in a line in a path that repeats: each frame fixed to the next.
Frame nested_frames(Rng& rng) {
  Frame outer{random_pose(rng), WaypointMotion{random_path(rng, true)}, nullptr};
  Frame line{random_pose(rng), LinearMotion{test::random_vector(rng, 0.4), 0.0, 50.0},
             std::make_shared<Frame>(outer)};
  Frame path{random_pose(rng), WaypointMotion{random_path(rng, true)},
             std::make_shared<Frame>(line)};
  return {random_pose(rng), SineMotion{test::random_vector(rng, 0.2), rng.uniform(1.0, 3.0)},
          std::make_shared<Frame>(path)};
}

std::string refusal(const std::vector<Waypoint>& waypoints, const WaypointPath::Options& options) {
  try {
    const WaypointPath path(waypoints, options, "here");
  } catch (const Error& e) {
    return e.what();
  }
  return "accepted";
}

}  // namespace

TEST_CASE("a path goes through its way-points and rests before the first and after the last",
          "[scene][property]") {
  Rng rng(1);
  for (int trial = 0; trial < 20; ++trial) {
    const auto path = random_path(rng);
    for (const Waypoint& w : path->waypoints()) {
      const WaypointPath::State at = path->at(w.time_s);
      CHECK((at.position - w.position_m).norm() < 1e-14);
      CHECK((at.rotation - rotation(w)).norm() < 1e-14);
    }
    for (const bool before : {true, false}) {
      const Waypoint& end = before ? path->waypoints().front() : path->waypoints().back();
      const WaypointPath::State at = path->at(end.time_s + (before ? -3.0 : 3.0));
      CHECK(at.position == end.position_m);
      CHECK((at.rotation - rotation(end)).norm() < 1e-14);
      CHECK(at.velocity.isZero(0.0));
      CHECK(at.acceleration.isZero(0.0));
      CHECK(at.angular_velocity.isZero(0.0));
    }
    // velocity continues into the rest at both ends
    CHECK(path->at(path->waypoints().front().time_s).velocity.norm() < 1e-13);
    CHECK(path->at(path->waypoints().back().time_s - 1e-9).velocity.norm() < 1e-6);
  }
}

TEST_CASE("velocity, acceleration and rate of a path are differences of its poses",
          "[scene][property]") {
  Rng rng(2);
  const double h = 1e-5;
  for (int trial = 0; trial < 20; ++trial) {
    const auto path = random_path(rng, trial % 2 == 0);
    const double first = path->waypoints().front().time_s, last = path->waypoints().back().time_s;
    for (int i = 0; i < 50; ++i) {
      const double t = rng.uniform(first, last);
      const bool at_knot =
          std::any_of(path->waypoints().begin(), path->waypoints().end(),
                      [&](const auto& w) { return std::abs(w.time_s - t) < 2 * h; });
      if (at_knot) continue;
      const auto before = path->at(t - h), now = path->at(t), after = path->at(t + h);
      CHECK((now.velocity - (after.position - before.position) / (2 * h)).norm() < 1e-6);
      CHECK((now.acceleration - (after.velocity - before.velocity) / (2 * h)).norm() < 1e-6);
      const Vector3d rate =
          geometry::SO3(after.rotation * before.rotation.transpose()).log() / (2 * h);
      CHECK((now.angular_velocity - rate).norm() < 1e-7);
    }
    // no jump of position or velocity anywhere, way-points included
    for (const Waypoint& w : path->waypoints()) {
      const auto before = path->at(w.time_s - 1e-9), after = path->at(w.time_s + 1e-9);
      CHECK((after.position - before.position).norm() < 1e-7);
      if (trial % 2 == 0 && (w.time_s == first || w.time_s == last)) continue;
      CHECK((after.velocity - before.velocity).norm() < 1e-5);
    }
  }
}

TEST_CASE("a path does not overshoot its way-points, axis by axis", "[scene][property]") {
  Rng rng(3);
  for (int trial = 0; trial < 50; ++trial) {
    const auto path = random_path(rng, trial % 2 == 0);
    const auto w = path->waypoints();
    for (std::size_t i = 0; i + 1 < w.size(); ++i) {
      const Vector3d low = w[i].position_m.cwiseMin(w[i + 1].position_m),
                     high = w[i].position_m.cwiseMax(w[i + 1].position_m);
      for (int k = 0; k <= 50; ++k) {
        const Vector3d p =
            path->at(w[i].time_s + k / 50.0 * (w[i + 1].time_s - w[i].time_s)).position;
        REQUIRE((p.array() >= low.array() - 1e-14).all());
        REQUIRE((p.array() <= high.array() + 1e-14).all());
      }
    }
  }
}

TEST_CASE("slopes are weighted harmonic means of the chords", "[scene][unit]") {
  // docs/theory.md (11.41) by hand: chords 1 and 4 over 1 s and 2 s; w1 = 5, w2 = 4.
  const std::vector<Waypoint> points{
      {0.0, {0.0, 0.0, 0.0}}, {1.0, {1.0, 1.0, 0.0}}, {3.0, {9.0, -1.0, 0.0}}};
  const WaypointPath path(points, {}, "path");
  const Vector3d v = path.at(1.0).velocity;
  CHECK(v.x() == Approx(9.0 / (5.0 / 1.0 + 4.0 / 4.0)).epsilon(1e-14));
  CHECK(v.y() == 0.0);  // a turning point
  CHECK(v.z() == 0.0);
}

TEST_CASE("a path that repeats has its period, with continuous velocity", "[scene][property]") {
  Rng rng(4);
  for (int trial = 0; trial < 20; ++trial) {
    const auto path = random_path(rng, true);
    const double first = path->waypoints().front().time_s,
                 period = path->waypoints().back().time_s - first;
    for (int i = 0; i < 20; ++i) {
      const double t = rng.uniform(first, first + period);
      for (const int turns : {1, 7}) {
        CHECK((path->at(t).position - path->at(t + turns * period).position).norm() < 1e-12);
        CHECK((path->at(t).rotation - path->at(t + turns * period).rotation).norm() < 1e-12);
      }
    }
    const double joint = first + period;
    CHECK((path->at(joint - 1e-9).velocity - path->at(joint + 1e-9).velocity).norm() < 1e-5);
    CHECK(path->at(first - 1.0).velocity.isZero(0.0));
  }
}

TEST_CASE("bounds of a path hold and are tight", "[scene][property]") {
  Rng rng(5);
  for (int trial = 0; trial < 20; ++trial) {
    const auto path = random_path(rng, trial % 2 == 0);
    double speed = 0.0, rate = 0.0, distance = 0.0;
    const double first = path->waypoints().front().time_s, last = path->waypoints().back().time_s;
    for (int k = 0; k <= 20000; ++k) {
      const auto at = path->at(first + k / 20000.0 * (last - first));
      speed = std::max(speed, at.velocity.norm());
      rate = std::max(rate, at.angular_velocity.norm());
      distance = std::max(distance, at.position.norm());
    }
    CHECK(speed <= path->speed_max() * (1 + 1e-12));
    CHECK(speed >= 0.97 * path->speed_max());
    CHECK(rate == Approx(path->rate_max()).epsilon(1e-9));
    CHECK(distance <= path->distance_max() * (1 + 1e-12));
    CHECK(distance >= 0.8 * path->distance_max());
  }
}

TEST_CASE("velocities of frames in frames are differences of their poses", "[scene][property]") {
  Rng rng(6);
  const double h = 1e-5;
  int compared = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const Frame frame = nested_frames(rng);
    for (int i = 0; i < 20; ++i) {
      const double t = rng.uniform(2.0, 9.0);
      const MotionState before = motion_at(frame, t - h), now = motion_at(frame, t),
                        after = motion_at(frame, t + h);
      // at way-points the acceleration jumps
      if ((after.acceleration - before.acceleration).norm() > 0.02) continue;
      ++compared;
      CHECK((now.velocity - (after.pose.p() - before.pose.p()) / (2 * h)).norm() < 1e-6);
      CHECK((now.acceleration - (after.velocity - before.velocity) / (2 * h)).norm() < 1e-5);
      const Vector3d rate =
          geometry::SO3(after.pose.R() * before.pose.R().transpose()).log() / (2 * h);
      CHECK((now.angular_velocity - rate).norm() < 1e-6);
      // a point that moves with the frame
      const Vector3d local = test::random_vector(rng, 0.4);
      const Vector3d v = (after.pose * local - before.pose * local) / (2 * h);
      CHECK((now.velocity_at(now.pose * local) - v).norm() < 1e-6);
    }
  }
  CHECK(compared > 200);
}

TEST_CASE("bounds of frames and of obstacles hold at all times", "[scene][property]") {
  Rng rng(7);
  for (int trial = 0; trial < 20; ++trial) {
    Obstacle box;
    static_cast<Frame&>(box) = nested_frames(rng);
    box.shape = Shape::box;
    box.size_m = {0.2, 0.4, 0.1};
    const MotionBounds bounds = motion_bounds(box);
    const double fastest = max_speed(box);
    double speed = 0.0, rate = 0.0, corner = 0.0;
    for (int k = 0; k < 5000; ++k) {
      const MotionState at = motion_at(box, -1.0 + 0.002 * k);
      speed = std::max(speed, at.velocity.norm());
      rate = std::max(rate, at.angular_velocity.norm());
      corner = std::max(corner, at.velocity_at(at.pose * Vector3d(0.5 * box.size_m)).norm());
      REQUIRE(at.pose.p().norm() <= bounds.distance * (1 + 1e-12));
    }
    CHECK(speed <= bounds.speed * (1 + 1e-12));
    CHECK(rate <= bounds.rate * (1 + 1e-12));
    CHECK(corner <= fastest * (1 + 1e-12));
  }
  // A single turning frame: the bound is that of a point on its ball.
  WaypointPath::Options options;
  const std::vector<Waypoint> turn{{0.0, Vector3d::Zero(), quaternion(Vector3d::Zero())},
                                   {1.0, Vector3d::Zero(), quaternion({0.0, 0.0, 1.5})}};
  Obstacle ball;
  ball.radius_m = 0.2;
  ball.motion = WaypointMotion{std::make_shared<WaypointPath>(turn, options, "path")};
  ball.pose = {Matrix3d::Identity(), {0.6, 0.0, 0.0}};
  CHECK(max_speed(ball) == Approx(1.5 * (0.6 + 0.2)).epsilon(1e-12));
  CHECK(motion_at(ball, 0.5).velocity.norm() == Approx(1.5 * 0.6).epsilon(1e-12));
}

TEST_CASE("extrapolation keeps velocities, and an acceleration for 1 s", "[scene][unit]") {
  const MotionState now{{geometry::SO3::exp({0.1, 0.2, 0.3}).R(), {1.0, 2.0, 3.0}},
                        {0.3, -0.2, 0.1},
                        {0.5, 1.0, -2.0},
                        {0.0, 0.4, 0.6}};
  for (const double tau : {0.0, 0.3, 1.0, 2.5}) {
    CAPTURE(tau);
    const MotionState straight = extrapolated(now, tau, false), bent = extrapolated(now, tau, true);
    CHECK((straight.pose.p() - now.pose.p() - tau * now.velocity).norm() < 1e-14);
    CHECK(straight.velocity == now.velocity);
    CHECK(straight.acceleration.isZero(0.0));
    // docs/theory.md (11.43) with the acceleration for the first second only
    const double s = std::min(tau, 1.0);
    const Vector3d p = now.pose.p() + now.velocity * s + 0.5 * s * s * now.acceleration +
                       (tau - s) * (now.velocity + now.acceleration);
    CHECK((bent.pose.p() - p).norm() < 1e-14);
    CHECK((bent.velocity - now.velocity - s * now.acceleration).norm() < 1e-14);
    CHECK(bent.acceleration.isZero(0.0) == (tau > 1.0));
    const Vector3d turned = tau * now.angular_velocity;
    const Matrix3d R =
        Eigen::AngleAxisd(turned.norm(), now.angular_velocity.normalized()).toRotationMatrix() *
        now.pose.R();
    for (const MotionState& state : {straight, bent}) {
      CHECK((state.pose.R() - R).norm() < 1e-14);
      CHECK(state.angular_velocity == now.angular_velocity);
    }
  }
  CHECK(extrapolated(now, -1.0, true).pose.p() == now.pose.p());
}

TEST_CASE("an obstacle is predicted as it says", "[scene][property]") {
  Rng rng(8);
  for (int trial = 0; trial < 20; ++trial) {
    Obstacle o;
    static_cast<Frame&>(o) = nested_frames(rng);
    o.radius_m = 0.1;
    const double now = rng.uniform(2.0, 5.0), ahead = rng.uniform(0.05, 1.8);
    const MotionState present = motion_at(o, now);
    const auto predicted = [&](Prediction prediction, double s) {
      o.prediction = prediction;
      return placed_at(o, {now, s});
    };
    o.speed_max_m_s = 1.7;
    for (const Prediction any : {Prediction::path, Prediction::constant_acceleration,
                                 Prediction::constant_velocity, Prediction::speed_bound}) {
      CHECK(predicted(any, 0.0).pose.p() == present.pose.p());
      CHECK(predicted(any, 0.0).nearer_m == 0.0);
    }
    const Placed path = predicted(Prediction::path, ahead);
    CHECK(path.pose.p() == motion_at(o, now + ahead).pose.p());
    CHECK(path.nearer_m == 0.0);
    const Placed accelerated = predicted(Prediction::constant_acceleration, ahead);
    CHECK(accelerated.pose.p() == extrapolated(present, ahead, true).pose.p());
    const Placed straight = predicted(Prediction::constant_velocity, ahead);
    CHECK(straight.pose.p() == extrapolated(present, ahead, false).pose.p());
    CHECK(straight.pose.p() != accelerated.pose.p());
    const Placed bounded = predicted(Prediction::speed_bound, ahead);
    CHECK(bounded.pose.p() == present.pose.p());
    CHECK(bounded.nearer_m == Approx(1.7 * ahead));

    // No point of what is predicted is faster than max_speed says.
    for (const Prediction any :
         {Prediction::path, Prediction::constant_acceleration, Prediction::constant_velocity}) {
      const double bound = (o.prediction = any, max_speed(o, {now, 0.0})), h = 1e-4;
      for (double s = h; s < 1.8; s += 0.01) {
        const geometry::SE3 a = placed_at(o, {now, s}).pose, b = placed_at(o, {now, s + h}).pose;
        const Vector3d rim = 0.1 * test::random_direction(rng);
        REQUIRE((b * rim - a * rim).norm() / h <= bound * (1 + 1e-6));
      }
    }
    o.prediction = Prediction::speed_bound;
    CHECK(max_speed(o, {now, 0.0}) == 1.7);
  }
}

TEST_CASE("an observed motion goes on from where the obstacle was seen", "[scene][unit]") {
  Obstacle o;
  o.radius_m = 0.1;
  o.pose = {Matrix3d::Identity(), {0.5, 0.0, 0.0}};
  o.motion = ObservedMotion{2.0, {0.1, 0.0, 0.0}, {0.0, 0.4, 0.0}, {0.0, 0.0, 0.5}};
  CHECK(motion_at(o, 2.0).pose.p() == o.pose.p());
  CHECK(motion_at(o, 1.0).pose.p() == o.pose.p());  // before it was seen: where it was seen
  CHECK((motion_at(o, 2.5).pose.p() - Vector3d(0.55, 0.05, 0.0)).norm() < 1e-15);
  CHECK((motion_at(o, 4.0).pose.p() - Vector3d(0.7, 0.2 + 0.4, 0.0)).norm() < 1e-15);
  CHECK((motion_at(o, 4.0).velocity - Vector3d(0.1, 0.4, 0.0)).norm() < 1e-15);
  CHECK((motion_at(o, 4.0).pose.R() - geometry::SO3::exp({0.0, 0.0, 1.0}).R()).norm() < 1e-14);
  CHECK(max_speed(o) == Approx(0.1 + 0.4 + 0.5 * 0.1));
  CHECK(moves(o));
  // Scenes state how obstacles move, not how they were seen to move.
  CHECK_THROWS_WITH(to_json(o),
                    "motion: was observed in a running loop, expected one that a scene can state: "
                    "sine, linear or waypoints");
}

TEST_CASE("obstacles are attached by name, in any order, and circles are refused",
          "[scene][unit]") {
  std::vector<Obstacle> list(3);
  list[0].name = "cup";
  list[0].attached_to = "tray";
  list[0].pose = {Matrix3d::Identity(), {0.0, 0.0, 0.1}};
  list[1].name = "tray";
  list[1].attached_to = "cart";
  list[1].pose = {geometry::SO3::exp({0.0, 0.0, 0.5 * 3.14159265358979323846}).R(),
                  {1.0, 0.0, 0.0}};
  list[2].name = "cart";
  list[2].shape = Shape::frame;
  list[2].motion = LinearMotion{{0.5, 0.0, 0.0}};
  attach(list, "scene.json: /obstacles");
  CHECK((motion_at(list[0], 2.0).pose.p() - Vector3d(2.0, 0.0, 0.1)).norm() < 1e-15);
  CHECK(motion_at(list[0], 2.0).velocity == Vector3d(0.5, 0.0, 0.0));
  CHECK(moves(list[0]));
  // attaching again gives the same
  attach(list, "again");
  CHECK((motion_at(list[0], 2.0).pose.p() - Vector3d(2.0, 0.0, 0.1)).norm() < 1e-15);

  const auto fails = [&](std::vector<Obstacle> bad, const std::string& message) {
    CHECK_THROWS_WITH(attach(bad, "scene.json: /obstacles"), Equals(message));
  };
  auto bad = list;
  bad[0].attached_to = "table";
  fails(bad,
        "scene.json: /obstacles/0: obstacle 'cup' is attached to 'table', expected the name "
        "of an obstacle");
  bad = list;
  bad[2].name = "tray";
  fails(bad,
        "scene.json: /obstacles/0: obstacle 'cup' is attached to 'tray', expected a name that "
        "only one obstacle has");
  bad = list;
  bad[2].attached_to = "cup";
  CHECK_THROWS_WITH(attach(bad, "here"), Contains("in a circle") && Contains("here/"));
  bad = list;
  bad[2].attached_to = "cart";
  CHECK_THROWS_WITH(attach(bad, "here"), Contains("'cart' is attached to 'cart', in a circle"));
  // 32 in a chain are accepted, in any order; more would make each look-up slow
  for (const bool reversed : {false, true}) {
    std::vector<Obstacle> chain(34);
    for (std::size_t i = 0; i < chain.size(); ++i) {
      chain[i].name = std::to_string(i);
      if (i > 0) chain[i].attached_to = std::to_string(i - 1);
    }
    if (reversed) std::reverse(chain.begin(), chain.end());
    CHECK_THROWS_WITH(attach(chain, "here"), Contains("a chain of more than 32"));
    chain.erase(reversed ? chain.begin() : chain.end() - 1);
    CHECK_NOTHROW(attach(chain, "here"));
  }
}

TEST_CASE("a speed above the bound of the prediction is refused, with the parents' speed",
          "[scene][unit]") {
  std::vector<Obstacle> list(2);
  list[0].name = "cart";
  list[0].shape = Shape::frame;
  list[0].motion = LinearMotion{{0.5, 0.0, 0.0}};
  list[1].radius_m = 0.1;
  list[1].attached_to = "cart";
  list[1].prediction = Prediction::speed_bound;
  list[1].speed_max_m_s = 0.4;
  CHECK_NOTHROW(check(list[1], "here"));
  attach(list, "list");
  CHECK_THROWS_WITH(check(list[1], "here"),
                    Equals("here: its motion reaches 0.5 m/s, expected at most 0.4 m/s, the "
                           "speed_max of its prediction"));
  list[1].speed_max_m_s = 0.5;
  CHECK_NOTHROW(check(list[1], "here"));
  list[1].speed_max_m_s = 0.0;
  CHECK_THROWS_WITH(check(list[1], "here"), Contains("speed_max") && Contains("above 0"));
}

TEST_CASE("way-points that make no path are refused by index", "[scene][unit]") {
  const std::vector<Waypoint> good{{0.0, {0.0, 0.0, 0.0}},
                                   {1.0, {1.0, 0.0, 0.0}},
                                   {2.0, {2.0, 0.0, 0.0}},
                                   {3.0, {0.0, 0.0, 0.0}}};
  const WaypointPath::Options once;
  CHECK(refusal(good, once) == "accepted");
  const auto changed = [&](std::size_t i, const auto& change) {
    auto points = good;
    change(points[i]);
    return refusal(points, once);
  };
  CHECK(refusal({good[0]}, once) == "here: 1 way-points, expected two or more");
  CHECK(changed(2, [](auto& w) { w.time_s = 1.0; }) ==
        "here/2: time_s is 1 after 1, expected times that increase by 1e-6 or more");
  CHECK_THAT(changed(2, [](auto& w) { w.time_s = 0.5; }),
             Contains("here/2: time_s is 0.5 after 1"));
  CHECK_THAT(changed(1, [](auto& w) { w.time_s = std::nan(""); }), Contains("here/1: a number"));
  CHECK_THAT(changed(1, [](auto& w) { w.position_m.y() = infinity; }),
             Contains("here/1: a number is not finite or too large, expected at most 1e9"));
  CHECK_THAT(changed(1, [](auto& w) { w.position_m.y() = -2e9; }), Contains("here/1: a number"));
  CHECK(changed(3, [](auto& w) {
          w.quaternion_wxyz = {1.0, 1.0, 0.0, 0.0};
        }) == "here/3: the norm of its quaternion is 1.41421, expected 1");
  CHECK(changed(3, [](auto& w) { w.time_s = 20.0; }) ==
        "here/3: 18 s after the way-point before, expected at most 10 s (gap_max_s) where the pose "
        "changes");
  CHECK(changed(3, [](auto& w) {
          w.time_s = 20.0;
          w.position_m = {2.0, 0.0, 0.0};  // it waits
        }) == "accepted");
  WaypointPath::Options options;
  options.gap_max_s = 0.5;
  CHECK_THAT(refusal(good, options), Contains("here/1: 1 s after") && Contains("at most 0.5 s"));
  options = {};
  options.repeat = true;
  CHECK(refusal(good, options) == "accepted");
  auto open = good;
  open[3].position_m.z() = 1e-6;
  CHECK(refusal(open, options) ==
        "here/3: its pose is not that of the first way-point, expected the same for a path that "
        "repeats");
}

TEST_CASE("way-points are read from CSV and JSON", "[scene][unit]") {
  const test::TemporaryFolder folder;
  const auto csv = folder.put("walk.csv",
                              "\xEF\xBB\xBF# recorded\r\n\n"
                              "time_s, x_m ,y_m,z_m,qw,qx,qy,qz\r\n"
                              "0,1,2,3,1,0,0,0\n"
                              "  # a pause\n"
                              "0.5, 1.5,-2e-1,3,0.8,0,0.6,0");
  const auto points = read_waypoints(csv);
  REQUIRE(points.size() == 2);
  CHECK(points[0].position_m == Vector3d(1.0, 2.0, 3.0));
  CHECK(points[0].line == 4);
  CHECK(points[1].time_s == 0.5);
  CHECK(points[1].position_m == Vector3d(1.5, -0.2, 3.0));
  CHECK(points[1].quaternion_wxyz == Quaternion{0.8, 0.0, 0.6, 0.0});
  CHECK(points[1].line == 6);
  const auto positions =
      read_waypoints(folder.put("p.csv", "time_s,x_m,y_m,z_m\n0,0,0,0\n1,1,0,0\n"));
  CHECK(positions.at(1).quaternion_wxyz == Quaternion{1.0, 0.0, 0.0, 0.0});
  const std::string list =
      R"([{"time_s": 0, "position_m": [1, 2, 3]},
          {"time_s": 0.5, "position_m": [1.5, -0.2, 3], "quaternion_wxyz": [0.8, 0, 0.6, 0]}])";
  for (const std::string& text : {list, "{\"waypoints\": " + list + "}"}) {
    const auto read = read_waypoints(folder.put("walk.json", text));
    REQUIRE(read.size() == 2);
    for (std::size_t i = 0; i < 2; ++i) {
      CHECK(read[i].time_s == points[i].time_s);
      CHECK(read[i].position_m == points[i].position_m);
      CHECK(read[i].quaternion_wxyz == points[i].quaternion_wxyz);
    }
  }
  const WaypointPath path = read_waypoint_path(csv, {});
  CHECK(path.file() == csv);
  CHECK(path.waypoints().size() == 2);
}

TEST_CASE("bad files of way-points are refused in one line with file and place", "[scene][unit]") {
  const test::TemporaryFolder folder;
  const std::string head = "time_s,x_m,y_m,z_m\n", row = "0,0,0,0\n";
  const std::vector<std::pair<std::string, std::string>> cases{
      {"", ": no header, expected time_s,x_m,y_m,z_m or time_s,x_m,y_m,z_m,qw,qx,qy,qz"},
      {"# nothing\n", ": no header, expected"},
      {"0,0,0,0\n", ": line 1: the header is '0,0,0,0', expected time_s,x_m,y_m,z_m or"},
      {"time_s,x_m,z_m,y_m\n", ": line 1: the header is 'time_s,x_m,z_m,y_m'"},
      {"time_s,x_m,y_m\n", ": line 1: the header is 'time_s,x_m,y_m'"},
      {"time_s,x_m,y_m,z_m,qw\n", ": line 1: the header is"},
      {head, ": 0 way-points, expected two or more"},
      {head + row, ": 1 way-points, expected two or more"},
      {head + row + "1,2,3\n", ": line 3: 3 cells, expected 4 as in the header"},
      {head + row + "1,2,3,4,5\n", ": line 3: 5 cells, expected 4 as in the header"},
      {head + row + "1,,0,0\n", ": line 3: x_m is '', expected a finite number"},
      {head + row + "1,0,one,0\n", ": line 3: y_m is 'one', expected a finite number"},
      {head + row + "1,0,0 0,0\n", ": line 3: y_m is '0 0', expected a finite number"},
      {head + row + "1,0,0,nan\n", ": line 3: z_m is 'nan', expected a finite number"},
      {head + row + "inf,0,0,0\n", ": line 3: time_s is 'inf', expected a finite number"},
      {head + row + "1e999,0,0,0\n", ": line 3: time_s is '1e999', expected a finite number"},
      {head + row + "1,2e9,0,0\n", ": line 3: a number is not finite or too large"},
      {head + row + "\n0,1,0,0\n", ": line 4: time_s is 0 after 0, expected times that increase"},
      {head + row + "1,0,0," + std::string(1000, '\x01') + "\n", ": line 3: z_m is '"},
      {"time_s,x_m,y_m,z_m,qw,qx,qy,qz\n0,0,0,0,1,0,0,0\n1,0,0,0,2,0,0,0\n",
       ": line 3: the norm of its quaternion is 2, expected 1"},
      {"[]", ": 0 way-points, expected two or more"},
      {"[", ": line 1"},
      {"{}", ": /waypoints: expected a list of way-points"},
      {R"({"waypoints": {}})", ": /waypoints: expected a list of way-points"},
      {R"({"points": []})", ": has the key 'points', expected waypoints"},
      {R"([1])", ": /0: expected an object with time_s and position_m"},
      {R"([{"position_m": [0, 0, 0]}])", ": /0/time_s: expected a number"},
      {R"([{"time_s": "0", "position_m": [0, 0, 0]}])", ": /0/time_s: expected a number"},
      {R"({"waypoints": [{"time_s": 0}]})",
       ": /waypoints/0/position_m: expected a list of 3 numbers"},
      {R"([{"time_s": 0, "position_m": [0, 0]}])", ": /0/position_m: expected a list of 3 numbers"},
      {R"([{"time_s": 0, "position_m": [0, 0, null]}])", ": /0/position_m: expected a list of 3"},
      {R"([{"time_s": 0, "position_m": [0, 0, 0], "quaternion_wxyz": [1]}])",
       ": /0/quaternion_wxyz: expected a list of 4 numbers"},
      {R"([{"time_s": 0, "position_m": [0, 0, 0], "q": 1}])",
       ": /0: has the key 'q', expected time_s, position_m, quaternion_wxyz"},
      {R"({"waypoints": [{"time_s": 1, "position_m": [0,0,0]}, {"time_s": 1, "position_m": [0,0,0]}]})",
       ": /waypoints/1: time_s is 1 after 1"},
  };
  for (const auto& [text, expected] : cases) {
    const auto file = folder.put("walk.csv", text);
    std::string message = "accepted";
    try {
      (void)read_waypoint_path(file, {});
    } catch (const Error& e) {
      message = e.what();
    }
    CAPTURE(text, message, expected);
    CHECK(message.rfind(file.string() + expected, 0) == 0);
    CHECK(message.find('\n') == std::string::npos);
    CHECK(message.size() < file.string().size() + 250);
  }
  CHECK_THROWS_WITH(read_waypoints(folder.path() / "none.csv"), Contains("none.csv"));
  CHECK_THROWS_WITH(read_waypoints(folder.path()), Contains(folder.path().string()));
  const auto huge = folder.put("huge.csv", head);
  std::filesystem::resize_file(huge, (std::uintmax_t{64} << 20U) + 1);
  CHECK_THROWS_WITH(read_waypoints(huge), Contains("67108865 bytes, expected at most 67108864"));
}
