#include "variational_derivatives.hpp"

namespace hamelin::integration {

using Eigen::Index;

VariationalDifferentiator::VariationalDifferentiator(const Model& model,
                                                     const VariationalOptions& options)
    : StepDifferentiator(model, options),
      ws_(model, options.isa),
      kinetic_(model.dof()),
      potential_(model.dof()),
      next_(model.dof()),
      forces_(model.dof()),
      system_(model.dof(), 2 * model.dof() + 1, options.isa),
      curvature_(kinetic_.M),
      minus_p_by_delta_(model.dof(), model.dof()),
      p_by_all_(model.dof(), padded(2 * model.dof() + 1)),
      q_(VectorXd::Zero(model.dof())),
      v_(q_) {}

double VariationalDifferentiator::last_step(const State& after) const {
  if (after.history.size() != 1 || after.history[0].empty() ||
      after.history[0].last().size() != model_.dof())
    return 0.0;
  return after.history[0].step();
}

bool VariationalDifferentiator::compute(const State& after, const Channels& channels,
                                        StepDerivatives& out) {
  const VectorXd& delta = after.history[0].last();
  const double h = out.step_s;
  dynamics::potential_derivatives(model_, ws_, after.q, next_);
  q_ = after.q - delta;
  dynamics::potential_derivatives(model_, ws_, q_, potential_);
  q_ += 0.5 * delta;
  v_ = delta / h;
  dynamics::kinetic_derivatives(model_, ws_, q_, v_, kinetic_);
  forces_.evaluate(model_, channels, ws_.ws, q_, v_);
  assemble(h);
  if (!system_.solve()) return false;
  write(h, out);
  return true;
}

// docs/theory.md (4.32)
void VariationalDifferentiator::assemble(double h) {
  const Index n = model_.dof();
  const auto& k = kinetic_;
  curvature_ = k.d2K_dq2 + forces_.by_q;
  system_.matrix() = k.M / h + 0.5 * (k.dp_dq - k.dp_dq.transpose()) - (0.25 * h) * curvature_ -
                     0.5 * forces_.by_v;
  auto right = system_.right();
  right.leftCols(n) = (0.5 * h) * (curvature_ - potential_.d2U_dq2) - k.dp_dq;
  right.middleCols(n, n).setIdentity();
  right.col(2 * n) = k.p / h + 0.5 * (k.dK_dq + forces_.force - potential_.dU_dq);
  right.col(2 * n).noalias() -= 0.5 * (k.dp_dq.transpose() * v_);
  right.col(2 * n).noalias() -= 0.5 * (forces_.by_v * v_);
}

// docs/theory.md (4.33)
void VariationalDifferentiator::write(double h, StepDerivatives& out) {
  const Index n = model_.dof();
  const auto& k = kinetic_;
  minus_p_by_delta_ = (0.5 * h) * next_.d2U_dq2 - k.M / h - 0.5 * (k.dp_dq + k.dp_dq.transpose()) -
                      (0.25 * h) * curvature_ - 0.5 * forces_.by_v;
  p_by_all_.setZero();
  p_by_all_.leftCols(n) = k.dp_dq + (0.5 * h) * (curvature_ - next_.d2U_dq2);
  p_by_all_.col(2 * n) = 0.5 * (k.dK_dq + forces_.force - next_.dU_dq) - k.p / h;
  p_by_all_.col(2 * n).noalias() -= 0.5 * (k.dp_dq.transpose() * v_);
  p_by_all_.col(2 * n).noalias() -= 0.5 * (forces_.by_v * v_);
  const auto X = system_.solution();
  system_.subtract_product(minus_p_by_delta_, p_by_all_);

  out.by_state.topRows(n) = X.leftCols(2 * n);
  out.by_state.topLeftCorner(n, n).diagonal().array() += 1.0;
  out.by_state.bottomRows(n) = p_by_all_.leftCols(2 * n);
  out.by_torque.topRows(n) = (0.5 * h) * X.middleCols(n, n);
  out.by_torque.bottomRows(n) = (0.5 * h) * p_by_all_.middleCols(n, n);
  out.by_torque.bottomRows(n).diagonal().array() += 0.5 * h;
  out.by_step.head(n) = X.col(2 * n);
  out.by_step.tail(n) = p_by_all_.col(2 * n);
}

}  // namespace hamelin::integration
