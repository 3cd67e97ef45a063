#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/joint_space_world.hpp"
#include "hamelin/timing/blended_path.hpp"
#include "hamelin/timing/time_law.hpp"
#include "hamelin/timing/way_points.hpp"

using namespace hamelin;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

MatrixXd random_points(Index dof, Index count, Rng& rng) {
  MatrixXd points(dof, count);
  for (Index i = 0; i < count; ++i)
    for (Index j = 0; j < dof; ++j) points(j, i) = rng.uniform(-1.5, 1.5);
  return points;
}

// Blends over a share of what there is room for.
timing::BlendedPath blended(const MatrixXd& points, double share) {
  timing::BlendedPath path(points);
  for (Index i = 1; i <= path.corners(); ++i) path.set_half_length(i, share * path.share(i));
  return path;
}

timing::Limits limits_of(Index dof, double velocity, double acceleration, double torque) {
  timing::Limits out;
  out.velocity = VectorXd::Constant(dof, velocity);
  out.acceleration = VectorXd::Constant(dof, acceleration);
  if (torque > 0.0) out.torque = VectorXd::LinSpaced(dof, torque, 0.3 * torque);
  return out;
}

struct State {
  VectorXd q, v, a;
  explicit State(Index dof) : q(VectorXd::Zero(dof)), v(q), a(q) {}
};

State state_at(const timing::TimedPath& motion, double t) {
  State out(motion.curve.dof());
  timing::TimedPath::Cursor cursor;
  motion.at(t, out.q, out.v, out.a, cursor);
  return out;
}

}  // namespace

TEST_CASE("a blend is C2, and strays from its corner by no more than it says", "[timing][unit]") {
  Rng rng(11);
  for (int trial = 0; trial < 50; ++trial) {
    const timing::BlendedPath path = blended(random_points(5, 5, rng), rng.uniform(0.05, 0.95));
    const timing::Curve curve = path.curve();
    CHECK(curve.end() == Approx(path.length()).epsilon(1e-12));
    CHECK(curve.is_smooth());
    VectorXd q(5), dq(5), ddq(5), q2(5), dq2(5), ddq2(5), between(5), bend(5);
    constexpr double h = 1e-7;
    for (Index k = 1; k < curve.pieces(); ++k) {  // on both sides of each knot
      curve.at(curve.knot(k) - h, q, dq, ddq);
      curve.at(curve.knot(k) + h, q2, dq2, ddq2);
      CHECK((q2 - q).norm() < 1e-6);
      CHECK((dq2 - dq).norm() < 1e-4);
      CHECK((ddq2 - ddq).norm() < 1e-2);
    }
    for (Index i = 1; i <= path.corners(); ++i) {
      const double d = path.half_length(i), turn = path.turn(i).norm();
      curve.at(path.begin(i), q, dq, ddq);
      CHECK((q - path.points().col(i)).norm() <= d * turn / 6.0 * (1.0 + 1e-9));
      path.blend_at(i, 0.3 * d, between);
      curve.at(path.begin(i) + 0.3 * d, q, dq, ddq);
      CHECK((q - between).norm() < 1e-12);
      CHECK(ddq.norm() <= turn / d * (1.0 + 1e-9));
    }
    for (Index k = 0; k < curve.pieces(); ++k) {
      curve.bound_bend(curve.knot(k), curve.knot(k + 1), bend);
      for (int i = 0; i <= 20; ++i) {
        curve.at(curve.knot(k) + (curve.knot(k + 1) - curve.knot(k)) * (0.025 + 0.0475 * i), q, dq,
                 ddq);
        CHECK((ddq.cwiseAbs() - bend).maxCoeff() <= 1e-9);
      }
    }
  }
}

