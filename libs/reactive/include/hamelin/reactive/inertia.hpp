#pragma once
#include <Eigen/Cholesky>

#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::reactive {

/// The mass matrix at a configuration, and its inverse. Only the constructor allocates.
class Inertia {
 public:
  explicit Inertia(Eigen::Index dof);

  /// @param ws scratch: it does not contain the forward kinematics at q afterwards
  void update(const model::Model& model, dynamics::Workspace& ws, const Eigen::VectorXd& q);
  [[nodiscard]] const Eigen::MatrixXd& M() const noexcept { return M_; }
  /// M⁻¹.
  [[nodiscard]] const Eigen::MatrixXd& W() const noexcept { return W_; }

 private:
  Eigen::MatrixXd identity_, M_, W_;
  Eigen::LLT<Eigen::MatrixXd> llt_;
};

}  // namespace hamelin::reactive
