#pragma once
#include <Eigen/Cholesky>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/geometry/se3.hpp"

namespace hamelin::dynamics {

/// The damped inverse Jᵀ (J Jᵀ + λ 1)⁻¹ of a Jacobian of the tip. It gives the joint step of least
/// squares for an error of the tip, and stays bounded near singular configurations (Wampler 1986;
/// Nakamura, Hanafusa 1986). Its functions do not allocate.
class DampedInverse {
 public:
  /// @param J  6 × dof
  /// @param damping  λ > 0, in the square of the units of J
  void factor(const Matrix6Xd& J, double damping);
  /// As factor, with a damping that is relative to the trace of J Jᵀ, which counts as at least
  /// `least_trace`.
  void factor_relative(const Matrix6Xd& J, double damping, double least_trace);
  /// Replaces the damping of factor_relative.
  void damp_relative(double damping);

  /// The joint step Jᵀ (J Jᵀ + λ 1)⁻¹ e for an error e of the tip.
  /// @param J  the Jacobian that was factored
  /// @param out  dof
  void apply(const Matrix6Xd& J, const geometry::Vector6d& error, Eigen::VectorXd& out) const;

 private:
  geometry::Matrix6d G_ = geometry::Matrix6d::Identity();
  Eigen::LLT<geometry::Matrix6d> factors_;
  double damping_ = 0.0, trace_ = 0.0;
};

}  // namespace hamelin::dynamics
