#include "shield/shield.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <vector>

#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/robots.hpp"
#include "loop/state_estimator.hpp"

using namespace hamelin;
using control::BrakingRate;
using control::LineCheck;
using control::Shield;
using control::StopMotion;
using Eigen::VectorXd;

namespace {

scene::Scene shelf() {
  return scene::read_scene(HAMELIN_SOURCE_DIR "/data/scenes/shelf.json");
}

}  // namespace

TEST_CASE("a stop's motion is the integral of its acceleration and ends at rest", "[shield]") {
  const VectorXd q = VectorXd::LinSpaced(3, -1.0, 1.0), v = VectorXd::LinSpaced(3, 0.5, -1.5),
                 a = VectorXd::LinSpaced(3, 4.0, -3.0);
  StopMotion stop(3);
  for (const StopMotion::Braking braking :
       {StopMotion::Braking{8.0, 0.0, 0.0}, StopMotion::Braking{8.0, 0.05, 0.02},
        StopMotion::Braking{3.0, 0.2, 0.4}}) {
    stop.set(q, v, a, braking);
    VectorXd at(3), rate(3), before(3), rate_before(3), end(3);
    stop.at(0.0, before, rate_before);
    CHECK((before - q).norm() < 1e-14);
    CHECK((rate_before - v).norm() < 1e-13);
    const int steps = 20000;
    const double h = stop.duration_s() / steps;
    double largest_jerk = 0.0;
    VectorXd last_acceleration = braking.ramp_s > 0.0 ? a : VectorXd(-braking.rate * v);
    for (int k = 1; k <= steps; ++k) {
      stop.at(k * h, at, rate);
      // the trapezoidal rule, which is exact for linear velocities
      CHECK((at - before - 0.5 * h * (rate + rate_before)).norm() < 1e-9);
      const VectorXd acceleration = (rate - rate_before) / h;
      largest_jerk = std::max(largest_jerk, (acceleration - last_acceleration).norm() / h);
      last_acceleration = acceleration;
      before = at;
      rate_before = rate;
    }
    CHECK((at - stop.end()).norm() < 1e-12);
    CHECK(rate.norm() < 1e-12);
    if (braking.fade_s > 0.0)  // docs/theory.md (14.1), (14.3): linear changes only
      CHECK(largest_jerk <
            1.1 * std::max((a + braking.rate * stop.line_velocity()).norm() / braking.ramp_s,
                           braking.rate * stop.line_velocity().norm() / braking.fade_s));
    // the line: docs/theory.md (14.2)
    VectorXd beginning(3);
    stop.at(braking.ramp_s, beginning, rate);
    CHECK((beginning - stop.line_start()).norm() < 1e-12);
    const VectorXd way = stop.end() - stop.line_start(), w = stop.line_velocity();
    CHECK((way - way.dot(w) / w.squaredNorm() * w).norm() < 1e-12);
  }
}

TEST_CASE("the rate of braking is near the largest that the torques allow", "[shield]") {
  const scene::Scene scene = shelf();
  const model::Model model = control::load_model(scene);
  const VectorXd effort = control::joint_limits(model.robot(), &model::Joint::effort_max, infinity);
  dynamics::Workspace ws(model);
  Rng rng(3);
  const VectorXd allowed = 0.8 * effort;
  const auto used = [&](const VectorXd& q, const VectorXd& w, double rate) {
    double most = 0.0;
    VectorXd tau(model.dof());
    for (int k = 0; k <= 200; ++k) {
      const double x = k / 200.0;
      dynamics::inverse_dynamics(model, ws, q + 0.5 * x / rate * w, std::sqrt(1.0 - x) * w,
                                 -rate * w, tau);
      most = std::max(most, (tau.array().abs() / allowed.array()).maxCoeff());
    }
    return most;
  };
  int found = 0;
  for (int i = 0; i < 2000; ++i) {
    const VectorXd q = test::random_within_limits(model, rng),
                   w = test::random_joints(rng, model.dof(), i % 2 == 0 ? 1.5 : 3.0);
    BrakingRate braking(model, allowed, VectorXd(), 1000.0);
    const auto rate = braking.find(q, w, BrakingRate::full_utilisation);
    if (!rate) continue;
    ++found;
    CHECK(used(q, w, *rate) <= 1.0);       // between the points, too
    CHECK(used(q, w, 1.4 * *rate) > 1.0);  // not much faster
  }
  CHECK(found > 1700);
  BrakingRate unlimited(model, VectorXd(), VectorXd(), 100.0);
  CHECK(unlimited.find(test::random_within_limits(model, rng), effort, 0.7) == 100.0);
}

