#include "transcription.hpp"

#include <algorithm>
#include <cmath>

#include "hamelin/core/numbers.hpp"

namespace hamelin::optimal {

Transcription::Transcription(const Problem& problem)
    : problem_(problem),
      layout_(problem),
      quotients_(problem, layout_, bounds_),
      torques_(problem, layout_, bounds_),
      step_(layout_, bounds_),
      places_(problem, layout_, bounds_),
      lower_(Eigen::Map<const VectorXd>(bounds_.lower.data(), bounds_.size())),
      upper_(Eigen::Map<const VectorXd>(bounds_.upper.data(), bounds_.size())),
      values_(VectorXd::Zero(bounds_.size())) {
  points_.q = MatrixXd::Zero(layout_.joints(), layout_.points());
  places_.fill_far(values_.data() + steady_rows());
}

BandedMatrix Transcription::hessian_matrix() const {
  return {layout_.blocks(), layout_.joints(),
          std::max<Index>(places_.rows() > 0 ? 3 : 2, quotients_.reach()), layout_.free_time()};
}

VectorXd Transcription::variables_of(const MatrixXd& knots) const {
  VectorXd x = VectorXd::Ones(variables());
  x.head(layout_.blocks() * layout_.joints()) =
      knots.middleCols(layout_.first_point() - 1, layout_.blocks()).reshaped();
  return x;
}

// docs/theory.md (18.2), (18.3)
void Transcription::place_points(const VectorXd& x) {
  const Index n = layout_.joints();
  points_.h = layout_.h_ref() * (layout_.free_time() ? x[layout_.step_variable()] : 1.0);
  for (Index i = 0; i < layout_.points(); ++i) {
    const Layout::Source& source = layout_.source(i);
    auto point = points_.q.col(i);
    point.setZero();
    if (source.block >= 0) point += source.share * x.segment(source.block * n, n);
    if (source.position_share != 0.0) point += source.position_share * layout_.position(source);
    if (source.steps != 0.0) point += source.steps * points_.h * layout_.velocity(source);
  }
}

bool Transcription::evaluate(const VectorXd& x) {
  finite_ = false;
  place_points(x);
  if (!(points_.h > 0.0)) return false;
  double* values = values_.data();
  quotients_.evaluate(points_, values);
  torques_.evaluate(points_, values += quotients_.rows());
  step_.evaluate(points_, values += torques_.rows());
  places_.evaluate(points_, values + step_.rows());
  cost_ = effort_factor() * torques_.effort();
  if (layout_.free_time()) cost_ += points_.h * static_cast<double>(layout_.intervals());
  finite_ = std::isfinite(cost_) && points_.q.allFinite() && values_.allFinite();
  return finite_;
}

// docs/theory.md (18.1): h Σ τᵀRτ, or the mean of τᵀRτ beside the time
double Transcription::effort_factor() const {
  return layout_.free_time()
             ? problem_.time_effort_weight / static_cast<double>(layout_.intervals())
             : points_.h;
}

void Transcription::gradient(VectorXd& out) const {
  out.setZero();
  torques_.add_gradient(effort_factor(), out);
  if (layout_.free_time())
    out[layout_.step_variable()] += layout_.h_ref() * static_cast<double>(layout_.intervals());
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
  step_.add_hessian(weight += torques_.rows(), sum);
  places_.add_hessian(weight + step_.rows(), sum);
}

double Transcription::violation(std::string* what) const {
  if (!finite_) {
    if (what != nullptr) *what = "a number of the motion is not finite";
    return infinity;
  }
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
  if (row < torques_.rows()) return torques_.describe(row);
  row -= torques_.rows();
  return row < step_.rows() ? step_.describe() : places_.describe(row - step_.rows());
}

}  // namespace hamelin::optimal
