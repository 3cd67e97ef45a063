#include "hamelin/integration/step_derivatives.hpp"

#include <type_traits>

#include "channels/check_channels.hpp"
#include "check_options.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"
#include "schemes/gauss_derivatives.hpp"
#include "schemes/variational_derivatives.hpp"
#include "state_owner.hpp"

namespace hamelin::integration {

namespace {

template <class Matrix>
void check_shape(const char* function, const char* argument, const Matrix& matrix,
                 Eigen::Index rows, Eigen::Index cols) {
  if (matrix.rows() != rows || matrix.cols() != cols)
    throw Error(ErrorCode::usage,
                formatted("{}: {}: {} x {} numbers given, expected {} x {}", function, argument,
                          matrix.rows(), matrix.cols(), rows, cols));
}

}  // namespace

StepDerivatives::StepDerivatives(Eigen::Index dof)
    : by_state(Eigen::MatrixXd::Zero(2 * dof, 2 * dof)),
      by_torque(Eigen::MatrixXd::Zero(2 * dof, dof)),
      by_step(VectorXd::Zero(2 * dof)) {}

StepDifferentiator::StepDifferentiator(const Model& model, const Options& options)
    : model_(model), owner_(owner_of_states(model, options)) {}

void StepDifferentiator::differentiate(const State& after, const Channels& channels,
                                       StepDerivatives& out) {
  constexpr const char* function = "differentiate";
  if (after.owner != owner_) refuse_owner(function, after, owner_, model_);
  const Eigen::Index n = model_.dof();
  if (after.q.size() != n || after.p.size() != n)
    throw Error(ErrorCode::usage,
                formatted("{}: state: {} positions and {} momenta given, expected {} of each",
                          function, after.q.size(), after.p.size(), n));
  check_shape(function, "out.by_state", out.by_state, 2 * n, 2 * n);
  check_shape(function, "out.by_torque", out.by_torque, 2 * n, n);
  check_shape(function, "out.by_step", out.by_step, 2 * n, 1);
  check_channels(function, model_, channels);
  if (channels.wrench_law)
    throw Error(ErrorCode::usage,
                formatted("{}: channels.wrench_law: given, expected held wrenches", function));
  const double h = last_step(after);
  if (after.jumped || !(h > 0.0))
    throw Error(ErrorCode::usage,
                formatted("{}: state: made, kicked or given a velocity since its last step, "
                          "expected a state right after a step",
                          function));
  out.step_s = h;
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
    if (!structure_mode(*o))
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
