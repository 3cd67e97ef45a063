#include "local_polynomial.hpp"

#include <Eigen/Cholesky>
#include <algorithm>

namespace hamelin::identification {

namespace {

using Powers = Eigen::Matrix<double, LocalPolynomial::coefficients, 1>;

Powers powers_of(double u) {
  return {1.0, u, u * u, u * u * u};
}

}  // namespace

LocalPolynomial::LocalPolynomial(const std::vector<double>& time_s, const Eigen::MatrixXd& q,
                                 double half_s)
    : times_(time_s), signal_(q), half_s_(half_s) {
  q_ = v_ = a_ = squares_ = Eigen::VectorXd::Zero(q.rows());
}

bool LocalPolynomial::fit(double time_s, std::size_t first, std::size_t last) {
  constexpr double rounding = 1e-9;  // times are sums of periods
  const double half = half_s_ * (1.0 + rounding);
  from_ = std::max(from_, first);
  while (from_ < last && times_[from_] < time_s - half) ++from_;
  to_ = std::max(to_, from_);
  while (to_ < last && times_[to_] <= time_s + half) ++to_;
  if (first >= last || times_[first] > time_s - half_s_ + rounding ||
      times_[last - 1] < time_s + half_s_ - rounding ||
      to_ - from_ <= static_cast<std::size_t>(coefficients))
    return false;
  Eigen::Matrix<double, coefficients, coefficients> normal;
  normal.setZero();
  Eigen::Matrix<double, coefficients, Eigen::Dynamic> right(coefficients, signal_.rows());
  right.setZero();
  const auto tick = [&](std::size_t k) { return signal_.col(static_cast<Eigen::Index>(k)); };
  for (std::size_t k = from_; k < to_; ++k) {
    const Powers powers = powers_of((times_[k] - time_s) / half_s_);
    normal += powers * powers.transpose();
    right += powers * tick(k).transpose();
  }
  const Eigen::Matrix<double, coefficients, Eigen::Dynamic> c = normal.ldlt().solve(right);
  squares_.setZero();
  for (std::size_t k = from_; k < to_; ++k)
    squares_ += (tick(k) - c.transpose() * powers_of((times_[k] - time_s) / half_s_)).cwiseAbs2();
  freedom_ = static_cast<double>(to_ - from_) - coefficients;
  q_ = c.row(0);
  v_ = c.row(1) / half_s_;
  a_ = 2.0 * c.row(2) / (half_s_ * half_s_);
  return true;
}

}  // namespace hamelin::identification
