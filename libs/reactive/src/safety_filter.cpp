#include "hamelin/reactive/safety_filter.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hamelin::reactive {

namespace {

// The passes end when none moves x by more than this in the metric [√J].
constexpr double settled = 1e-6;

// Updates one multiplier by the violation of its row, docs/theory.md (10.14), and returns the
// change.
double relax(double& lambda, double violation, double weight) {
  const double next = std::max(0.0, lambda + violation * weight);
  const double change = next - lambda;
  lambda = next;
  return change;
}

// One pass over a box. value(k) is the number that joint k's bounds limit, move(k, change) moves x
// along the row, and metric(k, k) is the squared norm of the row.
template <class Value, class Move>
double pass(SafetyFilter::Box& box, const Eigen::MatrixXd& metric, Value value, Move move) {
  double moved = 0.0;
  for (Eigen::Index k = 0; k < box.lower.size(); ++k) {
    const double weight = 1.0 / metric(k, k);
    for (const bool low : {true, false}) {
      const double violation = low ? box.lower[k] - value(k) : value(k) - box.upper[k];
      if (!std::isfinite(violation)) continue;
      const double change = relax(low ? box.lambda_low[k] : box.lambda_high[k], violation, weight);
      if (change == 0.0) continue;
      move(k, low ? change : -change);
      moved = std::max(moved, change * change / weight);
    }
  }
  return moved;
}

}  // namespace

SafetyFilter::SafetyFilter(int dof, int max_rows)
    : a_(dof, max_rows), Wa_(dof, max_rows), rows_(static_cast<std::size_t>(max_rows)) {
  for (Box* box : {&box_, &momentum_box_})
    for (auto* x : {&box->lower, &box->upper, &box->lambda_low, &box->lambda_high})
      *x = Eigen::VectorXd::Zero(dof);
  for (auto* x : {&Mx_, &step_, &Mfrom_}) *x = Eigen::VectorXd::Zero(dof);
}

void SafetyFilter::begin(const Eigen::MatrixXd& M, const Eigen::MatrixXd& W) {
  M_ = &M;
  W_ = &W;
  count_ = 0;
  has_soft_rows_ = false;
  has_momentum_box_ = false;
  constexpr double unbounded = std::numeric_limits<double>::infinity();
  box_.lower.setConstant(-unbounded);
  box_.upper.setConstant(unbounded);
}

bool SafetyFilter::add_row(const Eigen::VectorXd& a, double b, double floor, double softness) {
  if (count_ == static_cast<int>(rows_.size())) return false;
  a_.col(count_) = a;
  Wa_.col(count_).noalias() = *W_ * a;
  const double size = a.dot(Wa_.col(count_));
  // No joint can change the distance of such a point, so its row is left out.
  if (size <= 1e-12) return true;
  rows_[static_cast<std::size_t>(count_++)] = {b, floor, 1.0 / ((1.0 + softness) * size), 0.0,
                                               softness * size};
  has_soft_rows_ = has_soft_rows_ || softness > 0.0;
  return true;
}

void SafetyFilter::set_box(const Eigen::VectorXd& lower, const Eigen::VectorXd& upper) {
  box_.lower = lower;
  box_.upper = upper;
}

void SafetyFilter::set_momentum_box(const Eigen::VectorXd& lower, const Eigen::VectorXd& upper) {
  momentum_box_.lower = lower;
  momentum_box_.upper = upper;
  has_momentum_box_ = true;
}

double SafetyFilter::braking_room(const Eigen::VectorXd& a, const Eigen::VectorXd& from) {
  const auto n = a.size();
  // The largest share of a step that keeps x within its bounds; zero if x is outside and the step
  // leads further out.
  const auto share = [](double x, double step, double low, double high) {
    if (step > 0.0) return std::max(0.0, high - x) / step;
    if (step < 0.0) return std::max(0.0, x - low) / -step;
    return std::numeric_limits<double>::infinity();
  };
  if (has_momentum_box_) Mfrom_.noalias() = *M_ * from;

  step_.noalias() = *W_ * a;
  double along = std::numeric_limits<double>::infinity();
  for (Eigen::Index k = 0; k < n; ++k) {
    along = std::min(along, share(from[k], step_[k], box_.lower[k], box_.upper[k]));
    if (has_momentum_box_)
      along =
          std::min(along, share(Mfrom_[k], a[k], momentum_box_.lower[k], momentum_box_.upper[k]));
  }
  const double size = a.dot(step_), by_row = size > 0.0 ? along * size : 0.0;

  for (Eigen::Index k = 0; k < n; ++k)
    step_[k] = a[k] > 0.0   ? std::max(0.0, box_.upper[k] - from[k])
               : a[k] < 0.0 ? std::min(0.0, box_.lower[k] - from[k])
                            : 0.0;
  if (!step_.allFinite()) return by_row;
  double to_corner = 1.0;
  for (Eigen::Index k = 0; has_momentum_box_ && k < n; ++k)
    to_corner = std::min(to_corner, share(Mfrom_[k], M_->col(k).dot(step_), momentum_box_.lower[k],
                                          momentum_box_.upper[k]));
  return std::max(by_row, to_corner * a.dot(step_));
}

