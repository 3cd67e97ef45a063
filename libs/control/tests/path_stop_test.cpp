// Stops along paths, from states that are not quite on them.
#include <algorithm>
#include <catch2/catch.hpp>
#include <memory>

#include "guide/path_timing.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/test/joint_space_world.hpp"

using namespace hamelin;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

struct PathRig {
  PathRig()
      : scene(scene::read_scene(HAMELIN_SOURCE_DIR "/data/scenes/clutter.json")),
        arm(control::load_model(scene)),
        effort(0.95 * control::modelled_limits(scene, arm.robot()).effort_max) {}

  std::unique_ptr<control::CertifiedPath> path(const control::ChangeBounds& changes) {
    search::Settings settings;
    settings.q_lower = control::modelled_limits(scene, arm.robot()).q_lower;
    settings.q_upper = control::modelled_limits(scene, arm.robot()).q_upper;
    control::PathTiming timing(scene, arm, nullptr, {{}, Json::object(), changes}, settings);
    MatrixXd points(arm.dof(), 4);
    for (Index j = 0; j < arm.dof(); ++j)
      for (Index i = 0; i < 4; ++i)
        points(j, i) = std::clamp(scene.start_q[j] + rng.uniform(-0.6, 0.6),
                                  settings.q_lower[j] + 0.05, settings.q_upper[j] - 0.05);
    timing.begin(1, infinity);
    timing.consider(points, search::Margins(0.01), world);
    return timing.make(world);
  }

  scene::Scene scene;
  model::Model arm;
  VectorXd effort;
  Rng rng{17};
  test::JointSpaceWorld world{{}};
};

struct PathState {
  VectorXd q, v, a, torque;
  explicit PathState(Index n) : q(VectorXd::Zero(n)), v(q), a(q), torque(q) {}
};

// What a stop needs, at most, beside what it may use.
struct StopUses {
  double torque = 0.0, acceleration = 0.0, jerk = 0.0, torque_rate = 0.0;
};

StopUses examine_stop(PathRig& rig, const control::PathStop& stop,
                      const control::CertifiedPath& path, const control::ChangeBounds& changes) {
  dynamics::Workspace ws(rig.arm);
  StopUses used;
  constexpr double h = 5e-4;
  PathState before(7), now(7), path_now(7);
  VectorXd v2(7);
  for (int k = 0; h * k < stop.duration_s() - h; ++k) {
    stop.at(h * k, now.q, now.v);
    stop.path_at(h * k, path_now.q, path_now.v, path_now.a);
    CHECK(((now.q - path_now.q).cwiseAbs() - stop.widest()).maxCoeff() <= 1e-12);
    stop.at(h * (k + 1), path_now.q, v2);
    now.a = (v2 - now.v) / h;
    dynamics::inverse_dynamics(rig.arm, ws, now.q, now.v, now.a, now.torque);
    used.torque = std::max(used.torque, now.torque.cwiseQuotient(rig.effort).cwiseAbs().maxCoeff());
    if (path.stop_acceleration.size() > 0)
      used.acceleration = std::max(
          used.acceleration, now.a.cwiseQuotient(path.stop_acceleration).cwiseAbs().maxCoeff());
    if (k > 0 && changes.jerk_max.size() > 0)
      used.jerk =
          std::max(used.jerk,
                   ((now.a - before.a) / h).cwiseQuotient(changes.jerk_max).cwiseAbs().maxCoeff());
    if (k > 0 && changes.torque_rate > 0.0)
      used.torque_rate =
          std::max(used.torque_rate, (now.torque - before.torque).lpNorm<Eigen::Infinity>() / h /
                                         changes.torque_rate);
    before = now;
  }
  stop.at(stop.duration_s(), now.q, now.v);
  CHECK((now.q - stop.end()).norm() == 0.0);
  CHECK(now.v.norm() == 0.0);
  return used;
}

struct StopsFound {
  StopUses most;
  int stops = 0;
  double longest_share = 0.0;  // of what is left of the path, where there is much
};

