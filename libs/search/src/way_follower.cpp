#include "way_follower.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <numbers>
#include <utility>

#include "tip_rule.hpp"

namespace hamelin::search {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

constexpr int tries = 12;  // ways of a redundant arm
constexpr int reach_steps = 30;
constexpr double reach_damping = 1e-6;  // added to J Jᵀ [m²]
constexpr double reach_step = 0.2;      // of any joint [rad or m]
// How near to the curve way-points are, as a share of the tolerance.
constexpr double on_curve_share = 0.1;
// The length of the first step, of the shortest and the longest one, and how they change.
constexpr double first_m = 0.02, shortest_m = 2e-4, longest_m = 0.1, longer = 1.7, shorter = 0.5;
constexpr double lean_rate = 2.0;  // per curve

}  // namespace

WayFollower::WayFollower(const model::Model& model, const dynamics::JointBox& box)
    : model_(model), box_(box), ws_(model), J_(6, model.dof()) {
  for (VectorXd* x : {&from_, &q_, &bias_, &step_, &held_}) x->setZero(model.dof());
}

FollowedWay WayFollower::follow(const TipCurve& curve, const scene::WayTolerance& tolerance,
                                const VectorXd& start, Query& query, Rng& rng) {
  tolerance_ = tolerance;
  TipConstraints tube(model_, {});
  tube.add(curve, tolerance);
  FollowedWay best;
  for (int k = 0; k < tries && best.share < 1.0; ++k) {
    leans_ = k > 0;
    if (leans_) box_.draw(rng, bias_);
    if (FollowedWay found = follow(curve, start, tube, query); k == 0 || found.share > best.share)
      best = std::move(found);
    if (model_.dof() <= 6) break;
  }
  checks_ += tube.checks();
  return best;
}

FollowedWay WayFollower::follow(const TipCurve& curve, const VectorXd& start, TipConstraints& tube,
                                Query& query) {
  FollowedWay out;
  if (!tube.keeps(start)) {
    out.cause = "where the arm is, its tip is not on the way";
    return out;
  }
  dynamics::forward_kinematics(model_, ws_, start);
  std::vector<VectorXd> points{start};
  const double size = std::max(curve.length_m() + rotation_length * curve.turn_rad(), shortest_m);
  double s = curve.nearest(dynamics::tip_pose(model_, ws_)), ds = first_m / size;
  Failure failure = Failure::none;
  from_ = start;
  while (s < 1.0 && ds * size >= shortest_m) {
    const double to = std::min(1.0, s + ds);
    failure = step(curve.at(to), to - s, tube, query);
    if (failure != Failure::none) {
      ds *= shorter;
      continue;
    }
    s = to;
    from_ = q_;
    points.push_back(q_);
    ds = std::min(longer * ds, longest_m / size);
  }
  out.share = s;
  if (s < 1.0)
    out.cause = fmt::format("clear up to {:.3g} %, then {}", 100.0 * s, describe(failure));
  out.points.resize(start.size(), static_cast<Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) out.points.col(static_cast<Index>(i)) = points[i];
  return out;
}

WayFollower::Failure WayFollower::step(const geometry::SE3& target, double share,
                                       TipConstraints& tube, Query& query) {
  q_ = from_;
  if (leans_) lean(share);
  if (!reach(target)) return Failure::reach;
  step_.setZero();
  if (!tube.motion_keeps(from_, q_, step_)) return Failure::jump;
  return query.motion_clear(from_, q_) ? Failure::none : Failure::contact;
}

void WayFollower::set_jacobian() {
  dynamics::forward_kinematics(model_, ws_, q_);
  dynamics::frame_jacobian(model_, ws_, model_.robot().tip.link,
                           dynamics::tip_pose(model_, ws_).p(), J_);
  J_.topRows<3>() *= tolerance_.rad < std::numbers::pi ? rotation_length : 0.0;
  inverse_.factor(J_, reach_damping);
  ++checks_;
}

void WayFollower::lean(double share) {
  set_jacobian();
  step_ = std::min(1.0, lean_rate * share) * (bias_ - q_);
  const Eigen::Matrix<double, 6, 1> moved = J_ * step_;
  inverse_.apply(J_, moved, held_);
  step_ -= held_;
  q_ = (q_ + step_).cwiseMax(box_.lower).cwiseMin(box_.upper);
}

// Damped least squares; reach_damping is small, since q_ is near.
bool WayFollower::reach(const geometry::SE3& target) {
  for (int k = 0; k < reach_steps; ++k) {
    set_jacobian();
    const geometry::SE3 tip = dynamics::tip_pose(model_, ws_);
    const Eigen::AngleAxisd turn(target.R() * tip.R().transpose());
    Eigen::Matrix<double, 6, 1> error;
    error << rotation_length * turn.angle() * turn.axis(), target.p() - tip.p();
    if (!(tolerance_.rad < std::numbers::pi)) error.head<3>().setZero();
    if (error.tail<3>().norm() < on_curve_share * tolerance_.m &&
        error.head<3>().norm() < rotation_length * on_curve_share * tolerance_.rad)
      return true;
    inverse_.apply(J_, error, step_);
    const double largest = step_.lpNorm<Eigen::Infinity>();
    if (largest > reach_step) step_ *= reach_step / largest;
    q_ = (q_ + step_).cwiseMax(box_.lower).cwiseMin(box_.upper);
  }
  return false;
}

std::string WayFollower::describe(Failure failure) const {
  if (failure == Failure::contact) return "the arm is not clear";
  if (failure == Failure::jump) return "the joints would have to jump";
  for (Index j = 0; j < q_.size(); ++j)
    if (q_[j] <= box_.lower[j] || q_[j] >= box_.upper[j])
      return fmt::format("joint '{}' is at its limit",
                         model_.robot().links[static_cast<std::size_t>(j)].joint.name);
  return "the tip is as far as it can reach";
}

}  // namespace hamelin::search