TEST_CASE("bounds from anchors are below the distances themselves", "[shield][slow]") {
  scene::Scene scene = shelf();
  scene.model.self_collision = true;
  const model::Model model = control::load_model(scene);
  const scene::Environment environment = scene::make_environment(scene, model, 0.2);
  const scene::SelfField self(model);
  const scene::Levers levers(model, &self);
  LineCheck line(model, levers, &self);
  dynamics::Workspace ws(model);
  scene::PlacedShapes arm_from(model), arm_to(model), arm(model);
  const VectorXd none = VectorXd::Zero(model.dof()), no_addition;
  const auto place = [&](const VectorXd& q, scene::PlacedShapes& out) {
    dynamics::forward_kinematics(model, ws, q);
    out.place(model, ws);
  };
  Rng rng(5);
  long lines = 0, clear = 0, bounds = 0;
  for (int start = 0; start < 20; ++start) {
    VectorXd q = test::random_within_limits(model, rng),
             v = test::random_joints(rng, model.dof(), 1.5);
    line.forget();
    for (int k = 0; k < 300; ++k) {
      q += 0.001 * v;
      v += test::random_joints(rng, model.dof(), 0.05);
      const VectorXd end = q + 0.3 * v;
      place(q, arm_from);
      place(end, arm_to);
      const LineCheck::End from{q, arm_from.view()}, to{end, arm_to.view()};
      const double margin = 0.002;
      const bool proved =
          !line.check(ws, &environment, 0.0, from, to, {none, no_addition, no_addition, margin})
               .has_value();
      ++lines;
      clear += proved ? 1 : 0;
      for (std::size_t s = 0; s < model.shapes().size(); ++s) {
        const double bound = line.anchored_bound(s, from, to);
        if (bound <= 0.0) continue;
        ++bounds;
        for (double t = 0.0; t <= 1.0; t += 0.25) {
          const Eigen::Vector3d c = arm_from.view().centers[s] +
                                    t * (arm_to.view().centers[s] - arm_from.view().centers[s]);
          std::int32_t hint = -1;
          const double distance =
              environment.nearest_standing(c, c, bound + 1.0, 0.0, hint).distance;
          if (distance < bound) FAIL_CHECK("shape " << s << ": " << distance << " < " << bound);
        }
      }
      if (!proved) continue;
      // a proved line is clear at all of its points, by the margin
      for (int i = 0; i <= 10; ++i) {
        place(q + 0.1 * i * (end - q), arm);
        if (environment.clearance(arm.view(), 0.0, 0.1) < margin) FAIL_CHECK("touches the map");
        for (std::size_t p = 0; p < self.pairs().size(); ++p)
          if (self.distance(p, arm.view(), 0.1) < margin) FAIL_CHECK("touches itself");
      }
    }
  }
  CHECK(clear > 200);
  CHECK(lines - clear > 200);
  CHECK(bounds > 10000);
  CHECK(line.queries() < lines * static_cast<long>(model.shapes().size()) / 4);
}