SafetyFilter::Report SafetyFilter::project(Eigen::VectorXd& x, int max_passes) {
  Report report;
  Mx_.noalias() = *M_ * x;
  report.energy_before_J = 0.5 * x.dot(Mx_);
  report.passes = run_passes(x, max_passes, Rows::all);
  if (has_soft_rows_ && floor_is_broken(x)) {
    report.recovery_J = recovery();
    report.passes += run_passes(x, 2 * max_passes, Rows::hard);
  }
  for (int i = 0; i < count_; ++i) {
    const auto& row = rows_[static_cast<std::size_t>(i)];
    const double along = a_.col(i).dot(x);
    if (row.rho == 0.0 && row.floor <= 0.0 && along < row.floor)
      report.scale = std::min(report.scale, row.floor / along);
  }
  report.recovery_J += recovery();
  if (report.scale < 1.0) x *= report.scale;
  Mx_.noalias() = *M_ * x;
  report.energy_after_J = 0.5 * x.dot(Mx_);
  return report;
}

void SafetyFilter::clear_multipliers() {
  for (auto* lambda :
       {&box_.lambda_low, &box_.lambda_high, &momentum_box_.lambda_low, &momentum_box_.lambda_high})
    lambda->setZero();
  for (int i = 0; i < count_; ++i) rows_[static_cast<std::size_t>(i)].lambda = 0.0;
}

int SafetyFilter::run_passes(Eigen::VectorXd& x, int max_passes, Rows which) {
  clear_multipliers();
  for (int pass = 1; pass <= max_passes; ++pass) {
    double moved = pass_rows(x, which);
    moved = std::max(moved, pass_box(x));
    if (has_momentum_box_) moved = std::max(moved, pass_momentum_box(x));
    if (moved < settled * settled) return pass;
  }
  return max_passes;
}

bool SafetyFilter::floor_is_broken(const Eigen::VectorXd& x) const {
  constexpr double slack = 1e-9;
  for (int i = 0; i < count_; ++i) {
    const auto& row = rows_[static_cast<std::size_t>(i)];
    if (row.rho == 0.0 && row.floor <= 0.0 && a_.col(i).dot(x) < row.floor - slack) return true;
  }
  return false;
}

double SafetyFilter::pass_rows(Eigen::VectorXd& x, Rows which) {
  double moved = 0.0;
  for (int i = 0; i < count_; ++i) {
    auto& row = rows_[static_cast<std::size_t>(i)];
    if (which == Rows::hard && row.rho > 0.0) continue;
    const double change =
        relax(row.lambda, row.b - a_.col(i).dot(x) - row.rho * row.lambda, row.weight);
    if (change == 0.0) continue;
    x.noalias() += change * Wa_.col(i);
    moved = std::max(moved, change * change / row.weight);
  }
  return moved;
}

double SafetyFilter::pass_box(Eigen::VectorXd& x) {
  return pass(
      box_, *W_, [&](Eigen::Index k) { return x[k]; },
      [&](Eigen::Index k, double change) { x.noalias() += change * W_->col(k); });
}

double SafetyFilter::pass_momentum_box(Eigen::VectorXd& x) {
  return pass(
      momentum_box_, *M_, [&](Eigen::Index k) { return M_->col(k).dot(x); },
      [&](Eigen::Index k, double change) { x[k] += change; });  // M⁻¹ (M e_k) = e_k
}

double SafetyFilter::recovery() const {
  double sum = 0.0;
  for (int i = 0; i < count_; ++i) {
    const auto& row = rows_[static_cast<std::size_t>(i)];
    if (row.b > 0.0) sum += row.lambda * row.b;
  }
  for (Eigen::Index k = 0; k < box_.lower.size(); ++k) {
    sum += box_.recovery(k);
    if (has_momentum_box_) sum += momentum_box_.recovery(k);
  }
  return sum;
}

}  // namespace hamelin::reactive
