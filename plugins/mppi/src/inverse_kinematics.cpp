#include "inverse_kinematics.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace hamelin::mppi {

namespace {

constexpr int iterations_max = 60;
constexpr double rotation_length = 0.25;  // makes a rotation comparable with a displacement [m]
constexpr double root_damping = 1e-4;     // added to J Jᵀ [m²]
constexpr double largest_step = 0.3;      // of any joint [rad or m]
constexpr double tolerance_share = 1.0 / 3.0;

}  // namespace

JointBox::JointBox(const planning::Setup& setup, double reserve)
    : lower(setup.dof()), upper(setup.dof()) {
  const auto low = setup.q_lower(), high = setup.q_upper();
  for (int i = 0; i < setup.dof(); ++i) {
    lower[i] = low && std::isfinite((*low)[i]) ? (*low)[i] + reserve : -std::numbers::pi;
    upper[i] = high && std::isfinite((*high)[i]) ? (*high)[i] - reserve : std::numbers::pi;
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

bool InverseKinematics::solve(const Goal& goal, Eigen::VectorXd& q) {
  const bool turns = goal.type == HAMELIN_GOAL_POSE;
  for (iterations_ = 0; iterations_ < iterations_max; ++iterations_) {
    dynamics::forward_kinematics(model_, ws_, q);
    const geometry::SE3 tip = dynamics::tip_pose(model_, ws_);
    Eigen::Matrix<double, 6, 1> error = Eigen::Matrix<double, 6, 1>::Zero();
    error.tail<3>() = goal.position - tip.p();
    double angle = 0.0;
    if (turns) {
      const Eigen::AngleAxisd turn(goal.rotation * tip.R().transpose());
      angle = turn.angle();
      error.head<3>() = rotation_length * angle * turn.axis();
    }
    if (error.tail<3>().norm() < tolerance_share * goal.tolerance_m &&
        (!turns || angle < tolerance_share * goal.tolerance_rad))
      return true;
    dynamics::frame_jacobian(model_, ws_, model_.robot().tip.link, tip.p(), J_);
    J_.topRows<3>() *= turns ? rotation_length : 0.0;
    Eigen::Matrix<double, 6, 6> G = J_ * J_.transpose();
    G.diagonal().array() += root_damping;
    step_.noalias() = J_.transpose() * G.llt().solve(error).eval();
    const double largest = step_.lpNorm<Eigen::Infinity>();
    if (largest > largest_step) step_ *= largest_step / largest;
    q = (q + step_).cwiseMax(box_.lower).cwiseMin(box_.upper);
  }
  return false;
}

}  // namespace hamelin::mppi