TEST_CASE("an arm that is nearer than its margin may only move away", "[shield]") {
  const model::Model model(model::make_chain({1, "z", 1.0, 1.0, 0.05}));
  scene::Obstacle ball;
  ball.name = "ball";
  ball.radius_m = 0.1;
  ball.pose = {Eigen::Matrix3d::Identity(), Eigen::Vector3d(-std::sin(0.3), std::cos(0.3), 0.0)};
  const scene::Environment environment(std::nullopt, {ball}, geometry::SE3{}, model.reach(), 0.5);
  const scene::Levers levers(model, nullptr);
  LineCheck line(model, levers, nullptr);
  dynamics::Workspace ws(model);
  scene::PlacedShapes arm_from(model), arm_to(model);
  const VectorXd none = VectorXd::Zero(1), no_addition;
  const auto clear = [&](double a, double b) {
    const VectorXd q = VectorXd::Constant(1, a), p = VectorXd::Constant(1, b);
    dynamics::forward_kinematics(model, ws, q);
    arm_from.place(model, ws);
    dynamics::forward_kinematics(model, ws, p);
    arm_to.place(model, ws);
    const auto blocker = line.check(ws, &environment, 0.0, {q, arm_from.view()}, {p, arm_to.view()},
                                    {none, no_addition, no_addition, 0.05});
    if (blocker) CHECK(blocker->obstacle == 0);
    return !blocker.has_value();
  };
  CHECK(clear(-1.0, -0.5));
  CHECK_FALSE(clear(-1.0, 0.2));   // into the ball
  const double near = 0.3 - 0.17;  // 2 cm from it, less than the margin
  CHECK_FALSE(clear(near, near + 0.001));
  CHECK(clear(near, near - 0.1));

  // Lines that lead away must not begin nearer and nearer.
  const auto at = [](double distance) { return 0.3 - 2.0 * std::asin(0.5 * (distance + 0.15)); };
  const auto leads_away_from = [&](double distance) {
    return clear(at(distance), at(distance) - 1e-3);
  };
  line.forget();
  CHECK(leads_away_from(0.04));
  CHECK(leads_away_from(0.03));
  CHECK_FALSE(leads_away_from(0.027));
  CHECK(leads_away_from(0.03));
  CHECK(leads_away_from(0.045));
  CHECK_FALSE(leads_away_from(0.03));
  CHECK(clear(at(0.08), at(0.07)));
  CHECK(leads_away_from(0.049));
  for (int i = 0; i < 2; ++i)
    CHECK(leads_away_from(0.06));  // far enough away: what was before does not count any more
  CHECK(leads_away_from(0.027));
}

TEST_CASE("friction does not make an arm swing that a stop holds", "[shield]") {
  scene::Scene scene = shelf();
  scene.model.torque_limits = true;
  scene.actuation.type = scene::ActuationType::sampled;
  scene.safety.friction_share = 0.05;
  scene.safety.mass_error = 0.1;
  const model::Model arm = control::load_model(scene);
  const model::Model believed = control::scaled_masses(arm, 0.95);
  const VectorXd friction =
      0.05 * control::joint_limits(arm.robot(), &model::Joint::effort_max, 0.0);
  constexpr double T = 0.001, friction_speed = 0.01;
  constexpr int substeps = 100;  // friction is stiff
  Shield shield(scene, believed, nullptr, T, {});
  control::StateEstimator estimate(arm.dof(), T);
  dynamics::Workspace ws(arm), own(believed);
  VectorXd q = scene.start_q, v = VectorXd::Constant(arm.dof(), 0.5), a = v, tau = v, expected = v,
           last = v;
  dynamics::gravity_torque(believed, own, q, tau);
  estimate.start(q, v);
  const scene::Environment environment;
  shield.start({environment, 0, 0.0}, {q, v});
  VectorXd lowest = q, highest = q;
  for (int k = 0; k < 1500; ++k) {
    if (k > 0) estimate.update(q, v, expected);
    shield.refuse();
    last = tau;
    shield.stop().torque({q, v}, estimate.disturbance(), last, tau);
    dynamics::forward_dynamics(believed, own, q, v, tau, expected);
    for (int i = 0; i < substeps; ++i) {
      const VectorXd against = friction.cwiseProduct((v / friction_speed).array().tanh().matrix());
      dynamics::forward_dynamics(arm, ws, q, v, tau - against, a);
      v += T / substeps * a;
      q += T / substeps * v;
    }
    if (k == 300) lowest = highest = q;
    lowest = lowest.cwiseMin(q);
    highest = highest.cwiseMax(q);
  }
  CHECK(shield.stop().at_rest());
  CHECK(shield.counts().strayed_share < 1.0);
  CHECK((highest - lowest).maxCoeff() < 6e-4);
}

