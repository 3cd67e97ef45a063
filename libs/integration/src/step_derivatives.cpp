#include "hamelin/integration/step_derivatives.hpp"

#include <type_traits>

#include "check_channels.hpp"
#include "check_options.hpp"
#include "gauss_derivatives.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"
#include "variational_derivatives.hpp"

namespace hamelin::integration {

StepDerivatives::StepDerivatives(Eigen::Index dof)
    : by_state(Eigen::MatrixXd::Zero(2 * dof, 2 * dof)),
      by_torque(Eigen::MatrixXd::Zero(2 * dof, dof)),
      by_step(VectorXd::Zero(2 * dof)) {}

void StepDifferentiator::differentiate(const State& after, const Channels& channels,
                                       StepDerivatives& out) {
  constexpr const char* function = "differentiate";
  const Eigen::Index n = model_.dof();
  if (after.q.size() != n || after.p.size() != n)
    throw Error(ErrorCode::usage,
                formatted("{}: state: {} positions and {} momenta given, expected {} of each: a "
                          "state of '{}' for this model",
                          function, after.q.size(), after.p.size(), n, scheme_));
  if (out.by_state.rows() != 2 * n)
    throw Error(ErrorCode::usage, formatted("{}: out: made for {} joints, expected {}", function,
                                            out.by_state.rows() / 2, n));
  check_channels(function, model_, channels);
  out.step_s = last_step(after);
  if (!(out.step_s > 0.0))
    throw Error(ErrorCode::usage,
                formatted("{}: state: it remembers no step of '{}', expected a state after a step",
                          function, scheme_));
  if (!compute(after, channels, out))
    throw Error(ErrorCode::invalid,
                formatted("{}: the equations of the step at {} s are singular, so that it has no "
                          "derivative",
                          function, after.time_s));
}

std::unique_ptr<StepDifferentiator> make_step_differentiator(const Model& model,
                                                             const Options& options) {
  const Options valid = checked(options);
  if (const auto* o = std::get_if<VariationalOptions>(&valid))
    return std::make_unique<VariationalDifferentiator>(model, *o);
  if (const auto* o = std::get_if<GaussOptions>(&valid)) {
    if (o->rtol > 0.0 || o->atol > 0.0 || o->tolerance > 1e-12)
      throw Error(
          ErrorCode::usage,
          "make_step_differentiator: gauss in its accurate mode given, expected fixed steps "
          "with a tolerance of at most 1e-12");
    return std::make_unique<GaussDifferentiator>(model, *o);
  }
  throw Error(ErrorCode::usage, formatted("make_step_differentiator: scheme '{}' given, expected "
                                          "hamel-variational or gauss",
                                          integrator_names()[valid.index()]));
}

}  // namespace hamelin::integration