TEST_CASE("a straight motion takes the time of its slowest joint", "[timing][unit]") {
  const model::Model arm(model::make_chain({3}));
  MatrixXd points(3, 2);
  points.col(0) << 0.1, -0.4, 0.2;
  points.col(1) << 1.3, -0.9, 0.5;  // the first joint moves by 1.2
  timing::TimeLaw law(arm, limits_of(3, 1.5, 4.0, 0.0));
  timing::TimedPath motion;
  motion.curve = timing::BlendedPath(points).curve();
  REQUIRE(law.solve(motion));
  // it accelerates to 1.5 rad/s in 0.375 s, and keeps that speed in between
  CHECK(motion.duration_s() == Approx(1.2 / 1.5 + 1.5 / 4.0).epsilon(1e-2));
  CHECK(motion.duration_s() >= 1.2 / 1.5 + 1.5 / 4.0);
  CHECK(state_at(motion, motion.duration_s()).q.isApprox(points.col(1), 1e-12));
  CHECK(state_at(motion, motion.duration_s()).v.norm() < 1e-7);
}

TEST_CASE("a motion keeps all limits at all times, also at a lower rate", "[timing][property]") {
  Rng rng(5);
  const model::Model arm(model::make_chain({6}));
  dynamics::Workspace ws(arm);
  const timing::Limits limits = limits_of(6, 2.0, 12.0, 90.0);
  timing::TimeLaw law(arm, limits);
  int found = 0;
  for (int trial = 0; trial < 60; ++trial) {
    timing::TimedPath motion;
    motion.curve = blended(random_points(6, 2 + trial % 5, rng), rng.uniform(0.1, 0.9)).curve();
    if (!law.solve(motion)) continue;
    ++found;
    VectorXd tau(6);
    double most = 0.0;
    for (const double rate : {1.0, 0.7, 0.3, 0.0}) {
      for (int k = 0; k <= 1500; ++k) {
        const State at = state_at(motion, motion.duration_s() * k / 1500.0);
        dynamics::inverse_dynamics(arm, ws, at.q, VectorXd(rate * at.v),
                                   VectorXd(rate * rate * at.a), tau);
        most = std::max({most, tau.cwiseQuotient(limits.torque).cwiseAbs().maxCoeff(),
                         at.v.cwiseQuotient(limits.velocity).cwiseAbs().maxCoeff(),
                         at.a.cwiseQuotient(limits.acceleration).cwiseAbs().maxCoeff()});
      }
    }
    CHECK(most <= 1.0);
    CHECK(most > 0.9);  // it is a fast one
  }
  CHECK(found > 40);
}

TEST_CASE("a motion keeps bounds of jerk and torque rate", "[timing][property]") {
  Rng rng(15);
  const model::Model arm(model::make_chain({6}));
  dynamics::Workspace ws(arm);
  timing::Limits limits = limits_of(6, 2.0, 12.0, 90.0);
  timing::TimeLaw sudden(arm, limits);
  limits.jerk = VectorXd::Constant(6, 600.0);
  limits.torque_rate = VectorXd::Constant(6, 900.0);
  timing::TimeLaw law(arm, limits);
  int found = 0;
  double slower = 0.0;
  for (int trial = 0; trial < 40; ++trial) {
    timing::TimedPath motion;
    motion.curve = blended(random_points(6, 2 + trial % 5, rng), rng.uniform(0.2, 0.9)).curve();
    if (!sudden.solve(motion)) continue;
    const double before = motion.duration_s();
    REQUIRE(law.solve(motion));
    ++found;
    slower = std::max(slower, motion.duration_s() / before);
    constexpr int places = 4000;
    const double h = motion.duration_s() / places;
    VectorXd tau(6), tau_before(6);
    State before_at(6);
    double values = 0.0, rates = 0.0;
    for (int k = 0; k <= places; ++k) {
      const State at = state_at(motion, h * k);
      dynamics::inverse_dynamics(arm, ws, at.q, at.v, at.a, tau);
      values = std::max({values, tau.cwiseQuotient(limits.torque).cwiseAbs().maxCoeff(),
                         at.v.cwiseQuotient(limits.velocity).cwiseAbs().maxCoeff(),
                         at.a.cwiseQuotient(limits.acceleration).cwiseAbs().maxCoeff()});
      if (k == 0) CHECK(at.a.norm() < 1e-9);  // accelerations begin and end at zero
      if (k > 0)
        rates = std::max(
            {rates, (at.a - before_at.a).cwiseQuotient(h * limits.jerk).cwiseAbs().maxCoeff(),
             (tau - tau_before).cwiseQuotient(h * limits.torque_rate).cwiseAbs().maxCoeff()});
      before_at = at;
      tau_before = tau;
    }
    CHECK(before_at.a.norm() < 1e-6);
    CHECK(before_at.q.isApprox(state_at(motion, motion.duration_s()).q, 1e-12));
    CHECK(values <= 1.0);
    CHECK(rates <= 1.01);
    CHECK(rates > 0.5);
  }
  CHECK(found > 25);
  CHECK(slower < 1.6);
}

