#pragma once
#include <Eigen/Core>

namespace hamelin::identification {

/// Ten inertial parameters as in dynamics/regressor.hpp: mass [kg], first moment [kg m], inertia
/// xx, yy, zz, xy, xz, yz about the origin of the frame [kg m²].
using LinkParameters = Eigen::Matrix<double, 10, 1>;

/// The pseudo-inertia matrix of a link, docs/theory.md (2.51). A body has the parameters exactly if
/// it is positive definite: Wensing, Kim, Slotine (2018).
[[nodiscard]] Eigen::Matrix4d pseudo_inertia(const LinkParameters& parameters);
/// The parameters of a pseudo-inertia matrix. Only its symmetric part counts.
[[nodiscard]] LinkParameters link_parameters(const Eigen::Matrix4d& pseudo_inertia);

/// Number i of the symmetric 4 × 4 matrices E_0 … E_9 that are orthonormal for tr(E_i E_j).
[[nodiscard]] Eigen::Matrix4d symmetric_basis(int i);

/// Coordinates of a link's parameters near those of a prior: Π = G (1 + Z) Gᵀ with Π₀ = G Gᵀ
/// and Z = Σ z_i E_i, docs/theory.md (2.52). z = 0 is the prior, and all directions are of one
/// scale.
class LinkCoordinates {
 public:
  /// A prior that no body has is replaced by the nearest one with the same mass and centre of mass,
  /// whose second moments are at least 1e-4 of the largest one.
  explicit LinkCoordinates(const LinkParameters& prior);

  [[nodiscard]] const LinkParameters& prior() const noexcept { return prior_; }
  /// Whether the prior was replaced.
  [[nodiscard]] bool repaired() const noexcept { return repaired_; }
  /// The derivative of the parameters by z; they are prior() + to_parameters() z.
  [[nodiscard]] const Eigen::Matrix<double, 10, 10>& to_parameters() const noexcept {
    return to_parameters_;
  }

 private:
  LinkParameters prior_;
  Eigen::Matrix<double, 10, 10> to_parameters_ = Eigen::Matrix<double, 10, 10>::Zero();
  bool repaired_ = false;
};

/// The divergence tr Z − log det(1 + Z) of a link from its prior, docs/theory.md (2.53), with its
/// derivatives by z.
struct Divergence {
  double value = 0.0;  ///< infinite unless 1 + Z is positive definite
  LinkParameters gradient = LinkParameters::Zero();
  Eigen::Matrix<double, 10, 10> hessian = Eigen::Matrix<double, 10, 10>::Zero();
};
[[nodiscard]] Divergence divergence(const LinkParameters& z);

}  // namespace hamelin::identification
