// Bounds that the shield's reasoning rests on: docs/theory.md (14.1)-(14.22).
#include <catch2/catch.hpp>
#include <cmath>
#include <deque>

#include "hamelin/control/preparation.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/test/robots.hpp"
#include "loop/state_estimator.hpp"
#include "loop/torque_pipeline.hpp"
#include "shield/shield.hpp"
#include "shield/straying.hpp"

using namespace hamelin;
using control::Shield;
using control::StopMotion;
using control::Straying;
using Eigen::VectorXd;
using scene::Levers;

namespace {

/// A joint about a vertical axis, for which a bar is a constant inertia.
model::Model turntable() {
  model::ChainOptions options;
  options.links = 1;
  options.axes = "z";
  model::Robot robot = model::make_chain(options);
  robot.links[0].joint.effort_max = 0.084;
  return model::Model(std::move(robot));
}

scene::Scene scene_of(const model::Model& model, scene::ActuationType type) {
  scene::Scene scene;
  scene.start_q = VectorXd::Zero(model.dof());
  scene.actuation.type = type;
  scene.model.torque_limits = true;
  return scene;
}

/// How far the turntable strays from a stop, at most, while an unmodelled torque of the size c
/// takes its worst course: it reverses when the stop begins. As a share of the bound.
double strayed_at_reversal(const model::Model& model, const scene::Scene& scene, double period_s,
                           int delay_periods, double c) {
  constexpr int substeps = 20;
  dynamics::Workspace ws(model);
  VectorXd one = VectorXd::Ones(1), inertia(1);
  dynamics::momentum(model, ws, VectorXd::Zero(1), one, inertia);
  const double M = inertia[0], T = period_s;
  control::TorquePipeline pipeline(model, static_cast<std::size_t>(delay_periods), T);
  pipeline.start_from(VectorXd::Zero(1));
  control::StateEstimator estimate(1, T);
  const bool ideal = scene.actuation.type == scene::ActuationType::ideal;
  VectorXd q = VectorXd::Zero(1), v = VectorXd::Constant(1, 1.0), torque = VectorXd::Zero(1);
  std::deque<double> waiting(static_cast<std::size_t>(delay_periods), 0.0);
  estimate.start(q, v);
  const auto observe = [&] { estimate.update(q, v, pipeline.acting() / M); };
  const auto move = [&](double disturbance) {
    waiting.push_back(torque[0]);
    const double acting = waiting.front();
    waiting.pop_front();
    for (int i = 0; i < substeps; ++i) {
      const double h = T / substeps, a = (acting + disturbance) / M;
      q[0] += h * (v[0] + 0.5 * h * a);
      v[0] += h * a;
    }
  };
  for (int k = 0; k < 300; ++k) {  // the disturbance is known, or an integral holds against it
    if (k > 0) observe();
    torque[0] = ideal ? c : -M * estimate.disturbance()[0];
    pipeline.send(torque);
    move(-c);
  }
  Shield shield(scene, model, nullptr, T, {});
  const scene::Environment environment;
  const Levers levers(model, nullptr);
  Straying straying(scene, model, levers, T, std::min(50.0, 0.2 / T), 0.0);
  double most = 0.0;
  const int late = ideal ? 0 : delay_periods;
  VectorXd at(1), rate(1);
  for (int k = 0; k == 0 || !shield.stop().at_rest(); ++k) {
    observe();
    pipeline.predict(ws, q, v, estimate.disturbance());
    const Shield::Node node = ideal ? Shield::Node{q, v} : Shield::Node{pipeline.q(), pipeline.v()};
    if (k == 0) shield.start({environment, 0, 0.0}, node);
    if (k >= late) {
      shield.stop().motion().at(static_cast<double>(k - late) * T, at, rate);
      most = std::max(most, std::abs(q[0] - at[0]));
    }
    shield.refuse();
    const VectorXd none = VectorXd::Zero(1);
    shield.stop().torque(node, ideal ? none : estimate.disturbance(), pipeline.last(), torque);
    pipeline.send(torque);
    move(c);
  }
  CHECK(shield.stop().motion().stop_s() > 0.15);
  straying.bound(shield.stop().motion().stop());
  const double lag =
      ideal ? 0.0 : 0.25 * T * std::abs(shield.stop().motion().stop().line_velocity()[0]);
  return most /
         (straying.errors()[0] + straying.tracking()[0] - lag);  // velocities do not lag here
}

}  // namespace