TEST_CASE("position, velocity and acceleration of a motion belong together", "[timing][unit]") {
  Rng rng(8);
  const model::Model arm(model::make_chain({4}));
  timing::TimeLaw law(arm, limits_of(4, 2.0, 10.0, 0.0));
  timing::TimedPath motion;
  motion.curve = blended(random_points(4, 4, rng), 0.7).curve();
  REQUIRE(law.solve(motion));
  constexpr double h = 1e-5;
  for (int k = 1; k < 400; ++k) {
    const double t = motion.duration_s() * k / 400.0;
    const State before = state_at(motion, t - h), at = state_at(motion, t),
                behind = state_at(motion, t + h);
    CHECK(((behind.q - before.q) / (2.0 * h) - at.v).norm() < 1e-3);
    CHECK((behind.v - before.v).norm() < 2.0 * h * 10.0 * 2.0 * 1.01);
  }
  // behind the start there is no direction, and the place stays
  {
    timing::TimedPath::Cursor cursor;
    State near(4);
    const State start = state_at(motion, 0.0), soon = state_at(motion, 0.03);
    REQUIRE(soon.v.norm() > 0.2);
    const auto place = motion.project(start.q - 0.5 * (soon.q - start.q), soon.v, {0.03, 0.7},
                                      cursor, near.q, near.v, near.a);
    CHECK(place.time_s == 0.03);
    CHECK(place.rate == 0.7);
    CHECK(near.q == soon.q);
  }
  // back from a place to its time, and from a state to its place
  timing::TimedPath::Cursor cursor;
  State near(4);
  for (int k = 1; k < 50; ++k) {
    const double t = motion.duration_s() * k / 50.0;
    const State at = state_at(motion, t);
    const VectorXd v = 0.6 * at.v;
    const auto place = motion.project(at.q, v, {t - 0.004, 1.0}, cursor, near.q, near.v, near.a);
    if (at.v.norm() < 0.3) continue;
    CHECK(place.time_s == Approx(t).margin(1e-3));
    CHECK(place.rate == Approx(0.6).epsilon(2e-2));
  }
}

