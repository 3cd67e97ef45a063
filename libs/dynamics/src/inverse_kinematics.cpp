#include "hamelin/dynamics/inverse_kinematics.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace hamelin::dynamics {

namespace {

constexpr int iterations_max = 60;
constexpr double rotation_length = 0.25;  // makes a rotation comparable with a displacement [m]
constexpr double root_damping = 1e-4;     // added to J Jᵀ [m²]
constexpr double largest_step = 0.3;      // of any joint [rad or m]
constexpr double tolerance_share = 1.0 / 3.0;

}  // namespace

JointBox::JointBox(Eigen::Index dof, const Eigen::VectorXd& q_lower, const Eigen::VectorXd& q_upper,
                   double reserve)
    : lower(Eigen::VectorXd::Constant(dof, -std::numbers::pi)),
      upper(Eigen::VectorXd::Constant(dof, std::numbers::pi)) {
  for (Eigen::Index i = 0; i < dof; ++i) {
    if (q_lower.size() == dof && std::isfinite(q_lower[i])) lower[i] = q_lower[i] + reserve;
    if (q_upper.size() == dof && std::isfinite(q_upper[i])) upper[i] = q_upper[i] - reserve;
  }
}

void JointBox::draw(Rng& rng, Eigen::VectorXd& q) const {
  for (Eigen::Index i = 0; i < q.size(); ++i) q[i] = rng.uniform(lower[i], upper[i]);
}

InverseKinematics::InverseKinematics(const model::Model& model, const JointBox& box)
    : model_(model),
      box_(box),
      ws_(model),
      J_(6, model.dof()),
      step_(Eigen::VectorXd::Zero(model.dof())) {}

bool InverseKinematics::solve(const TipTarget& target, Eigen::VectorXd& q) {
  for (iterations_ = 0; iterations_ < iterations_max; ++iterations_) {
    forward_kinematics(model_, ws_, q);
    const geometry::SE3 tip = tip_pose(model_, ws_);
    Eigen::Matrix<double, 6, 1> error = Eigen::Matrix<double, 6, 1>::Zero();
    error.tail<3>() = target.position - tip.p();
    double angle = 0.0;
    if (target.turns) {
      const Eigen::AngleAxisd turn(target.rotation * tip.R().transpose());
      angle = turn.angle();
      error.head<3>() = rotation_length * angle * turn.axis();
    }
    if (error.tail<3>().norm() < tolerance_share * target.tolerance_m &&
        (!target.turns || angle < tolerance_share * target.tolerance_rad))
      return true;
    frame_jacobian(model_, ws_, model_.robot().tip.link, tip.p(), J_);
    J_.topRows<3>() *= target.turns ? rotation_length : 0.0;
    Eigen::Matrix<double, 6, 6> G = J_ * J_.transpose();
    G.diagonal().array() += root_damping;
    step_.noalias() = J_.transpose() * G.llt().solve(error).eval();
    const double largest = step_.lpNorm<Eigen::Infinity>();
    if (largest > largest_step) step_ *= largest_step / largest;
    q = (q + step_).cwiseMax(box_.lower).cwiseMin(box_.upper);
  }
  return false;
}

}  // namespace hamelin::dynamics
