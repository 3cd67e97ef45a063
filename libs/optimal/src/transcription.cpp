#include "transcription.hpp"

#include <algorithm>
#include <cmath>

namespace hamelin::optimal {

namespace {

Layout layout_of(const Problem& problem) {
  return {problem.q_start.size(),
          problem.intervals,
          problem.objective == Objective::time,
          problem.duration_s / problem.intervals,
          problem.v_start,
          problem.v_goal};
}

}  // namespace

Transcription::Transcription(const Problem& problem)
    : problem_(problem),
      layout_(layout_of(problem)),
      quotients_(problem, layout_, bounds_),
      torques_(problem, layout_, bounds_),
      places_(problem, layout_, bounds_),
      lower_(Eigen::Map<const VectorXd>(bounds_.lower.data(), bounds_.size())),
      upper_(Eigen::Map<const VectorXd>(bounds_.upper.data(), bounds_.size())),
      values_(VectorXd::Zero(bounds_.size())) {
  knots_.q.resize(layout_.n, layout_.intervals + 1);
  knots_.q.col(0) = problem.q_start;
  knots_.q.col(layout_.intervals) = problem.q_goal;
  knots_.h = layout_.h_ref;
}

BandedMatrix Transcription::hessian_matrix() const {
  return {layout_.blocks(), layout_.n,
          std::max<Index>(places_.rows() > 0 ? 3 : 2, quotients_.reach()), layout_.free_time};
}

VectorXd Transcription::variables_of(const MatrixXd& knots) const {
  VectorXd x = VectorXd::Ones(variables());
  x.head(layout_.blocks() * layout_.n) = knots.middleCols(2, layout_.blocks()).reshaped();
  return x;
}

bool Transcription::evaluate(const VectorXd& x) {
  const Index n = layout_.n, blocks = layout_.blocks();
  knots_.q.middleCols(2, blocks) = x.head(n * blocks).reshaped(n, blocks);
  if (layout_.free_time) knots_.h = x[layout_.step_variable()] * layout_.h_ref;
  if (!(knots_.h > 0.0)) return false;
  const Index N = layout_.intervals;
  knots_.q.col(1) = problem_.q_start + knots_.h * problem_.v_start;
  knots_.q.col(N - 1) = problem_.q_goal - knots_.h * problem_.v_goal;
  double* values = values_.data();
  quotients_.evaluate(knots_, values);
  torques_.evaluate(knots_, values + quotients_.rows());
  places_.evaluate(knots_, values + quotients_.rows() + torques_.rows());
  cost_ = effort_factor() * torques_.effort();
  if (layout_.free_time) cost_ += knots_.h * static_cast<double>(layout_.intervals);
  return std::isfinite(cost_) && values_.allFinite();
}

// docs/theory.md (18.1): h Σ τᵀRτ, or the mean of τᵀRτ beside the time
double Transcription::effort_factor() const {
  return layout_.free_time ? problem_.time_effort_weight / static_cast<double>(layout_.intervals)
                           : knots_.h;
}

void Transcription::gradient(VectorXd& out) const {
  out.setZero();
  torques_.add_gradient(effort_factor(), out);
  if (layout_.free_time)
    out[layout_.step_variable()] += layout_.h_ref * static_cast<double>(layout_.intervals);
}

void Transcription::hessian(double factor, const VectorXd& y, const VectorXd& weights, bool curved,
                            BandedMatrix& out) {
  out.set_zero();
  HessianSum sum(layout_, out);
  const double *at = y.data(), *weight = weights.data();
  quotients_.add_hessian(at, weight, curved, sum);
  at += quotients_.rows();
  weight += quotients_.rows();
  torques_.add_hessian(factor * effort_factor(), at, weight, curved, sum);
  places_.add_hessian(weight + torques_.rows(), sum);
}

double Transcription::violation(std::string* what) const {
  double most = 0.0;
  Index at = 0;
  for (Index r = 0; r < rows(); ++r)
    if (const double by = std::max(lower_[r] - values_[r], values_[r] - upper_[r]); by > most)
      most = by, at = r;
  if (what != nullptr && most > 0.0) *what = describe(at);
  return most;
}

std::string Transcription::describe(Index row) const {
  if (row < quotients_.rows()) return quotients_.describe(row);
  row -= quotients_.rows();
  return row < torques_.rows() ? torques_.describe(row) : places_.describe(row - torques_.rows());
}

}  // namespace hamelin::optimal
