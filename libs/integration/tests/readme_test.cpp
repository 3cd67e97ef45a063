#include <Eigen/LU>
#include <catch2/catch.hpp>

#include "hamelin/integration/integrator.hpp"
#include "hamelin/integration/step_derivatives.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;
using namespace hamelin::integration;

TEST_CASE("the README's example loses the energy that the damping dissipates",
          "[integration][unit]") {
  // clang-format off
  // [example]
const Model arm(model::make_chain({}));  // seven links of 0.2 m, gravity along -z
const auto integrator = make_integrator("hamel-variational", arm);
State state = integrator->start(VectorXd::Constant(7, 0.3), VectorXd::Zero(7));
Channels channels;
channels.damping = VectorXd::Constant(7, 0.1);
const double before = integrator->energy(state).total();
double dissipated = 0.0;
for (int k = 0; k < 1000; ++k) {
  const StepReport report = integrator->step(state, channels, 1e-3);
  if (!report.converged) break;  // the state is unchanged
  dissipated += report.dissipated_J;
}
const double error = integrator->energy(state).total() + dissipated - before;
StepDerivatives step(7);  // of the last step, by (q, p), torque and step length
make_step_differentiator(arm, make_options("hamel-variational"))
    ->differentiate(state, channels, step);
  // [example]
  // clang-format on
  CHECK(state.k == 1000);
  CHECK(dissipated > 0.1);
  CHECK(std::abs(error) < 1e-3 * dissipated);
  CHECK(step.by_state.determinant() < 1.0);  // damping contracts phase space
  test::check_readme_example("libs/integration");
}
