#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "hamelin/test/chains.hpp"
#include "hamelin/test/integration.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::integration;

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN(),
                 infinity = std::numeric_limits<double>::infinity();

// Channels with which a step from rest is not finite; the invalid number is at one joint only.
struct Bad {
  std::string description;
  Channels channels;
};

std::vector<Bad> bad_channels(int n, int joint) {
  const auto one = [&](double x) {
    VectorXd v = VectorXd::Zero(n);
    v[joint] = x;
    return v;
  };
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  std::vector<Bad> all(7);
  all[0].description = "NaN held torque";
  all[0].channels.held_torque = one(nan);
  all[1].description = "infinite held torque";
  all[1].channels.held_torque = one(-infinity);
  all[2].description = "infinite damping";
  all[2].channels.damping = one(infinity);
  all[3].description = "NaN damping";
  all[3].channels.damping = one(nan);
  all[4].description = "infinite dry friction";
  all[4].channels.coulomb = one(infinity);
  all[5].description = "NaN in the vector of a gyroscopic term";
  all[5].channels.gyroscopic = {{joint, zero, {1.0, nan, 0.0}}};
  all[6].description = "NaN in the point of a gyroscopic term";
  all[6].channels.gyroscopic = {{joint, {0.1, nan, 0.0}, Eigen::Vector3d::Ones()}};
  return all;
}

void check_refused(Integrator& integrator, State& state, const Channels& channels) {
  const State before = state;
  const StepReport step = integrator.step(state, channels, 1e-3);
  CHECK_FALSE(step.converged);
  CHECK(step.step_s == 0.0);
  CHECK(step.held_work_J == 0.0);
  CHECK(step.dissipated_J == 0.0);
  CHECK(step.gyroscopic_work_J == 0.0);
  CHECK(test::same_state(state, before));
  const StepReport advance = integrator.advance(state, channels, 1e-3);
  CHECK_FALSE(advance.converged);
  CHECK(advance.step_s == 0.0);
  CHECK(test::same_state(state, before));
  // the object still works
  CHECK(integrator.step(state, {}, 1e-3).converged);
  CHECK(test::velocity(integrator, state).allFinite());
}

void check_all(const std::string& name, const Parameters& options) {
  const int n = 5;
  for (const bool planar : {false, true})
    for (const int joint : {0, 2, n - 1}) {
      const Model model(test::random_robot(12, n, planar ? 3 : 0, planar));
      for (const auto& bad : bad_channels(n, joint)) {
        CAPTURE(name, planar, joint, bad.description);
        const auto integrator = make_integrator(name, model, options);
        State state = integrator->start(VectorXd::Constant(n, 0.3), VectorXd::Zero(n));
        check_refused(*integrator, state, bad.channels);
        // the same in motion, with the scheme's memory of past steps filled
        state = integrator->start(VectorXd::Constant(n, 0.3), VectorXd::Constant(n, 0.5));
        for (int k = 0; k < 5; ++k) REQUIRE(integrator->step(state, {}, 1e-3).converged);
        check_refused(*integrator, state, bad.channels);
      }
    }
}

}  // namespace

TEST_CASE(
    "a step whose result is not finite is reported as not converged and leaves the state unchanged",
    "[integration][failed-step]") {
  const auto name = GENERATE(from_range(integrator_names()));
  check_all(name, {});
}

TEST_CASE("failed steps of every order of gauss and composition leave the state unchanged",
          "[integration][failed-step]") {
  for (const std::string name : {"gauss", "composition"})
    for (const int order : find_scheme(name)->orders) check_all(name, test::of_order(order));
}

TEST_CASE("failed steps under step control leave the state unchanged",
          "[integration][failed-step]") {
  const auto name = GENERATE(from_range(test::controlled_names()));
  check_all(name, test::tolerances(1e-6, 1e-6));
}

TEST_CASE("failed steps of the other solvers leave the state unchanged",
          "[integration][failed-step]") {
  Parameters options;
  options.solver = Solver::feedback;
  check_all("hamel-variational", options);
  options.solver = Solver::riqn;
  check_all("lie-exact", options);
  Parameters loose;
  loose.tolerance = 1e-8;  // accepts unconfirmed steps
  check_all("hamel-variational", loose);
}

TEST_CASE("a step that overflows fails", "[integration][failed-step]") {
  const auto name = GENERATE(from_range(integrator_names()));
  CAPTURE(name);
  const Model model(test::planar3());
  const auto integrator = make_integrator(name, model);
  State state = integrator->start(VectorXd::Zero(3), VectorXd::Constant(3, 1e200));
  const State before = state;
  CHECK_FALSE(integrator->step(state, {}, 1e-3).converged);
  CHECK(test::same_state(state, before));
}

TEST_CASE("a halved step reports its full length, or zero if it failed",
          "[integration][failed-step]") {
  // with 50 links of 4 cm the feedback needs halving at 20 ms
  const int n = 50;
  const Model model(
      test::chain_along_y(n, 0.04, Eigen::Vector3d(1e-3, 1e-3, 1e-3).asDiagonal(), "xzx"));
  VectorXd q0(n);
  for (int i = 0; i < n; ++i) q0[i] = 0.3 * std::sin(1.0 + i);
  Parameters options;
  options.solver = Solver::feedback;
  const double h = 0.02;
  for (const int halvings : {0, 1, 12}) {
    CAPTURE(halvings);
    options.max_halvings = halvings;
    const auto integrator = make_integrator("hamel-variational", model, options);
    State state = integrator->start(q0, VectorXd::Constant(n, 0.5));
    const auto report = integrator->step(state, {}, h);
    CHECK(report.converged == (halvings == 12));
    CHECK(report.step_s == (report.converged ? Approx(h).epsilon(1e-14) : Approx(0.0).margin(0.0)));
    CHECK(state.time_s == (report.converged ? h : 0.0));
  }
}
