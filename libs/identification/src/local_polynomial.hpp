#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace hamelin::identification {

/// Positions and rates of a signal by least squares of a cubic over the ticks near a time, which
/// may be spaced unevenly: Savitzky, Golay (1964).
class LocalPolynomial {
 public:
  static constexpr int coefficients = 4;

  /// @param time_s, q of the signal, kept by reference; q is dof × ticks
  /// @param half_s the ticks of [t − half_s, t + half_s] are used
  LocalPolynomial(const std::vector<double>& time_s, const Eigen::MatrixXd& q, double half_s);

  /// Fits at a time. Times of later calls must not be earlier.
  /// @param first, last of the ticks that may be used, last excluded
  /// @return whether there are enough ticks, on both sides up to half_s
  bool fit(double time_s, std::size_t first, std::size_t last);

  [[nodiscard]] const Eigen::VectorXd& q() const noexcept { return q_; }
  [[nodiscard]] const Eigen::VectorXd& v() const noexcept { return v_; }
  [[nodiscard]] const Eigen::VectorXd& a() const noexcept { return a_; }
  /// Squared residuals per joint, and how many degrees of freedom they have.
  [[nodiscard]] const Eigen::VectorXd& squares() const noexcept { return squares_; }
  [[nodiscard]] double freedom() const noexcept { return freedom_; }

 private:
  const std::vector<double>& times_;
  const Eigen::MatrixXd& signal_;
  double half_s_, freedom_ = 0.0;
  std::size_t from_ = 0, to_ = 0;
  Eigen::VectorXd q_, v_, a_, squares_;
};

}  // namespace hamelin::identification
