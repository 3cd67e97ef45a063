#include "hamelin/integration/events.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <numbers>

#include "hamelin/test/allocations.hpp"
#include "hamelin/test/chains.hpp"
#include "hamelin/test/integration.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::integration;

namespace {

// One prismatic joint along -z: a falling mass, q = ½ g t² from rest.
model::Robot falling() {
  model::Robot robot = test::random_robot(3, 1, 1);
  robot.links[0].joint.type = model::JointType::prismatic;
  robot.links[0].joint.screw << 0, 0, 0, 0, 0, -1;
  return robot;
}

Event position(int joint, double at, int direction = 0) {
  return {[joint, at](double, const VectorXd& q, const VectorXd&) { return q[joint] - at; },
          direction};
}

}  // namespace

TEST_CASE("dense output is of order six in q and five in v between nodes", "[integration][dense]") {
  const Model model(test::spatial_chain(4));
  Channels channels;
  channels.damping = VectorXd::Constant(4, 0.2);
  channels.held_torque = VectorXd::LinSpaced(4, -1.0, 1.0);
  const VectorXd q0 = VectorXd::LinSpaced(4, 0.2, 0.8), v0 = VectorXd::Constant(4, 0.7);
  const auto exact = [&](double t) {
    const auto fine = make_integrator("dop853", model);
    State state = fine->start(q0, v0);
    for (int k = 0; k < 20; ++k) REQUIRE(fine->step(state, channels, t / 20).converged);
    return state;
  };
  const auto errors = [&](double h) {
    const auto scheme = make_integrator("dop853", model);
    State state = scheme->start(q0, v0);
    DenseOutput dense(model);
    dense.begin(*scheme, state, channels);
    REQUIRE(scheme->step(state, channels, h).converged);
    dense.end(*scheme, state, channels);
    VectorXd q(4), v(4);
    Eigen::Vector2d worst = Eigen::Vector2d::Zero();
    for (const double s : {0.2, 0.5, 0.7}) {
      const State at = exact(s * h);
      dense.at(s * h, q, v);
      worst = worst.cwiseMax(Eigen::Vector2d((q - at.q).norm(), (v - at.v).norm()));
    }
    dense.at(dense.end_s(), q, v);
    CHECK((q - state.q).norm() < 1e-14);
    return worst;
  };
  const Eigen::Vector2d coarse = errors(0.08), fine = errors(0.04);
  CHECK(std::log2(coarse[0] / fine[0]) == Approx(6.0).margin(0.4));
  CHECK(std::log2(coarse[1] / fine[1]) == Approx(5.0).margin(0.4));
}

TEST_CASE("a falling mass is stopped at its exact time, whatever the step",
          "[integration][events]") {
  const Model model(falling());
  const double g = 9.80665, height = 1.0, time = std::sqrt(2.0 * height / g);
  CHECK(model.gravity().norm() == Approx(g).epsilon(1e-3));
  const double exact = std::sqrt(2.0 * height / model.gravity().norm());
  CHECK(exact == Approx(time).epsilon(1e-3));
  const std::string name =
      GENERATE(as<std::string>(), "hamel-variational", "gauss:8", "rk4", "dop853", "composition");
  const double h = GENERATE(1.0, 0.1, 0.037);
  CAPTURE(name, h);
  const auto scheme = make_integrator(name, model);
  State state = scheme->start(VectorXd::Zero(1), VectorXd::Zero(1));
  EventFinder finder(*scheme, {position(0, height)});
  EventStep at;
  while (at.event < 0) {
    at = finder.step(state, {}, h);
    REQUIRE(at.step.converged);
    REQUIRE(state.time_s < 2.0);
  }
  CHECK(std::abs(state.time_s - exact) < 3e-12);
  CHECK(state.q[0] >= height);
  CHECK(finder.motion().end_s() == state.time_s);
  // the next step leaves the event behind
  CHECK(finder.step(state, {}, h).event == -1);
}

TEST_CASE("events of a swinging arm are those of the scheme itself", "[integration][events]") {
  const Model model(test::planar3());
  const std::string name = GENERATE(as<std::string>(), "hamel-variational", "gauss:4", "dop853");
  Parameters parameters;
  if (name == "dop853") parameters.rtol = 1e-8;
  const auto scheme = make_integrator(name, model, parameters);
  const VectorXd q0 = VectorXd::Constant(3, 0.4);
  State state = scheme->start(q0, VectorXd::Zero(3));
  EventFinder finder(*scheme, {position(0, 0.0, 1), position(1, 0.1, -1), position(2, -0.2)});
  int found = 0;
  std::vector<double> sides{1.0, 1.0, 1.0};
  for (int k = 0; k < 400 && found < 8; ++k) {
    const State before = state;
    const EventStep step = finder.step(state, {}, 0.05);
    REQUIRE(step.step.converged);
    CHECK(state.time_s == before.time_s + step.step.step_s);
    if (step.event < 0) continue;
    ++found;
    // a step of this length from the node before gives the same state, and one that is shorter by
    // the tolerance lies on the other side
    const auto value = [&](const State& s) {
      return step.event == 0 ? s.q[0] : step.event == 1 ? s.q[1] - 0.1 : s.q[2] + 0.2;
    };
    State again = before, shorter = before;
    REQUIRE(scheme->step(again, {}, step.step.step_s).converged);
    CHECK(again.q == state.q);
    REQUIRE(scheme->step(shorter, {}, step.step.step_s - 2e-12).converged);
    CHECK(value(state) * value(shorter) <= 0.0);
    if (step.event == 0) CHECK(value(state) >= 0.0);
    if (step.event == 1) CHECK(value(state) <= 0.0);
  }
  CHECK(found == 8);
}

