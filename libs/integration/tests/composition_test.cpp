#include "reference/composition.hpp"

#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/test/chains.hpp"
#include "hamelin/test/integration.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::integration;

namespace {

VectorXd end_of(Integrator& integrator, const VectorXd& q0, double duration, int steps,
                const Channels& channels = {}) {
  State state = integrator.start(q0, VectorXd::Zero(q0.size()));
  for (int k = 0; k < steps; ++k)
    REQUIRE(integrator.step(state, channels, duration / steps).converged);
  return state.q;
}

}  // namespace

TEST_CASE("composition weights are symmetric and meet the first order conditions",
          "[integration][composition]") {
  // docs/theory.md (5.17), the conditions on single powers; the mixed conditions are covered by the
  // observed orders.
  for (const int order : {4, 6, 8}) {
    CAPTURE(order);
    const auto weights = composition_weights(order);
    for (std::size_t i = 0; i < weights.size(); ++i)
      CHECK(weights[i] == weights[weights.size() - 1 - i]);
    for (int power = 1; power < order; power += 2) {
      double sum = 0.0;
      for (const double w : weights) sum += std::pow(w, power);
      CHECK(sum == Approx(power == 1 ? 1.0 : 0.0).margin(1e-14));
    }
  }
}

TEST_CASE("compositions have their orders, with damping and gyroscopic terms too",
          "[integration][order]") {
  const int order = GENERATE(4, 6, 8);
  const bool forced = GENERATE(false, true);
  CAPTURE(order, forced);
  const Model model(test::random_robot(7, 4));
  Rng rng(7);
  Channels channels;
  if (forced) {
    channels.damping = VectorXd::Constant(4, 0.3);
    channels.held_torque = test::random_joints(rng, 4, 2.0);
    channels.gyroscopic = {{1, test::random_vector(rng, 0.2), test::random_vector(rng, 2.0)}};
  }
  const VectorXd q0 = VectorXd::Constant(4, 0.3);
  Parameters fine;
  fine.rtol = fine.atol = 1e-14;
  const auto reference = make_integrator("dop853", model, fine);
  State truth = reference->start(q0, VectorXd::Zero(4));
  REQUIRE(reference->step(truth, channels, 1.0).converged);
  std::vector<double> errors;
  const int few = order == 8 ? 16 : 40;  // order 8 reaches rounding errors early
  for (const int steps : {few, 2 * few}) {
    Parameters options = test::of_order(order);
    options.tolerance = 1e-14;
    const auto integrator = make_integrator("composition", model, options);
    CHECK(integrator->order() == order);
    errors.push_back((end_of(*integrator, q0, 1.0, steps, channels) - truth.q).norm());
  }
  CAPTURE(errors[0], errors[1]);
  CHECK(std::log2(errors[0] / errors[1]) == Approx(order).margin(0.6));
}

TEST_CASE("a composition is reversible, and a restored state continues with the same bits",
          "[integration][composition]") {
  const Model model(test::spatial_chain(5));
  const int order = GENERATE(4, 6, 8);
  const auto integrator = make_integrator("composition", model, test::of_order(order));
  const VectorXd q0 = VectorXd::Constant(5, 0.4), v0 = VectorXd::Constant(5, -0.5);
  State state = integrator->start(q0, v0);
  for (int k = 0; k < 50; ++k) REQUIRE(integrator->step(state, {}, 5e-3).converged);
  State kept = state;
  for (int k = 0; k < 50; ++k) REQUIRE(integrator->step(state, {}, 5e-3).converged);
  const auto other = make_integrator("composition", model, test::of_order(order));
  for (int k = 0; k < 50; ++k) REQUIRE(other->step(kept, {}, 5e-3).converged);
  CHECK(kept.q == state.q);
  CHECK(kept.p == state.p);
  VectorXd v(5);
  integrator->velocity(state, v);
  State back = integrator->start(state.q, -v);
  for (int k = 0; k < 100; ++k) REQUIRE(integrator->step(back, {}, 5e-3).converged);
  CHECK((back.q - q0).lpNorm<Eigen::Infinity>() < 1e-9);
}