// The least time of a motion on a grid of places and squared speeds, by dynamic programming: other
// motions, found in another way.
double least_time_on_grid(const model::Model& arm, const timing::Limits& limits,
                          const VectorXd& from, const VectorXd& to, Index nodes, Index levels,
                          double most) {
  dynamics::Workspace ws(arm);
  const double length = (to - from).norm(), h = length / static_cast<double>(nodes);
  const VectorXd along = (to - from) / length;
  VectorXd tau(arm.dof());
  const auto allowed = [&](Index i, double x, double u) {
    const VectorXd v = std::sqrt(x) * along, a = u * along;
    dynamics::inverse_dynamics(arm, ws, VectorXd(from + h * static_cast<double>(i) * along), v, a,
                               tau);
    return (tau.cwiseAbs() - limits.torque).maxCoeff() <= 0.0 &&
           (a.cwiseAbs() - limits.acceleration).maxCoeff() <= 0.0;
  };
  std::vector<double> next(static_cast<std::size_t>(levels),
                           std::numeric_limits<double>::infinity());
  next[0] = 0.0;
  const double step = most / static_cast<double>(levels - 1);
  for (Index i = nodes - 1; i >= 0; --i) {
    std::vector<double> now(next.size(), std::numeric_limits<double>::infinity());
    for (std::size_t k = 0; k < now.size(); ++k)
      for (std::size_t m = 0; m < now.size(); ++m) {
        const double x = step * static_cast<double>(k), y = step * static_cast<double>(m),
                     u = (y - x) / (2.0 * h), sum = std::sqrt(x) + std::sqrt(y);
        if (sum == 0.0 || std::isinf(next[m]) || std::abs(u) > 40.0) continue;
        if (allowed(i, x, u) && allowed(i + 1, y, u))
          now[k] = std::min(now[k], next[m] + 2.0 * h / sum);
      }
    next.swap(now);
  }
  return next[0];
}

TEST_CASE("no motion on a grid is faster", "[timing][property]") {
  const model::Model arm(model::make_chain({3}));
  timing::Limits limits = limits_of(3, 100.0, 30.0, 40.0);
  VectorXd from(3), to(3);
  from << -1.2, 0.3, 0.4;
  to << 0.9, -0.5, 1.0;
  MatrixXd points(3, 2);
  points << from, to;
  timing::TimeLaw law(arm, limits);
  timing::TimedPath motion;
  motion.curve = timing::BlendedPath(points).curve();
  REQUIRE(law.solve(motion));
  const double other = least_time_on_grid(arm, limits, from, to, 16, 160,
                                          1.05 * motion.speed.array().square().maxCoeff());
  CHECK(motion.duration_s() < 1.01 * other);  // whose limits hold at fewer places
  CHECK(motion.duration_s() > 0.93 * other);  // what the grid loses
}

TEST_CASE("a moving start goes on at its speed, or is refused", "[timing][unit]") {
  const model::Model arm(model::make_chain({3}));
  MatrixXd points(3, 2);
  points << VectorXd::Zero(3), VectorXd::Ones(3);
  timing::TimeLaw law(arm, limits_of(3, 2.0, 5.0, 0.0));
  timing::TimedPath motion;
  motion.curve = timing::BlendedPath(points).curve();
  REQUIRE(law.solve(motion, 1.5));
  CHECK(motion.speed[0] == 1.5);
  const double moving = motion.duration_s();
  REQUIRE(law.solve(motion));
  CHECK(moving < motion.duration_s());
  CHECK_FALSE(law.solve(motion, 10.0));
  CHECK(law.cause() == "the arm is too fast at the beginning of the path");
}

TEST_CASE("a part of a curve is the curve, and may go on with another", "[timing][unit]") {
  Rng rng(11);
  const timing::Curve curve = blended(random_points(4, 5, rng), 0.8).curve();
  const double from = 0.23 * curve.end(), to = 0.81 * curve.end();
  timing::Curve part = curve.part(from, to);
  CHECK(part.end() == Approx(to - from));
  State a(4), b(4);
  for (double s = from; s <= to; s += 0.01 * (to - from)) {
    curve.at(s, a.q, a.v, a.a);
    part.at(s - from, b.q, b.v, b.a);
    CHECK((a.q - b.q).norm() < 1e-12);
    CHECK((a.v - b.v).norm() < 1e-12);
    CHECK((a.a - b.a).norm() < 1e-10);
  }
  part.add(curve.part(to, curve.end()));
  CHECK(part.is_smooth());
  CHECK(part.end() == Approx(curve.end() - from));
  curve.at(curve.end(), a.q, a.v, a.a);
  part.at(part.end(), b.q, b.v, b.a);
  CHECK((a.q - b.q).norm() < 1e-12);
}

