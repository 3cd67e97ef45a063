#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/core/error.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/test/chains.hpp"
#include "hamelin/test/integration.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::integration;

namespace {

struct Outcome {
  State state;
  StepReport sum;
  int steps = 0;
};

// Integrates to `duration` under step control; `first` is the first step.
Outcome run_to(Integrator& integrator, const VectorXd& q0, double duration, double first,
               const Channels& channels = {}) {
  Outcome out;
  out.state = integrator.start(q0, VectorXd::Zero(q0.size()));
  out.state.step_next = first;
  while (out.state.time_s < duration) {
    const double left = duration - out.state.time_s;
    const auto report = integrator.advance(out.state, channels, left);
    REQUIRE(report.converged);
    REQUIRE(report.step_s <= left);
    ++out.steps;
    out.sum.evaluations += report.evaluations;
    out.sum.rejected += report.rejected;
    out.sum.held_work_J += report.held_work_J;
    out.sum.dissipated_J += report.dissipated_J;
    out.sum.gyroscopic_work_J += report.gyroscopic_work_J;
  }
  return out;
}

}  // namespace

TEST_CASE("dop853 takes the evaluations of scipy's DOP853 at equal tolerances, within 10 percent",
          "[integration][step-control][golden]") {
  // scipy 1.10.1, solve_ivp(method="DOP853", rtol=tol, atol=tol, first_step=h0) on y = (q, v): its
  // nfev, and q(T) of its run at 1e-12. The right-hand side was a dense mass matrix from
  // world-frame Jacobians, in numpy.
  struct Count {
    double tolerance;
    int evaluations;
  };
  const auto check = [](const model::Robot& robot, const VectorXd& q0, double duration,
                        double first, const VectorXd& expected, const std::vector<Count>& counts) {
    const Model model(robot);
    for (const auto& count : counts) {
      CAPTURE(count.tolerance);
      const auto integrator =
          make_integrator("dop853", model, test::tolerances(count.tolerance, count.tolerance));
      const auto out = run_to(*integrator, q0, duration, first);
      CHECK(out.sum.evaluations == Approx(count.evaluations).epsilon(0.1));
      CHECK((out.state.q - expected).lpNorm<Eigen::Infinity>() < 1e3 * count.tolerance + 1e-8);
      CHECK(out.state.time_s == Approx(duration).epsilon(1e-14));
    }
  };
  VectorXd seven(7), three(3);
  seven << -3.40114664, -0.10244987, 0.02270182, 0.32683164, -1.14597219, 1.1593271, 0.37032284;
  three << -0.36203183, -2.56076017, 2.83849058;
  check(test::spatial_chain(7), VectorXd::Constant(7, 0.3), 1.0, 1e-3, seven,
        {{1e-4, 517}, {1e-6, 865}, {1e-8, 1429}, {1e-10, 2533}, {1e-12, 3973}});
  check(test::planar3(), VectorXd::Zero(3), 10.0, 1e-2, three,
        {{1e-6, 277}, {1e-9, 721}, {1e-12, 1429}});
}

TEST_CASE(
    "under step control the error follows the tolerance and the booked work closes the energy "
    "account",
    "[integration][step-control]") {
  const Model model(test::random_robot(8, 4));
  Rng rng(8);
  Channels channels;
  channels.damping = VectorXd::Constant(4, 0.5);
  channels.held_torque = test::random_joints(rng, 4, 1.0);
  channels.gyroscopic = {{2, test::random_vector(rng, 0.2), test::random_vector(rng, 3.0)}};
  const VectorXd q0 = VectorXd::Constant(4, 0.3);
  const auto truth = run_to(*make_integrator("dop853", model, test::tolerances(1e-13, 1e-13)), q0,
                            1.0, 1e-3, channels);
  for (const auto& name : test::controlled_names())
    for (const double tolerance : {1e-6, 1e-9}) {
      CAPTURE(name, tolerance);
      const auto integrator = make_integrator(name, model, test::tolerances(tolerance, tolerance));
      const auto out = run_to(*integrator, q0, 1.0, 1e-3, channels);
      CHECK((out.state.q - truth.state.q).norm() < 100.0 * tolerance);
      State start = integrator->start(q0, VectorXd::Zero(4));
      const double before = integrator->energy(start).total(),
                   after = integrator->energy(out.state).total();
      CHECK(std::abs(after - before - out.sum.held_work_J + out.sum.dissipated_J) <
            1e3 * tolerance);
      CHECK(std::abs(out.sum.gyroscopic_work_J) < 1e3 * tolerance);
    }
}

TEST_CASE(
    "a step too long for the tolerance is rejected, and a restored state continues with the same "
    "bits",
    "[integration][step-control]") {
  const Model model(test::spatial_chain(7));
  const VectorXd q0 = VectorXd::Constant(7, 0.3);
  for (const auto& name : test::controlled_names()) {
    CAPTURE(name);
    const auto integrator = make_integrator(name, model, test::tolerances(1e-9, 1e-9));
    State state = integrator->start(q0, VectorXd::Zero(7));
    state.step_next = 0.5;
    const auto first = integrator->advance(state, {}, 1.0);
    REQUIRE(first.converged);
    CHECK(first.rejected > 0);
    CHECK(first.step_s < 0.5);
    const State kept = state;
    for (int k = 0; k < 3; ++k) REQUIRE(integrator->advance(state, {}, 1.0).converged);
    const auto other = make_integrator(name, model, test::tolerances(1e-9, 1e-9));
    State again = other->start(VectorXd::Zero(7), VectorXd::Zero(7));
    again = kept;
    for (int k = 0; k < 3; ++k) REQUIRE(other->advance(again, {}, 1.0).converged);
    CHECK(test::same_state(again, state));
    // step(h) advances by exactly h, in as many steps as needed
    const double time = state.time_s;
    const auto whole = integrator->step(state, {}, 0.25);
    REQUIRE(whole.converged);
    CHECK(state.time_s == time + 0.25);
  }
}

TEST_CASE("schemes without step control refuse tolerances, and invalid tolerances are refused",
          "[integration][unit]") {
  const Model model(test::planar3());
  for (const auto& name : integrator_names()) {
    CAPTURE(name);
    if (find_scheme(name)->step_control)
      CHECK_NOTHROW(make_integrator(name, model, test::tolerances(1e-6, 0.0)));
    else
      CHECK_THROWS_WITH(make_integrator(name, model, test::tolerances(1e-6, 0.0)),
                        Catch::Contains("neither rtol nor atol"));
  }
  CHECK_THROWS_AS(make_integrator("dop853", model, test::tolerances(-1e-6, 0.0)), Error);
  Parameters order;
  order.order = 6;
  CHECK_THROWS_WITH(make_integrator("rk4", model, order), Catch::Contains("one order"));
}
