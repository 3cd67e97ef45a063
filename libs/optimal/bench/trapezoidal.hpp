#pragma once
#include "hamelin/dynamics/derivatives.hpp"
#include "hamelin/optimal/problem.hpp"
#include "nonlinear_program.hpp"

namespace hamelin::optimal {

/// The same Problem by trapezoidal collocation, as most tools transcribe it: variables q, v and τ
/// at the knots, and defects q_{k+1} − q_k = h/2 (v_k + v_{k+1}), v_{k+1} − v_k = h/2 (a_k +
/// a_{k+1}) (J. T. Betts, Practical Methods for Optimal Control, 2nd edition, 2010, section 4.6).
/// Clearance is required at the knots. Without acceleration and jerk.
class Trapezoidal final : public NonlinearProgram {
 public:
  explicit Trapezoidal(const Problem& problem);

  [[nodiscard]] VectorXd guess(const Eigen::MatrixXd& knots) const;
  [[nodiscard]] Index variables() const override { return 3 * n_ * (N_ + 1) + (free_ ? 1 : 0); }
  [[nodiscard]] const VectorXd& lower() const override { return lower_; }
  [[nodiscard]] const VectorXd& upper() const override { return upper_; }
  [[nodiscard]] bool evaluate(const VectorXd& x) override;
  [[nodiscard]] double cost() const override { return cost_; }
  void gradient(VectorXd& out) const override;
  [[nodiscard]] const VectorXd& values() const override { return values_; }
  [[nodiscard]] std::vector<Entry> jacobian_entries() const override;
  void jacobian(double* values) const override;
  /// Not known: IPOPT estimates it.
  [[nodiscard]] std::vector<Entry> hessian_entries() const override { return {}; }
  void hessian(double, const VectorXd&, double*) override {}

  [[nodiscard]] Eigen::MatrixXd torques() const;
  [[nodiscard]] double step_s() const noexcept { return h_; }
  /// The largest one of a row, in its unit, or in decimetres of clearance.
  [[nodiscard]] double violation() const;

 private:
  [[nodiscard]] Index q_of(Index k) const { return 3 * n_ * k; }
  [[nodiscard]] Index v_of(Index k) const { return q_of(k) + n_; }
  [[nodiscard]] Index tau_of(Index k) const { return q_of(k) + 2 * n_; }
  [[nodiscard]] Index first_distance() const { return 2 * n_ * N_ + 4 * n_ + 3 * n_ * (N_ + 1); }
  template <class F>
  void for_each_entry(F&& f) const;

  static constexpr double distance_scale = 10.0;  ///< as in ClearanceRows

  const Problem& problem_;
  Index n_, N_, each_ = 0;
  bool free_;
  dynamics::DerivativesWorkspace ws_;
  VectorXd weights_, lower_, upper_, values_, x_, limits_lower_, limits_upper_;
  double h_ = 0.0, cost_ = 0.0, effort_ = 0.0;
  Eigen::MatrixXd a_;
  std::vector<Eigen::MatrixXd> a_q_, a_v_, a_tau_;
  VectorXd distances_;
  std::vector<MatrixXd> gradients_;
};

}  // namespace hamelin::optimal