TEST_CASE("the next straight place of a curve is where a blend ends", "[timing][unit]") {
  Rng rng(12);
  const MatrixXd points = random_points(3, 5, rng);
  const timing::BlendedPath path = blended(points, 0.6);
  const timing::Curve curve = path.curve();
  for (Index i = 1; i <= path.corners(); ++i) {
    const double end = path.begin(i) + path.half_length(i);
    CHECK(curve.next_straight(path.begin(i)) == Approx(end));
    State at(3);
    curve.at(end, at.q, at.v, at.a);
    CHECK(at.a.norm() < 1e-9);
  }
  const double last = 0.999 * curve.end(), within = path.begin(1) - 1.001 * path.half_length(1);
  CHECK(curve.next_straight(last) == last);
  CHECK(curve.next_straight(within) == within);
  CHECK(curve.next_straight(curve.end()) == curve.end());
  timing::TimedPath motion;
  motion.curve = curve;
  const model::Model arm(model::make_chain({3}));
  REQUIRE(timing::TimeLaw(arm, limits_of(3, 2.0, 8.0, 0.0)).solve(motion));
  for (const double share : {0.0, 0.2, 0.7, 1.0})
    CHECK(motion.along(motion.time_at(share * curve.end())).place ==
          Approx(share * curve.end()).margin(1e-9));
}

TEST_CASE("what has no motion says why", "[timing][unit]") {
  const model::Model arm(model::make_chain({3}));
  MatrixXd points(3, 3);
  points << VectorXd::Zero(3), VectorXd::Ones(3), VectorXd::Unit(3, 0);
  timing::TimeLaw law(arm, limits_of(3, 2.0, 5.0, 0.0));
  timing::TimedPath motion;
  motion.curve = timing::BlendedPath(points).curve();  // without a blend
  CHECK_FALSE(law.solve(motion));
  CHECK(law.cause() == "the path has a corner");
  CHECK(std::isinf(law.duration_s(motion.curve)));

  timing::TimeLaw weak(arm, limits_of(3, 2.0, 5.0, 0.01));
  motion.curve = blended(points, 0.5).curve();
  CHECK_FALSE(weak.solve(motion));
  CHECK(weak.cause() == "the limits do not hold the arm everywhere on the path");

  CHECK_THROWS_WITH(timing::TimeLaw(arm, limits_of(2, 2.0, 5.0, 0.0)),
                    "time law: velocity: expected 3 positive numbers (one per joint)");
  timing::Limits none;
  CHECK_THROWS_WITH(timing::TimeLaw(arm, none),
                    "time law: acceleration: expected 3 positive numbers (one per joint)");
}

TEST_CASE("a trajectory's curve is the trajectory", "[timing][unit]") {
  Rng rng(21);
  for (const bool accelerations : {true, false}) {
    scene::JointTrajectory given;
    given.time_s = VectorXd::LinSpaced(6, 0.0, 2.5);
    given.q = random_points(4, 6, rng);
    given.v = random_points(4, 6, rng);
    if (accelerations) given.a = random_points(4, 6, rng);
    const timing::Curve curve(given);
    VectorXd q(4), v(4), a(4), q2(4), v2(4), a2(4);
    for (int k = 0; k <= 100; ++k) {
      given.at(0.025 * k, q, v, a);
      curve.at(0.025 * k, q2, v2, a2);
      CHECK((q - q2).norm() < 1e-12);
      CHECK((v - v2).norm() < 1e-11);
      CHECK((a - a2).norm() < 1e-10);
    }
  }
}