TEST_CASE("of several events in a step the first one ends it", "[integration][events]") {
  const Model model(falling());
  const auto scheme = make_integrator("gauss:4", model);
  State state = scheme->start(VectorXd::Zero(1), VectorXd::Zero(1));
  EventFinder finder(*scheme, {position(0, 0.5), position(0, 0.48), position(0, 0.49, -1)});
  const EventStep first = finder.step(state, {}, 1.0);
  CHECK(first.event == 1);
  CHECK(state.q[0] == Approx(0.48).epsilon(1e-10));
  const EventStep second = finder.step(state, {}, 1.0);
  CHECK(second.event == 0);
  CHECK(state.q[0] == Approx(0.5).epsilon(1e-10));
}

TEST_CASE("an event that is zero at the start is found when its sign changes again",
          "[integration][events]") {
  const Model model(falling());
  const auto scheme = make_integrator("rk4", model);
  State state = scheme->start(VectorXd::Zero(1), VectorXd::Constant(1, -1.0));
  EventFinder finder(*scheme, {position(0, 0.0)});
  int steps = 0;
  for (EventStep step; step.event < 0; ++steps) {
    step = finder.step(state, {}, 0.01);
    REQUIRE(steps < 100);
  }
  CHECK(state.time_s == Approx(2.0 / model.gravity().norm()).epsilon(1e-10));
}

TEST_CASE("steps with events keep their state if they fail, and refuse bad events",
          "[integration][events]") {
  const Model model(test::planar3());
  const auto scheme = make_integrator("rk4", model);
  const auto throwing = [](double, const VectorXd& q, const VectorXd&) -> double {
    if (q[0] != 0.3) throw std::runtime_error("thrown by an event");
    return 1.0;
  };
  State state = scheme->start(VectorXd::Constant(3, 0.3), VectorXd::Zero(3));
  const State kept = state;
  EventFinder finder(*scheme, {{throwing, 0}});
  CHECK_THROWS_WITH(finder.step(state, {}, 0.01), "thrown by an event");
  CHECK(state.q == kept.q);
  CHECK(state.time_s == 0.0);
  EventFinder infinite(*scheme,
                       {{[](double, const VectorXd&, const VectorXd&) { return NAN; }, 0}});
  CHECK_THROWS_WITH(infinite.step(state, {}, 0.01),
                    Catch::Contains("event 0 has the value nan at 0 s"));
  CHECK_THROWS_WITH(EventFinder(*scheme, {{nullptr, 0}}), Catch::Contains("has no function"));
  CHECK_THROWS_WITH(EventFinder(*scheme, {position(0, 0.0, 2)}), Catch::Contains("direction 2"));
  CHECK_THROWS_WITH(EventFinder(*scheme, {}, {.samples = 0}), Catch::Contains("0 samples"));
  CHECK_THROWS_WITH(EventFinder(*scheme, {}, {.tolerance_s = 0.0}), Catch::Contains("tolerance"));
  DenseOutput dense(model);
  VectorXd q(3), v(3);
  CHECK_THROWS_WITH(dense.at(0.0, q, v), Catch::Contains("no step yet"));
  CHECK_THROWS_WITH(dense.end(*scheme, state, {}), Catch::Contains("one after that of begin()"));
}

TEST_CASE("steps with events do not allocate after the first", "[integration][events]") {
  const Model model(test::planar3());
  const auto scheme = make_integrator("hamel-variational", model);
  State state = scheme->start(VectorXd::Constant(3, 0.4), VectorXd::Zero(3));
  const Event turns{[](double, const VectorXd&, const VectorXd& v) { return v[0]; }, 0};
  EventFinder finder(*scheme, {turns, position(1, 0.1)});
  while (finder.step(state, {}, 0.02).event < 0) {
  }
  int found = 0;
  CHECK(test::allocations_in([&] {
          for (int k = 0; k < 200; ++k) found += finder.step(state, {}, 0.02).event >= 0;
        }) == 0);
  CHECK(found > 2);
}