TEST_CASE("a disturbance that reverses when a stop begins stays within the bound of straying",
          "[shield][straying]") {
  const model::Model model = turntable();
  double largest_share = 0.0;
  for (const double period_s : {0.0005, 0.001, 0.002, 0.004})
    for (const int delay : {0, 1, 2, 5}) {
      CAPTURE(period_s, delay);
      scene::Scene scene = scene_of(model, scene::ActuationType::sampled);
      scene.actuation.delay_s = delay * period_s;
      scene.safety.friction_share = 0.05;
      scene.safety.tracking_rad = 0.0;
      const double c = 0.05 * *model.robot().links[0].joint.effort_max;
      const double share = strayed_at_reversal(model, scene, period_s, delay, c);
      CHECK(share <= 1.0);
      largest_share = std::max(largest_share, share);
    }
  for (const double period_s : {0.0005, 0.001, 0.004}) {
    CAPTURE(period_s);
    scene::Scene scene = scene_of(model, scene::ActuationType::ideal);
    scene.safety.friction_share = 0.05;
    scene.safety.tracking_rad = 0.0;
    const double c = 0.05 * *model.robot().links[0].joint.effort_max;
    CHECK(strayed_at_reversal(model, scene, period_s, 0, c) <= 1.0);
  }
  CHECK(largest_share > 0.8);  // the bound is not far above what happens
}

TEST_CASE("the straying of a stop covers its whole line, not its beginning only",
          "[shield][straying]") {
  const model::Model model(description::read_robot(HAMELIN_SOURCE_DIR "/data/robots/arm7.urdf", {}),
                           {}, {0.0, 0.0, -9.81});
  scene::Scene scene = scene_of(model, scene::ActuationType::sampled);
  scene.safety.mass_error = 0.1;
  scene.safety.friction_share = 0.05;
  scene.safety.tracking_rad = 0.0;
  const Levers levers(model, nullptr);
  constexpr double T = 0.001, omega = 50.0;
  Straying straying(scene, model, levers, T, omega, 0.0);
  const VectorXd friction =
      0.05 * control::joint_limits(model.robot(), &model::Joint::effort_max, 0.0);
  dynamics::Workspace ws(model);
  // (14.18), (14.19) at a point of the line, written down independently
  const auto bound_at = [&](const VectorXd& q, const VectorXd& v, const VectorXd& a) {
    Eigen::MatrixXd M(7, 7);
    VectorXd bias(7);
    dynamics::mass_matrix(model, ws, q, M);
    dynamics::bias_torque(model, ws, q, v, bias);
    const VectorXd torque = 0.1 * ((M * a).cwiseAbs() + 0.5 * bias.cwiseAbs()) + friction;
    const double phi = (0.33 + 0.45 * omega * T) / (omega * omega);
    return VectorXd(phi * (M.inverse().cwiseAbs() * torque));
  };
  Rng rng(11);
  double beyond_beginning = 0.0, largest_share = 0.0;
  StopMotion stop(7);
  for (int i = 0; i < 1000; ++i) {
    const VectorXd q = test::random_within_limits(model, rng), v = test::random_joints(rng, 7, 2.0);
    const double rate = rng.uniform(3.0, 12.0);
    stop.set(q, v, VectorXd::Zero(7), {rate, 0.0, 0.0});
    straying.bound(stop);
    const VectorXd first = bound_at(q, v, rate * v);
    for (int k = 0; k <= 40; ++k) {
      const double x = k / 40.0;
      const VectorXd there = bound_at(q + 0.5 * x / rate * v, std::sqrt(1.0 - x) * v, rate * v);
      largest_share = std::max(largest_share, there.cwiseQuotient(straying.errors()).maxCoeff());
      beyond_beginning = std::max(beyond_beginning, there.cwiseQuotient(first).maxCoeff());
    }
  }
  CAPTURE(beyond_beginning);
  CHECK(largest_share <= 1.0);
  CHECK(beyond_beginning > 1.5);  // what the beginning of the line alone would have missed
}

