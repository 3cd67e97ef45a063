#include "hamelin/dynamics/inverse_kinematics.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"

namespace hamelin::dynamics {

namespace {

constexpr int iterations_max = 60;
constexpr double rotation_length = 0.25;  // makes a rotation comparable with a displacement [m]
constexpr double root_damping = 1e-4;     // added to J Jᵀ [m²]
constexpr double largest_step = 0.3;      // of any joint [rad or m]
constexpr double tolerance_share = 1.0 / 3.0;
constexpr double rotation_tolerance = 1e-6;  // of the entries of R Rᵀ

void require(bool holds, const char* what) {
  if (!holds) [[unlikely]]
    throw Error(ErrorCode::usage, formatted("inverse kinematics: {}", what));
}

bool is_rotation(const Eigen::Matrix3d& R) {
  const double off = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  return R.allFinite() && off <= rotation_tolerance && R.determinant() > 0.0;
}

void check(const TipTarget& target) {
  require(target.position.allFinite(),
          "target: the position is not finite, expected finite numbers");
  require(target.tolerance_m > 0.0, "target: tolerance_m is not a number above 0");
  if (!target.turns) return;
  require(is_rotation(target.rotation), "target: the rotation is not a rotation matrix");
  require(target.tolerance_rad > 0.0, "target: tolerance_rad is not a number above 0");
}

// Checks limits of a box, which may be infinite.
void check_limits(const Eigen::VectorXd& limits, Eigen::Index dof, const char* name) {
  if (limits.size() != 0 && limits.size() != dof)
    throw Error(ErrorCode::usage, formatted("joint box: {}: {} given, expected none or {} (one per "
                                            "joint)",
                                            name, limits.size(), dof));
  for (Eigen::Index i = 0; i < limits.size(); ++i)
    if (std::isnan(limits[i]))
      throw Error(ErrorCode::usage,
                  formatted("joint box: {}: the one of joint {} is not a number", name, i));
}

}  // namespace

JointBox::JointBox(Eigen::Index dof, const Eigen::VectorXd& q_lower, const Eigen::VectorXd& q_upper,
                   double reserve)
    : lower(Eigen::VectorXd::Constant(dof, -std::numbers::pi)),
      upper(Eigen::VectorXd::Constant(dof, std::numbers::pi)) {
  check_limits(q_lower, dof, "q_lower");
  check_limits(q_upper, dof, "q_upper");
  if (!(reserve >= 0.0) || !std::isfinite(reserve))
    throw Error(ErrorCode::usage, formatted("joint box: reserve: {} given, expected a finite "
                                            "number of at least 0",
                                            reserve));
  for (Eigen::Index i = 0; i < dof; ++i) {
    const bool has_lower = q_lower.size() == dof && std::isfinite(q_lower[i]),
               has_upper = q_upper.size() == dof && std::isfinite(q_upper[i]);
    if (has_lower && has_upper && !(q_lower[i] <= q_upper[i]))
      throw Error(ErrorCode::usage,
                  formatted("joint box: joint {}: the lower limit {} is above the upper limit {}",
                            i, q_lower[i], q_upper[i]));
    if (has_lower) lower[i] = q_lower[i] + reserve;
    if (has_upper) upper[i] = q_upper[i] - reserve;
    if (lower[i] <= upper[i]) continue;
    if (has_lower && has_upper)  // the range is narrower than both reserves
      lower[i] = upper[i] = 0.5 * (q_lower[i] + q_upper[i]);
    else if (has_lower)  // the only limit is beyond the ±π of the other side
      upper[i] = lower[i] + 2.0 * std::numbers::pi;
    else
      lower[i] = upper[i] - 2.0 * std::numbers::pi;
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
      step_(Eigen::VectorXd::Zero(model.dof())) {
  if (box.lower.size() != model.dof() || box.upper.size() != model.dof())
    throw Error(ErrorCode::usage,
                formatted("inverse kinematics: box: made for {} joints, expected {} of '{}'",
                          box.lower.size(), model.dof(), model.robot().name));
}

bool InverseKinematics::solve(const TipTarget& target, Eigen::VectorXd& q) {
  check(target);
  require(q.size() == model_.dof(), "q: expected one number per joint of the model");
  require(q.allFinite(), "q: a number is not finite, expected finite numbers");
  require(&q != &box_.lower && &q != &box_.upper, "q: is a vector of the box, expected another");
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
    inverse_.factor(J_, root_damping);
    inverse_.apply(J_, error, step_);
    const double largest = step_.lpNorm<Eigen::Infinity>();
    if (largest > largest_step) step_ *= largest_step / largest;
    q = (q + step_).cwiseMax(box_.lower).cwiseMin(box_.upper);
  }
  return false;
}

}  // namespace hamelin::dynamics
