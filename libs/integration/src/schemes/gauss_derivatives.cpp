#include "gauss_derivatives.hpp"

#include "gauss_tableau.hpp"

namespace hamelin::integration {

using Eigen::Index;
using Eigen::MatrixXd;

GaussDifferentiator::Stage::Stage(Index dof)
    : M(MatrixXd::Zero(padded(dof), dof)),
      dp_dq(M),
      by_q(M),
      by_v(M),
      v(VectorXd::Zero(dof)),
      v_sum(v),
      p_rate(v) {}

GaussDifferentiator::GaussDifferentiator(const Model& model, const GaussOptions& options)
    : StepDifferentiator(model, options),
      tableau_(gauss_tableau(static_cast<std::size_t>(options.order / 2))),
      stages_(options.order / 2),
      ws_(model, options.isa),
      kinetic_(model.dof()),
      potential_(model.dof()),
      forces_(model.dof()),
      stage_(tableau_.stages, Stage(model.dof())),
      system_(stages_ * model.dof(), 2 * model.dof(), options.isa),
      minus_right_(RowMatrixXd::Zero(model.dof() + 1, padded(stages_ * model.dof()) + padded(1))),
      by_start_(RowMatrixXd::Zero(model.dof() + 1, padded(2 * model.dof()) + padded(1))),
      by_momentum_(RowMatrixXd::Zero(model.dof(), padded(2 * model.dof()))),
      by_torque_(by_momentum_),
      q_(VectorXd::Zero(model.dof())),
      memory_(VectorXd::Zero(static_cast<Index>(kernel::GaussMemory::size(
          kernel::GaussForm::momentum, static_cast<std::size_t>(model.dof()), tableau_.stages)))) {}

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
  assemble(h);
  assemble_right(h);
  if (!system_.solve()) return false;
  combine_solution(h);
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
    stage.M.topRows(n) = kinetic_.M;
    stage.dp_dq.topRows(n) = kinetic_.dp_dq;
    stage.by_q.topRows(n) = kinetic_.d2K_dq2 - potential_.d2U_dq2 + forces_.by_q;
    stage.by_v.topRows(n) = kinetic_.dp_dq.transpose() + forces_.by_v;
    stage.p_rate += h * stage.by_q.topRows(n).lazyProduct(stage.v_sum);
  }
}

GaussDifferentiator::Sum& GaussDifferentiator::Sum::add(double weight, const double* matrix) {
  terms[count] = matrix;
  weights[count++] = weight;
  return *this;
}

void GaussDifferentiator::store(const Sum& sum, Index term_stride, Index size, double* out,
                                Index out_stride) const {
  const auto unsigned_of = [](Index x) { return static_cast<std::size_t>(x); };
  system_.kernels().combine(sum.count, sum.terms.data(), sum.weights.data(),
                            unsigned_of(model_.dof()), unsigned_of(size), unsigned_of(term_stride),
                            out, unsigned_of(out_stride));
}

// docs/theory.md (5.21), (5.23): the rows are transposed, so a column of a block is contiguous. A
// block is written before the one after it, whose first numbers its padding overwrites.
void GaussDifferentiator::assemble(double h) {
  const Index n = model_.dof(), right = padded(stages_ * n);
  RowMatrixXd& rows = system_.rows();
  rows.setZero();
  for (Index j = 0; j < stages_; ++j) {
    const Stage& from = stage_[static_cast<std::size_t>(j)];
    const double b = tableau_.b[j];
    for (Index i = 0; i < stages_; ++i) {
      const Stage& at = stage_[static_cast<std::size_t>(i)];
      Sum block;
      block.add(h * a(i, j), at.dp_dq.data()).add(-h * a(i, j), from.by_v.data());
      for (Index l = 0; l < stages_; ++l)
        block.add(-h * h * a(i, l) * a(l, j), stage_[static_cast<std::size_t>(l)].by_q.data());
      if (i == j) block.add(1.0, at.M.data());
      store(block, padded(n), n, &rows(j * n, i * n), rows.outerStride());
    }
    rows.block(j * n, right, n, n).diagonal().setConstant(h * b);
    Sum p_by_v;
    p_by_v.add(h * b, from.by_v.data());
    for (Index l = 0; l < stages_; ++l)
      p_by_v.add(h * h * tableau_.b[l] * a(l, j), stage_[static_cast<std::size_t>(l)].by_q.data());
    store(p_by_v, padded(n), n, &rows(j * n, right + n), rows.outerStride());
  }
}

// docs/theory.md (5.21), (5.22): what multiplies δq and δh, transposed
void GaussDifferentiator::assemble_right(double h) {
  const Index n = model_.dof();
  for (Index i = 0; i < stages_; ++i) {
    const Stage& at = stage_[static_cast<std::size_t>(i)];
    Sum by_q;
    by_q.add(1.0, at.dp_dq.data());
    for (Index l = 0; l < stages_; ++l)
      by_q.add(-h * a(i, l), stage_[static_cast<std::size_t>(l)].by_q.data());
    store(by_q, padded(n), n, &minus_right_(0, i * n), minus_right_.outerStride());
    auto by_step = minus_right_.row(n).segment(i * n, n).transpose();
    by_step = at.dp_dq.topRows(n).lazyProduct(at.v_sum);
    for (Index l = 0; l < stages_; ++l)
      by_step -= a(i, l) * stage_[static_cast<std::size_t>(l)].p_rate;
  }
  by_start_.setZero();
  by_start_.leftCols(n).diagonal().setOnes();
  Sum p_by_q;
  for (Index l = 0; l < stages_; ++l) {
    const Stage& stage = stage_[static_cast<std::size_t>(l)];
    p_by_q.add(h * tableau_.b[l], stage.by_q.data());
    by_start_.row(n).head(n) += tableau_.b[l] * stage.v.transpose();
    by_start_.row(n).segment(n, n) += tableau_.b[l] * stage.p_rate.transpose();
  }
  store(p_by_q, padded(n), n, &by_start_(0, n), by_start_.outerStride());
}

// docs/theory.md (5.23)
void GaussDifferentiator::combine_solution(double h) {
  const Index n = model_.dof(), stride = system_.rows().outerStride();
  system_.subtract_product(minus_right_, by_start_);
  Sum momentum, torque;
  for (Index i = 0; i < stages_; ++i) {
    const double* const Y = system_.solution().data() + i * n * stride;
    momentum.add(1.0, Y);
    torque.add(h * tableau_.c[i], Y);
  }
  store(momentum, stride, 2 * n, by_momentum_.data(), by_momentum_.outerStride());
  store(torque, stride, 2 * n, by_torque_.data(), by_torque_.outerStride());
}

// docs/theory.md (5.22)
void GaussDifferentiator::write(double h, StepDerivatives& out) const {
  const Index n = model_.dof();
  out.by_state.leftCols(n) = by_start_.topLeftCorner(n, 2 * n).transpose();
  out.by_state.rightCols(n) = by_momentum_.leftCols(2 * n).transpose();
  out.by_state.bottomRightCorner(n, n).diagonal().array() += 1.0;
  out.by_torque = by_torque_.leftCols(2 * n).transpose();
  out.by_torque.bottomRows(n).diagonal().array() += h;
  out.by_step = by_start_.row(n).head(2 * n).transpose();
}

}  // namespace hamelin::integration