TEST_CASE("the shield refuses bounds that cannot hold, with the number that would do", "[shield]") {
  scene::Scene scene = shelf();
  const model::Model model = control::load_model(scene);
  const scene::Environment environment = scene::make_environment(scene, model, 0.2);
  const VectorXd rest = VectorXd::Zero(model.dof());
  const auto refused = [&]() -> std::string {
    Shield shield(scene, model, nullptr, 0.001, {});
    try {
      shield.start({environment, 0, 0.0}, {scene.start_q, rest});
    } catch (const Error& e) {
      CHECK(e.code() == ErrorCode::invalid);
      return e.what();
    }
    return {};
  };
  CHECK(refused().empty());
  scene.safety.margin_m = 1.0;
  const std::string far = refused();
  CHECK_THAT(far, Catch::Contains("/safety/margin_m") && Catch::Contains("expected at most"));
  const double would_do = std::stod(far.substr(far.rfind("most ") + 5));
  scene.safety.margin_m = 0.99 * would_do;
  CHECK(refused().empty());
  scene.safety.margin_m = 1.02 * would_do;
  CHECK_FALSE(refused().empty());

  scene.safety.margin_m = 0.0;
  scene.model.torque_limits = true;
  scene.safety.torque_share = 0.01;
  const std::string weak = refused();
  CHECK_THAT(weak, Catch::Contains("/safety/torque_share") && Catch::Contains("at least"));
  scene.safety.torque_share = 1.02 * std::stod(weak.substr(weak.rfind("least ") + 6));
  CHECK(refused().empty());
}

TEST_CASE("an arm that was pushed off its stop comes to rest, with torques of a bounded rate",
          "[shield]") {
  scene::Scene scene = shelf();
  scene.model.torque_limits = true;
  scene.actuation.type = scene::ActuationType::sampled;
  scene.safety.tracking_rad = 1e-3;
  const model::Model model = control::load_model(scene);
  const scene::Environment environment;
  const double T = 0.001, torque_rate = GENERATE(1000.0, 300.0);
  const double push = GENERATE(0.0, 0.5, 2.0);
  CAPTURE(torque_rate, push);
  Shield shield(scene, model, nullptr, T, {torque_rate, {}, {}});
  dynamics::Workspace ws(model);
  VectorXd q = scene.start_q, v = VectorXd::Constant(model.dof(), 0.2), a = v, tau = v, sent = v;
  const VectorXd zero = VectorXd::Zero(model.dof());
  dynamics::gravity_torque(model, ws, q, sent);
  shield.start({environment, 0, 0.0}, {q, v});
  double fastest = 0.0;
  for (int k = 0; k < 3000; ++k) {
    shield.refuse();
    shield.stop().torque({q, v}, zero, sent, tau);
    sent = tau.cwiseMin((sent.array() + T * torque_rate).matrix())
               .cwiseMax((sent.array() - T * torque_rate).matrix());
    dynamics::forward_dynamics(model, ws, q, v, sent, a);
    v += T * a;
    if (k == 10) v[0] += push;  // what no bound covers
    q += T * v;
    fastest = std::max(fastest, v.lpNorm<Eigen::Infinity>());
  }
  CHECK(v.lpNorm<Eigen::Infinity>() < 1e-3);
  CHECK(fastest < 1.5 * (0.2 + push));
  CHECK((shield.counts().strayed_share > 1.0) == (push > 0.0));
}

TEST_CASE("verifying a step and stopping do not allocate", "[shield]") {
  test::require_allocation_count();
  scene::Scene scene = shelf();
  scene.model.self_collision = scene.model.torque_limits = scene.model.joint_limits = true;
  scene.actuation.type = scene::ActuationType::sampled;
  scene.safety.mass_error = 0.1;
  scene.safety.friction_share = 0.05;
  const model::Model model = control::load_model(scene);
  const scene::Environment environment = scene::make_environment(scene, model, 0.2);
  environment.prepare();
  const scene::SelfField self(model);
  Shield shield(scene, model, &self, 0.001, {1000.0, {}, {}});
  VectorXd q = scene.start_q, v = VectorXd::Zero(model.dof()), a = v, tau = v, q1 = v, v1 = v;
  const VectorXd zero = v;
  shield.start({environment, 0, 0.0}, {q, v});
  Rng rng(7);
  long refused = 0;
  const auto made = test::allocations_in([&] {
    for (int k = 0; k < 3000; ++k) {
      if (k % 300 == 0)
        for (auto& x : a) x = rng.uniform(-1.0, 1.0) < 0.0 ? -8.0 : 8.0;
      q1 = q + 0.001 * v;
      v1 = v + 0.001 * a;
      const Shield::Node from{q, v}, to{q1, v1};
      if (shield.accept({environment, 0, 0.001 * k}, {from, v, to, a, tau, zero})) {
        q = q1;
        v = v1;
      } else {
        ++refused;
        shield.stop().torque(from, zero, zero, tau);
        v *= 0.98;
        q += 0.001 * v;
      }
    }
  });
  CHECK(made == 0);
  CHECK(refused > 0);
  CHECK(refused < 3000);
}
