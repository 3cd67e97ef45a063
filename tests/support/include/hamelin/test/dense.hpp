#pragma once
#include <Eigen/Core>

#include "hamelin/model/model.hpp"

namespace hamelin::test {

/// An independent reference for dynamics: product of exponentials and dense Lagrangian mechanics,
/// without recursion and joint frames.
struct Dense {
  const model::Model& model;

  [[nodiscard]] geometry::SE3 com_pose(int link, const Eigen::VectorXd& q) const {
    geometry::SE3 g = model.base();
    for (int j = 0; j <= link; ++j)
      g = g *
          geometry::SE3::exp(model.robot().links[static_cast<std::size_t>(j)].joint.screw * q[j]);
    return g * model.robot().links[static_cast<std::size_t>(link)].com;
  }
  [[nodiscard]] Eigen::MatrixXd mass(const Eigen::VectorXd& q) const {
    const int n = model.dof();
    Eigen::MatrixXd M = Eigen::MatrixXd::Zero(n, n);
    for (int i = 0; i < n; ++i) {
      const auto& link = model.robot().links[static_cast<std::size_t>(i)];
      Eigen::Matrix<double, 6, 6> G = Eigen::Matrix<double, 6, 6>::Zero();
      G.topLeftCorner<3, 3>() = link.inertia_kg_m2;
      G.bottomRightCorner<3, 3>() = link.mass_kg * Eigen::Matrix3d::Identity();
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(6, n);  // body Jacobian of the COM frame
      geometry::SE3 g = model.base();
      const geometry::SE3 inverse = com_pose(i, q).inverse();
      for (int j = 0; j <= i; ++j) {
        const auto& screw = model.robot().links[static_cast<std::size_t>(j)].joint.screw;
        J.col(j) = (inverse * g).Ad() * screw;
        g = g * geometry::SE3::exp(screw * q[j]);
      }
      M += J.transpose() * G * J;
      M(i, i) += link.joint.armature;
    }
    return M;
  }
  [[nodiscard]] double potential(const Eigen::VectorXd& q) const {
    double U = 0.0;
    for (int i = 0; i < model.dof(); ++i)
      U -= model.robot().links[static_cast<std::size_t>(i)].mass_kg *
           model.gravity().dot(com_pose(i, q).p());
    return U;
  }
  /// C(q, v) v + ∂U(q)/∂q with the Coriolis matrix C and the potential energy U, by central
  /// differences of the mass matrix and of U.
  [[nodiscard]] Eigen::VectorXd bias(const Eigen::VectorXd& q, const Eigen::VectorXd& v) const {
    const int n = model.dof();
    const double e = 1e-5;
    Eigen::VectorXd out = Eigen::VectorXd::Zero(n);
    for (int i = 0; i < n; ++i) {
      Eigen::VectorXd qp = q, qm = q;
      qp[i] += e;
      qm[i] -= e;
      const Eigen::MatrixXd dM = (mass(qp) - mass(qm)) / (2.0 * e);
      out += dM * v * v[i];
      out[i] -= 0.5 * v.dot(dM * v);
      out[i] += (potential(qp) - potential(qm)) / (2.0 * e);
    }
    return out;
  }
};

}  // namespace hamelin::test