TEST_CASE(
    "a timed curve keeps its time within the limits, and is slower only where they ask for it",
    "[timing][property]") {
  Rng rng(33);
  const model::Model arm(model::make_chain({6}));
  dynamics::Workspace ws(arm);
  const timing::Limits limits = limits_of(6, 2.0, 12.0, 90.0);
  timing::TimeLaw law(arm, limits, {1, 0.01});
  int slowed = 0;
  for (int trial = 0; trial < 40; ++trial) {
    scene::JointTrajectory given;
    const double seconds = rng.uniform(1.5, 12.0);
    given.time_s = VectorXd::LinSpaced(5, 0.0, seconds);
    given.q = random_points(6, 5, rng);
    given.v = MatrixXd::Zero(6, 5);
    given.v.middleCols(1, 3) = 2.0 / seconds * random_points(6, 3, rng);
    if (trial % 2 == 0) given.a = MatrixXd::Zero(6, 5);
    timing::TimedPath motion;
    motion.curve = timing::Curve(given);
    if (!law.slow_down(motion)) continue;
    VectorXd tau(6);
    double most = 0.0, as_given = 0.0;
    const auto used = [&](const State& at) {
      dynamics::inverse_dynamics(arm, ws, at.q, at.v, at.a, tau);
      return std::max({tau.cwiseQuotient(limits.torque).cwiseAbs().maxCoeff(),
                       at.v.cwiseQuotient(limits.velocity).cwiseAbs().maxCoeff(),
                       at.a.cwiseQuotient(limits.acceleration).cwiseAbs().maxCoeff()});
    };
    for (int k = 0; k <= 1500; ++k) {
      most = std::max(most, used(state_at(motion, motion.duration_s() * k / 1500.0)));
      State at(6);
      given.at(seconds * k / 1500.0, at.q, at.v, at.a);
      as_given = std::max(as_given, used(at));
    }
    CHECK(most <= 1.0);
    CHECK(motion.speed.maxCoeff() <= 1.0 + 1e-9);
    if (as_given < 0.99) CHECK(motion.duration_s() == Approx(seconds).epsilon(1e-9));
    slowed += motion.duration_s() > 1.01 * seconds ? 1 : 0;
  }
  CHECK(slowed > 10);
  CHECK(slowed < 35);
}

namespace {

/// A planar arm whose joint space has two balls beside the way.
struct Balls {
  // Levers of 3, 2 and 1 m, more than the distances in joint space that they stand for here.
  Balls() : arm(model::make_chain({3, "z", 1.0})), levers(arm, nullptr), world({}) {
    points.resize(3, 4);
    points.col(0) << -1.0, -1.0, -1.0;
    points.col(1) << -0.2, -0.4, 1.5;
    points.col(2) << 0.8, 0.4, 1.4;
    points.col(3) << 1.0, 1.0, 1.0;
    // a ball that the lines just pass
    const VectorXd center = 0.9 * points.col(1) + 0.05 * (points.col(0) + points.col(2));
    double least = 1.0;
    for (Index i = 0; i < 3; ++i)
      least = std::min(
          least, test::JointSpaceWorld({{center, 0.0}}).distance(points.col(i), points.col(i + 1)));
    world.set_balls({{center, least - 1.5 * margin_m}});
  }
  // The least distance on a curve, at many places of it.
  [[nodiscard]] double distance(const timing::Curve& curve) const {
    double least = 1.0;
    VectorXd q(3), unused(3), other(3);
    for (int k = 0; k <= 20000; ++k) {
      curve.at(curve.end() * k / 20000.0, q, unused, other);
      least = std::min(least, world.distance(q, q));
    }
    return least;
  }

  model::Model arm;
  scene::Levers levers;
  test::JointSpaceWorld world;
  MatrixXd points;
  static constexpr double margin_m = 0.04;
};

}  // namespace

