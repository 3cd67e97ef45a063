#pragma once
#include "hamelin/dynamics/derivatives.hpp"
#include "hamelin/optimal/problem.hpp"

namespace hamelin::optimal {

/// The discrete Lagrangian of hamel-variational between two knots,
///   L_d(a, b, h) = h [K((a + b)/2, (b − a)/h) − ½ U(a) − ½ U(b)],
/// with its first and second derivatives: docs/theory.md (4.1), (18.5).
class DiscreteLagrangian {
 public:
  explicit DiscreteLagrangian(const model::Model& model);

  struct Derivatives {
    explicit Derivatives(Eigen::Index dof);
    VectorXd a, b;        ///< D₁ and D₂
    MatrixXd aa, ab, bb;  ///< rows of `ab` belong to a
    VectorXd ah, bh;      ///< of D₁ and D₂ by h
    double hh = 0.0;      ///< ∂²L_d/∂h²
  };
  void evaluate(const VectorXd& a, const VectorXd& b, double h, Derivatives& out);
  /// The derivative of all second derivatives in the direction (da, db), by a central difference;
  /// `a`, `b` of out are not set.
  void differentiate(const VectorXd& a, const VectorXd& b, double h, const VectorXd& da,
                     const VectorXd& db, Derivatives& out);

 private:
  const model::Model& model_;
  dynamics::DerivativesWorkspace ws_;
  dynamics::KineticDerivatives kinetic_;
  dynamics::PotentialDerivatives potential_;
  VectorXd q_, v_, a_, b_;
  Derivatives ahead_;
};

}  // namespace hamelin::optimal
