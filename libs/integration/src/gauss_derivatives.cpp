#include "gauss_derivatives.hpp"

#include "gauss_tableau.hpp"

namespace hamelin::integration {

using Eigen::Index;
using Eigen::MatrixXd;

GaussDifferentiator::Stage::Stage(Index dof)
    : M(MatrixXd::Zero(dof, dof)),
      dp_dq(M),
      by_q(M),
      by_v(M),
      v(VectorXd::Zero(dof)),
      p_rate(v),
      v_sum(v) {}

GaussDifferentiator::GaussDifferentiator(const Model& model, const GaussOptions& options)
    : StepDifferentiator("gauss", model),
      tableau_(gauss_tableau(static_cast<std::size_t>(options.order / 2))),
      stages_(options.order / 2),
      ws_(model, options.isa),
      kinetic_(model.dof()),
      potential_(model.dof()),
      forces_(model.dof()),
      stage_(tableau_.stages, Stage(model.dof())),
      system_(stages_ * model.dof(), 3 * model.dof() + 1, options.isa),
      weights_(stages_ * stages_ + 2 * stages_ + 1, stages_),
      by_q_(RowMatrixXd::Zero(stages_, padded(Index{model.dof()} * model.dof()))),
      weighed_(RowMatrixXd::Zero(weights_.rows(), by_q_.cols())),
      p_by_v_(model.dof(), stages_ * model.dof()),
      q_by_all_(model.dof(), padded(3 * model.dof() + 1)),
      p_by_all_(q_by_all_),
      q_(VectorXd::Zero(model.dof())),
      memory_(VectorXd::Zero(static_cast<Index>(kernel::GaussMemory::size(
          kernel::GaussForm::momentum, static_cast<std::size_t>(model.dof()), tableau_.stages)))) {
  // docs/theory.md (5.20): the rows for pairs of stages, then for stages, then for the end
  for (Index l = 0; l < stages_; ++l) {
    for (Index i = 0; i < stages_; ++i) {
      for (Index j = 0; j < stages_; ++j) weights_(i * stages_ + j, l) = a(i, l) * a(l, j);
      weights_(stages_ * stages_ + i, l) = a(i, l);
      weights_(stages_ * (stages_ + 1) + i, l) = tableau_.b[l] * a(l, i);
    }
    weights_(weights_.rows() - 1, l) = tableau_.b[l];
  }
}

double GaussDifferentiator::last_step(const State& after) const {
  using Memory = kernel::GaussMemory;
  const auto size = Memory::size(kernel::GaussForm::momentum,
                                 static_cast<std::size_t>(model_.dof()), tableau_.stages);
  return after.memory.size() == static_cast<Index>(size) ? after.step_previous : 0.0;
}

bool GaussDifferentiator::compute(const State& after, const Channels& channels,
                                  StepDerivatives& out) {
  const double h = out.step_s;
  evaluate(after, channels, h);
  weighed_.setZero();
  system_.add_product(weights_, by_q_, weighed_);
  assemble(h);
  if (!system_.solve()) return false;
  write(h, out);
  return true;
}

// docs/theory.md (5.19)
void GaussDifferentiator::evaluate(const State& after, const Channels& channels, double h) {
  const Index n = model_.dof();
  // the increments h b_j K_j
  memory_ = after.memory;
  const kernel::GaussMemory memory(memory_.data(), kernel::GaussForm::momentum,
                                   static_cast<std::size_t>(n), tableau_.stages);
  const Eigen::Map<const RowMatrixXd> dq(memory.increments, n, stages_),
      dp(memory.increments + dq.size(), n, stages_);
  for (Index i = 0; i < stages_; ++i) {
    Stage& stage = stage_[static_cast<std::size_t>(i)];
    stage.v = dq.col(i) / (h * tableau_.b[i]);
    stage.p_rate = dp.col(i) / (h * tableau_.b[i]);
    stage.v_sum.setZero();
    for (Index j = 0; j < stages_; ++j) stage.v_sum += (tableau_.mu_column[j][i] / h) * dq.col(j);
    q_ = after.q + h * stage.v_sum;
    for (Index j = 0; j < stages_; ++j) q_ -= dq.col(j);
    dynamics::energy_derivatives(model_, ws_, q_, stage.v, kinetic_, potential_);
    forces_.evaluate(model_, channels, ws_.ws, q_, stage.v);
    stage.M = kinetic_.M;
    stage.dp_dq = kinetic_.dp_dq;
    stage.by_q = kinetic_.d2K_dq2 - potential_.d2U_dq2 + forces_.by_q;
    stage.by_v = kinetic_.dp_dq.transpose() + forces_.by_v;
    Eigen::Map<MatrixXd>(by_q_.row(i).data(), n, n) = stage.by_q;
  }
}

// docs/theory.md (5.21)
void GaussDifferentiator::assemble(double h) {
  const Index n = model_.dof();
  auto S = system_.matrix();
  auto R = system_.right();
  for (Index i = 0; i < stages_; ++i) {
    const Stage& at = stage_[static_cast<std::size_t>(i)];
    for (Index j = 0; j < stages_; ++j) {
      const Stage& from = stage_[static_cast<std::size_t>(j)];
      auto block = S.block(i * n, j * n, n, n);
      block = (h * a(i, j)) * (at.dp_dq - from.by_v) - (h * h) * weighed(i * stages_ + j);
      if (i == j) block += at.M;
    }
    auto right = R.middleRows(i * n, n);
    right.leftCols(n) = h * weighed(stages_ * stages_ + i) - at.dp_dq;
    right.middleCols(n, n).setIdentity();
    right.middleCols(2 * n, n).setZero();
    right.middleCols(2 * n, n).diagonal().setConstant(h * tableau_.c[i]);
    auto by_step = right.col(3 * n);
    by_step.setZero();
    by_step.noalias() -= at.dp_dq * at.v_sum;
    for (Index l = 0; l < stages_; ++l) {
      const Stage& from = stage_[static_cast<std::size_t>(l)];
      by_step += a(i, l) * from.p_rate;
      by_step.noalias() += (h * a(i, l)) * (from.by_q * from.v_sum);
    }
  }
}

// docs/theory.md (5.22)
void GaussDifferentiator::write(double h, StepDerivatives& out) {
  const Index n = model_.dof();
  q_by_all_.setZero();
  p_by_all_.setZero();
  q_by_all_.leftCols(n).setIdentity();
  p_by_all_.leftCols(n) = h * weighed(weights_.rows() - 1);
  p_by_all_.middleCols(n, n).setIdentity();
  p_by_all_.middleCols(2 * n, n).diagonal().setConstant(h);
  for (Index j = 0; j < stages_; ++j) {
    const Stage& stage = stage_[static_cast<std::size_t>(j)];
    const double b = tableau_.b[j];
    p_by_v_.middleCols(j * n, n) =
        (h * b) * stage.by_v + (h * h) * weighed(stages_ * (stages_ + 1) + j);
    q_by_all_.col(3 * n) += b * stage.v;
    p_by_all_.col(3 * n) += b * stage.p_rate;
    p_by_all_.col(3 * n).noalias() += (h * b) * (stage.by_q * stage.v_sum);
  }
  const RowMatrixXd& X = system_.solution();
  for (Index j = 0; j < stages_; ++j) q_by_all_ += (h * tableau_.b[j]) * X.middleRows(j * n, n);
  system_.add_product(p_by_v_, X, p_by_all_);

  out.by_state.topRows(n) = q_by_all_.leftCols(2 * n);
  out.by_state.bottomRows(n) = p_by_all_.leftCols(2 * n);
  out.by_torque.topRows(n) = q_by_all_.middleCols(2 * n, n);
  out.by_torque.bottomRows(n) = p_by_all_.middleCols(2 * n, n);
  out.by_step.head(n) = q_by_all_.col(3 * n);
  out.by_step.tail(n) = p_by_all_.col(3 * n);
}

}  // namespace hamelin::integration