TEST_CASE("blends are as wide as they are clear", "[timing][property]") {
  Balls rig;
  const search::Margins margins(Balls::margin_m);
  rig.world.set_margins(margins);
  for (Index i = 0; i < 3; ++i)
    REQUIRE(rig.world.motion_clear(rig.points.col(i), rig.points.col(i + 1)));
  timing::BlendedPath path(rig.points);
  timing::Blending blending(rig.levers);
  blending.widen(path, margins, rig.world);
  CHECK(path.half_length(1) > 0.05);
  CHECK(path.half_length(2) > 0.05);
  CHECK(path.half_length(0) == 0.0);
  CHECK(rig.distance(path.curve()) >= Balls::margin_m - timing::Blending::loss_m);
  // where nothing is in the way they meet
  test::JointSpaceWorld empty({});
  timing::BlendedPath wide(rig.points);
  blending.widen(wide, margins, empty);
  CHECK(wide.half_length(2) == Approx(wide.room(2)));
  CHECK(wide.half_length(1) + wide.half_length(2) > path.half_length(1) + path.half_length(2));
}

TEST_CASE("blends leave room for each other on lines that are short", "[timing][unit]") {
  Balls rig;
  MatrixXd points(3, 6);
  points << rig.points.col(0), rig.points.col(1), rig.points.col(1), rig.points.col(1),
      rig.points.col(2), rig.points.col(3);
  points.col(2) += VectorXd::Constant(3, 1e-3);
  points.col(3) += 3e-3 * VectorXd::Unit(3, 1);
  timing::BlendedPath path(points);
  test::JointSpaceWorld empty({});
  timing::Blending(rig.levers).widen(path, search::Margins(Balls::margin_m), empty);
  for (Index i = 1; i <= path.corners(); ++i) CHECK(path.half_length(i) > 0.0);
  CHECK(path.curve().is_smooth());
  timing::TimeLaw law(rig.arm, limits_of(3, 2.0, 8.0, 0.0));
  CHECK(std::isfinite(law.duration_s(path.curve())));
}

TEST_CASE("a path much shorter than the spacing of nodes has the motion of two ramps",
          "[timing][unit]") {
  Balls rig;
  timing::TimeLaw law(rig.arm, limits_of(3, 2.0, 8.0, 0.0));
  for (const double length : {1e-4, 1e-3, 0.02}) {
    MatrixXd points = MatrixXd::Zero(3, 2);
    points(1, 1) = length;
    const timing::BlendedPath path(points);
    CHECK(law.duration_s(path.curve()) == Approx(2.0 * std::sqrt(length / 8.0)).epsilon(0.02));
    timing::TimedPath motion;
    motion.curve = path.curve();
    REQUIRE(law.solve(motion));
    CHECK(motion.duration_s() == Approx(2.0 * std::sqrt(length / 8.0)).epsilon(0.02));
  }
}

TEST_CASE("way-points are moved to where the motion is faster and still clear",
          "[timing][property]") {
  Balls rig;
  const search::Margins margins(Balls::margin_m);
  const timing::Limits limits = limits_of(3, 2.0, 8.0, 0.0);
  timing::BlendedPath path(rig.points);
  timing::Blending(rig.levers).widen(path, margins, rig.world);
  timing::WayPoints way_points(rig.arm, rig.levers, limits, VectorXd::Constant(3, -1.6),
                               VectorXd::Constant(3, 1.6));
  const double before = way_points.duration_s(path);
  Rng rng(3);
  const double after = way_points.improve(path, margins, rig.world, rng, {400, 1000000});
  CHECK(after < 0.9 * before);
  CHECK(after == way_points.duration_s(path));
  CHECK(path.points().col(0) == rig.points.col(0));
  CHECK(path.points().rightCols(1) == rig.points.rightCols(1));
  CHECK(path.points().cwiseAbs().maxCoeff() <= 1.6);
  CHECK(rig.distance(path.curve()) >= Balls::margin_m - timing::Blending::loss_m);
  // the same with the same random numbers
  timing::BlendedPath again(rig.points);
  timing::Blending(rig.levers).widen(again, margins, rig.world);
  Rng same(3);
  CHECK(way_points.improve(again, margins, rig.world, same, {400, 1000000}) == after);
}
