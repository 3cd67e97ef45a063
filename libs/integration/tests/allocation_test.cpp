#include "hamelin/test/allocations.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/test/integration.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::integration;

namespace {

Channels all_channels(int n) {
  Channels channels;
  channels.damping = VectorXd::Constant(n, 0.1);
  channels.coulomb = VectorXd::Constant(n, 0.05);
  channels.coulomb_speed = 0.5;
  channels.held_torque = VectorXd::Constant(n, 0.2);
  channels.gyroscopic = {{2, Eigen::Vector3d::Zero(), Eigen::Vector3d::UnitX()}};
  channels.wrenches = {{0, dynamics::Reference::local, dynamics::Vector6d::Ones()}};
  channels.wrench_law = [](const dynamics::Workspace&, const VectorXd&, const VectorXd& v,
                           std::span<ExternalWrench> wrenches) {
    wrenches[0].wrench.setConstant(v[0]);
  };
  return channels;
}

// All calls that a tick can make, after the first step.
void check_tick(Integrator& integrator, const Channels& channels, double h) {
  const int n = integrator.model().dof();
  State state = integrator.start(VectorXd::Constant(n, 0.2), VectorXd::Constant(n, 0.3));
  REQUIRE(integrator.step(state, channels, h).converged);
  const State kept = state;
  VectorXd v(n);
  double sum = 0.0;
  CHECK(test::allocations_in([&] {
          sum += integrator.step(state, channels, h).residual;
          integrator.velocity(state, v);
          integrator.kick(state, v);
          sum += integrator.advance(state, channels, h).residual;
          integrator.set_velocity(state, v);
          sum += integrator.step(state, channels, 0.5 * h).residual;
          sum += integrator.energy(state).total();
          state = kept;
        }) == 0);
  CHECK(std::isfinite(sum));
}

}  // namespace

TEST_CASE("the counter sees the allocations of Eigen, operator new and the C library",
          "[allocation]") {
  test::require_allocation_count();
  const VectorXd a = VectorXd::Ones(5), b = a;
  VectorXd c(5);
  double sum = 0.0;
  CHECK(test::allocations_in([&] { c = a + b; }) == 0);
  CHECK(test::allocations_in([&] {
          const VectorXd temporary = a + b;
          sum += temporary[0];
        }) == 1);
  CHECK(test::allocations_in([&] { c.resize(6); }) == 1);
  void* volatile p = nullptr;
  CHECK(test::allocations_in([&] { p = ::operator new(64); }) == 1);
  ::operator delete(p);
  CHECK(test::allocations_in([&] { p = ::operator new (64, std::align_val_t{64}); }) == 1);
  ::operator delete (p, std::align_val_t{64});
  CHECK(test::allocations_in([&] { p = std::calloc(1, 64); }) == 1);
  CHECK(test::allocations_in([&] { p = std::realloc(p, 4096); }) == 1);
  std::free(p);
  CHECK(sum == 2.0);
}

TEST_CASE("a step does not allocate", "[integration][allocation]") {
  test::require_allocation_count();
  const auto name = GENERATE(from_range(integrator_names()));
  const bool planar = GENERATE(false, true), prismatic = GENERATE(false, true);
  const Model model(test::random_robot(10, 6, prismatic ? 3 : 0, planar));
  auto orders = find_scheme(name)->orders;
  if (orders.empty()) orders = {0};
  for (const int order : orders) {
    CAPTURE(name, planar, prismatic, order);
    for (const Channels& channels : {Channels{}, all_channels(6)}) {
      Parameters options = test::of_order(order);
      check_tick(*make_integrator(name, model, options), channels, 1e-3);
      if (!find_scheme(name)->step_control) continue;
      options.rtol = options.atol = 1e-6;
      check_tick(*make_integrator(name, model, options), channels, 0.05);
    }
  }
}

TEST_CASE("other solvers, halved steps and failed steps do not allocate",
          "[integration][allocation]") {
  test::require_allocation_count();
  const Model model(test::random_robot(10, 6));
  Parameters options;
  options.solver = Solver::feedback;
  check_tick(*make_integrator("hamel-variational", model, options), all_channels(6), 1e-3);
  options.solver = Solver::riqn;
  check_tick(*make_integrator("lie-exact", model, options), all_channels(6), 1e-3);
  for (const std::string name :
       {"hamel-variational", "gauss", "composition", "lie-exact", "hamel", "newmark"}) {
    CAPTURE(name);
    const auto integrator = make_integrator(name, model);
    State state = integrator->start(VectorXd::Constant(6, 0.2), VectorXd::Constant(6, 8.0));
    StepReport report;
    CHECK(test::allocations_in([&] { report = integrator->step(state, {}, 0.1); }) == 0);
    CHECK(report.halvings > 0);
    CHECK(test::allocations_in([&] { report = integrator->step(state, {}, 1e3); }) == 0);
    CHECK_FALSE(report.converged);
  }
}
