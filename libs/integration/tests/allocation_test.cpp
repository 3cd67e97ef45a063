#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/integration/integrator.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::integration;

#ifndef HAMELIN_SANITIZED
TEST_CASE("a step does not allocate", "[integration][allocation]") {
  const bool planar = GENERATE(false, true);
  const Model model(test::random_robot(10, 6, 0, planar));
  for (const auto& name : integrator_names()) {
    if (name == "rosenbrock") continue;  // odeint's linear algebra allocates; it is there to judge others by
    CAPTURE(name);
    const auto integrator = make_integrator(name, model);
    Channels channels;
    channels.damping = VectorXd::Constant(6, 0.1);
    channels.held_torque = VectorXd::Zero(6);
    channels.gyroscopic = {{2, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitX()}};
    State state = integrator->start(VectorXd::Constant(6, 0.2), VectorXd::Constant(6, 0.3));
    REQUIRE(integrator->step(state, channels, 1e-3).converged);
    VectorXd v(6);
    double sum = 0.0;
    CHECK(test::allocations_in([&] {
            sum += integrator->step(state, channels, 1e-3).residual;
            integrator->velocity(state, v);
            integrator->kick(state, v);
            integrator->set_velocity(state, v);
            sum += integrator->energy(state).total();
          }) == 0);
    CHECK(std::isfinite(sum));
  }
}

TEST_CASE("a controlled step does not allocate", "[integration][allocation]") {
  const Model model(test::random_robot(10, 6));
  Channels channels;
  channels.damping = VectorXd::Constant(6, 0.1);
  Options options;
  options.rtol = options.atol = 1e-9;
  const auto integrator = make_integrator("dop853", model, options);
  State state = integrator->start(VectorXd::Constant(6, 0.2), VectorXd::Constant(6, 0.3));
  REQUIRE(integrator->step(state, channels, 1e-3).converged);
  double sum = 0.0;
  CHECK(test::allocations_in([&] { sum += integrator->step(state, channels, 0.1).residual; }) == 0);
  CHECK(std::isfinite(sum));
}
#endif