// Stops from random places, rates and deviations.
StopsFound stops_along(PathRig& rig, const control::ChangeBounds& changes) {
  StopsFound out;
  control::PathStop stop(7);
  PathState at(7);
  for (int trial = 0; trial < 12; ++trial) {
    const auto path = rig.path(changes);
    REQUIRE(path != nullptr);
    for (int i = 0; i < 40; ++i) {
      const control::PathStop::Place from{rig.rng.uniform(0.0, path->motion.duration_s()),
                                          i % 4 == 0 ? rig.rng.uniform(0.0, 1.0) : 1.0};
      VectorXd e(7), e_rate(7), e_acceleration = VectorXd::Zero(7);
      for (Index j = 0; j < 7; ++j) {
        e[j] = rig.rng.uniform(-5e-4, 5e-4);
        e_rate[j] = rig.rng.uniform(-0.01, 0.01);
      }
      stop.set(*path, from, {e, e_rate, e_acceleration}, 0.0, {rig.effort, 250.0});
      stop.at(0.0, at.q, at.v);
      PathState reference(7);
      timing::TimedPath::Cursor cursor;
      path->motion.at(from.time_s, reference.q, reference.v, reference.a, cursor);
      CHECK((at.q - reference.q - e).norm() < 1e-12);
      CHECK((at.v - from.rate * reference.v - e_rate).norm() < 1e-12);
      CHECK(stop.first() == cursor.node);
      CHECK(path->motion.time_s[stop.first()] <= from.time_s);
      // it ends on the last interval that it names
      VectorXd end(7), chord_end(7), unused(7);
      const Index last = stop.last();
      double nearest = 1.0;
      for (int k = 0; k <= 200; ++k) {
        path->motion.curve.at(
            path->motion.place[last] +
                (path->motion.place[last + 1] - path->motion.place[last]) * k / 200.0,
            end, chord_end, unused);
        nearest = std::min(nearest, (end - stop.end()).norm());
      }
      CHECK(nearest < 2e-3);
      const StopUses used = examine_stop(rig, stop, *path, changes);
      out.most = {std::max(out.most.torque, used.torque),
                  std::max(out.most.acceleration, used.acceleration),
                  std::max(out.most.jerk, used.jerk),
                  std::max(out.most.torque_rate, used.torque_rate)};
      ++out.stops;
      const double left = path->motion.duration_s() - from.time_s;
      if (left > 0.6 && from.rate == 1.0)
        out.longest_share = std::max(out.longest_share, stop.braking_s() / left);
    }
  }
  return out;
}

}  // namespace

TEST_CASE("stops along a path keep the torque limits and fade to it", "[control][path_stop]") {
  PathRig rig;
  const StopsFound found = stops_along(rig, {});
  CHECK(found.stops == 480);
  CHECK(found.most.torque <= 1.001);
  CHECK(found.most.torque > 0.9);
  CHECK(found.longest_share < 0.9);
}

TEST_CASE("stops along a path keep bounds of acceleration and jerk", "[control][path_stop]") {
  PathRig rig;
  VectorXd acceleration(7), jerk(7);  // published for the Franka Research 3's predecessor
  acceleration << 15.0, 7.5, 10.0, 12.5, 15.0, 20.0, 20.0;
  jerk << 7500.0, 3750.0, 5000.0, 6250.0, 7500.0, 10000.0, 10000.0;
  const StopsFound found = stops_along(rig, {0.0, acceleration, jerk});
  CHECK(found.most.torque <= 1.001);
  CHECK(found.most.acceleration <= 1.001);
  CHECK(found.most.acceleration > 0.8);
  CHECK(found.most.jerk <= 1.0);
  CHECK(found.longest_share < 0.95);
}

TEST_CASE("stops along a path keep a bound of the torque rate", "[control][path_stop]") {
  PathRig rig;
  const StopsFound found = stops_along(rig, {1000.0, {}, {}});
  CHECK(found.most.torque <= 1.001);
  CHECK(found.most.torque_rate <= 1.0);
  CHECK(found.most.torque_rate > 0.4);
  CHECK(found.longest_share < 0.98);
}