TEST_CASE("the range of a stop contains all its positions, also those of a ramp that turns back",
          "[shield][stop]") {
  Rng rng(5);
  double beyond_ends = 0.0;
  VectorXd at(1), rate(1);
  StopMotion stop(1);
  for (int i = 0; i < 2000; ++i) {
    const double alpha = rng.uniform(1.0, 20.0),
                 ramp = i % 4 == 0 ? 0.0 : rng.uniform(0.0, 1.0 / alpha);
    const VectorXd q = VectorXd::Zero(1), v = VectorXd::Constant(1, rng.uniform(-1.0, 1.0)),
                   a = VectorXd::Constant(1, i % 5 == 0 ? 0.0 : rng.uniform(-20.0, 20.0));
    stop.set(q, v, a, {alpha, ramp, rng.uniform(0.0, 1.0 / alpha)});
    const StopMotion::Range range = stop.range(0);
    double least = 0.0, largest = 0.0;
    for (int k = 0; k <= 2000; ++k) {
      stop.at(stop.duration_s() * k / 2000.0, at, rate);
      least = std::min(least, at[0]);
      largest = std::max(largest, at[0]);
    }
    CHECK(range.least <= least + 1e-12);
    CHECK(range.largest >= largest - 1e-12);
    CHECK(range.least >= least - 1e-6);  // and no more
    CHECK(range.largest <= largest + 1e-6);
    beyond_ends =
        std::max(beyond_ends, largest - std::max({0.0, stop.line_start()[0], stop.end()[0]}));
  }
  CHECK(beyond_ends > 0.01);  // such ramps occur
}

TEST_CASE("a step after which the ramp of the stop would pass a joint limit is refused",
          "[shield][stop]") {
  model::ChainOptions chain;
  chain.links = 1;
  chain.axes = "z";
  model::Robot robot = model::make_chain(chain);
  robot.links[0].joint.lower = -1.0;
  robot.links[0].joint.upper = 1.0;
  const model::Model model(std::move(robot));
  scene::Scene scene = scene_of(model, scene::ActuationType::position);
  scene.model.joint_limits = true;
  const control::ChangeBounds drive{0.0, VectorXd::Constant(1, 15.0), VectorXd::Constant(1, 100.0)};
  constexpr double T = 0.001;
  const scene::Environment environment;
  const VectorXd none = VectorXd::Zero(1);
  int refused = 0, passed = 0;
  Rng rng(3);
  VectorXd at(1), rate(1);
  for (int i = 0; i < 2000; ++i) {
    const double q = rng.uniform(0.8, 0.9995), v = rng.uniform(-0.5, 1.0),
                 a = rng.uniform(-15.0, 15.0);
    Shield shield(scene, model, nullptr, T, drive);
    const VectorXd rest = VectorXd::Constant(1, 0.5);
    shield.start({environment, 0, 0.0}, {rest, none});
    const VectorXd q0 = VectorXd::Constant(1, q), v0 = VectorXd::Constant(1, v),
                   a0 = VectorXd::Constant(1, a), q1 = q0 + T * v0, v1 = v0 + T * a0;
    if (!shield.accept({environment, 0, 0.0}, {{q0, v0}, v0, {q1, v1}, a0, none, none})) {
      ++refused;
      continue;
    }
    for (int k = 0; k <= 500; ++k) {
      shield.stop().motion().at(shield.stop().motion().stop_s() * k / 500.0, at, rate);
      if (at[0] > 1.0) ++passed;
    }
  }
  CHECK(passed == 0);
  CHECK(refused > 100);
  CHECK(refused < 1900);
}
