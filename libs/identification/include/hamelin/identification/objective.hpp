#pragma once
#include <Eigen/Core>
#include <vector>

namespace hamelin::identification {

/// What a fit minimizes, docs/theory.md (2.54):
/// f(x) = Σ_j w_j |R_j x − y_j|²/2 + κ Σ_i D(z_i) + ε |x_f − p|²/2.
/// x holds the coordinates z_i of `links` links, ten each (LinkCoordinates), then x_f, friction in
/// units of the torques, at least 0. f is convex; it is infinite where a link is not a body.
struct Objective {
  struct Equations {
    Eigen::MatrixXd R;    ///< rows × size
    Eigen::VectorXd y;    ///< rows
    double weight = 1.0;  ///< w_j
  };

  std::vector<Equations> joints;
  Eigen::Index links = 0;
  double prior_weight = 1.0;       ///< κ
  Eigen::VectorXd friction_prior;  ///< p
  double friction_weight = 1e-6;   ///< ε, which keeps apart what no sample keeps apart

  [[nodiscard]] Eigen::Index size() const noexcept { return 10 * links + friction_prior.size(); }
  /// f(x). @param gradient, hessian written unless they are null
  double evaluate(const Eigen::VectorXd& x, Eigen::VectorXd* gradient,
                  Eigen::MatrixXd* hessian) const;
};

/// The minimum of f with x_f ≥ 0: a damped Newton method on the coordinates that are not at their
/// bound, projected on the bounds as in Bertsekas (1982).
/// @param x where to begin; f is finite there
[[nodiscard]] Eigen::VectorXd minimum(const Objective& objective, Eigen::VectorXd x);

}  // namespace hamelin::identification
