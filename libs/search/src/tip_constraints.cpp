#include "hamelin/search/tip_constraints.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <utility>

#include "hamelin/core/numbers.hpp"

namespace hamelin::search {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// What plans leave of a tolerance, at most as shares of it, for an arm that strays from its path.
constexpr double reserve_rad = 0.02, reserve_m = 0.003, reserve_share = 0.3,
                 reserve_box_share = 0.15;
// Shares of what plans may use to which configurations are brought, so that lines between them have
// room to bend; of a box without an end, so far from its other side [m].
constexpr double inner_share = 0.6, inner_m = 0.01;
// What a start may add to what it uses, as a share of the tolerance.
constexpr double start_share = 0.1;
constexpr double rounding = 1e-12;
constexpr int iterations_max = 30;
constexpr double rotation_length = 0.25;  // makes a rotation comparable with a displacement [m]
constexpr double damping = 1e-5;          // added to J Jᵀ [m²]
constexpr double largest_step = 0.3;      // of any joint [rad or m]

Matrix3d frame_along(const Vector3d& direction) {
  return Eigen::Quaterniond::FromTwoVectors(direction, Vector3d::UnitZ()).toRotationMatrix();
}

double angle_of(const Vector3d& value) {
  return std::atan2(value.head<2>().norm(), value.z());
}

// Of all unit vectors that are no farther than `bend` from the segment between two.
double largest_angle(const Vector3d& a, const Vector3d& b, double bend) {
  const double most = std::max(angle_of(a), angle_of(b));
  if (!(a.z() > 0.0 && b.z() > 0.0) || bend == 0.0) return most + bend;
  const double across = std::max(a.head<2>().norm(), b.head<2>().norm());
  return std::max(most, std::asin(std::min(1.0, across + bend)));
}

// The part of [low, high] in which configurations are left where they are.
std::pair<double, double> inner(double low, double high) {
  const bool has_low = std::isfinite(low), has_high = std::isfinite(high);
  const double rim = has_low && has_high ? 0.5 * (1.0 - inner_share) * (high - low) : inner_m;
  return {has_low ? low + rim : low, has_high ? high - rim : high};
}

// About which a vector turns towards z, by its components.
Vector3d turn_axis(const Vector3d& value) {
  const double across = value.head<2>().norm();
  return across > 1e-9 ? Vector3d(value.y() / across, -value.x() / across, 0.0) : Vector3d::UnitX();
}

}  // namespace

TipConstraints::TipConstraints(const model::Model& model,
                               const std::vector<scene::TipConstraint>& constraints)
    : model_(model), levers_(model, nullptr), ws_(model), J_(6, model.dof()) {
  for (const scene::TipConstraint& constraint : constraints) {
    scene::check(constraint, fmt::format("constraint {}", kept_.size() + 1));
    Kept kept{};
    if (const auto* axis = std::get_if<scene::AxisConstraint>(&constraint)) {
      kept.is_axis = true;
      kept.axis = axis->axis.normalized();
      kept.from_world = frame_along(axis->direction.normalized());
      kept.angle = axis->angle_rad;
      kept.reserve = std::min(reserve_rad, reserve_share * kept.angle);
      kept.plan_angle = kept.angle - kept.reserve;
    } else {
      const auto& box = std::get<scene::BoxConstraint>(constraint);
      kept.from_world = box.pose.R().transpose();
      kept.origin = box.pose.p();
      kept.low = box.low_m;
      kept.high = box.high_m;
      const Vector3d reserve = (reserve_box_share * (kept.high - kept.low)).cwiseMin(reserve_m);
      kept.reserve = reserve.minCoeff();
      kept.plan_low = kept.low + reserve;
      kept.plan_high = kept.high - reserve;
    }
    kept_.push_back(kept);
  }
  from_.resize(kept_.size());
  to_ = from_;
  middle_.fill(from_);
  for (auto* x : {&start_, &dq_, &q_, &curvature_, &step_}) x->setZero(model.dof());
  rows_.setZero(3 * static_cast<Index>(kept_.size()), model.dof());
  error_.setZero(rows_.rows());
}

void TipConstraints::place(const VectorXd& q, Values& out) {
  dynamics::forward_kinematics(model_, ws_, q);
  tip_ = dynamics::tip_pose(model_, ws_);
  ++checks_;
  for (std::size_t k = 0; k < kept_.size(); ++k) out[k] = value_of(kept_[k], tip_);
}

Vector3d TipConstraints::value_of(const Kept& kept, const geometry::SE3& tip) {
  return kept.from_world *
         (kept.is_axis ? Vector3d(tip.R() * kept.axis) : Vector3d(tip.p() - kept.origin));
}

double TipConstraints::excess_of(const Kept& kept, const Vector3d& value) {
  return kept.is_axis ? angle_of(value) - kept.angle
                      : (value - kept.high).cwiseMax(kept.low - value).maxCoeff();
}

// docs/theory.md (21.1)
void TipConstraints::measure(const VectorXd& a, const VectorXd& b, std::vector<double>& by) {
  set_motion(a, b, VectorXd::Zero(a.size()));
  place(a, from_);
  place(b, to_);
  for (std::size_t k = 0; k < kept_.size(); ++k)
    by[k] = kept_[k].is_axis
                ? largest_angle(from_[k], to_[k], bend_rad_) - kept_[k].angle
                : std::max(excess_of(kept_[k], from_[k]), excess_of(kept_[k], to_[k])) + bend_m_;
}

TipConstraints::Excess TipConstraints::excess(const VectorXd& q) {
  place(q, from_);
  Excess worst{0, -infinity};
  for (std::size_t k = 0; k < kept_.size(); ++k)
    if (const double by = excess_of(kept_[k], from_[k]); by > worst.by) worst = {k, by};
  return worst;
}

TipConstraints::Excess TipConstraints::excess(const dynamics::TipTarget& target) const {
  Excess worst{0, -infinity};
  for (std::size_t k = 0; k < kept_.size(); ++k) {
    if (kept_[k].is_axis && !target.turns) continue;
    const double by = excess_of(kept_[k], value_of(kept_[k], {target.rotation, target.position}));
    if (by > worst.by) worst = {k, by};
  }
  return worst;
}

std::string TipConstraints::describe(const Excess& excess) const {
  const bool is_axis = kept_[excess.constraint].is_axis;
  return fmt::format("constraint {} ({}) is exceeded by {:.3g} {}", excess.constraint + 1,
                     is_axis ? "axis" : "box", excess.by, is_axis ? "rad" : "m");
}

void TipConstraints::admit(const VectorXd& q) {
  place(q, from_);
  for (std::size_t k = 0; k < kept_.size(); ++k) {
    Kept& kept = kept_[k];
    if (kept.is_axis) {
      kept.plan_angle = std::max(
          kept.plan_angle, std::min(kept.angle, angle_of(from_[k]) + start_share * kept.angle));
      continue;
    }
    const Vector3d more = (start_share * (kept.high - kept.low)).cwiseMin(reserve_m);
    kept.plan_low = kept.plan_low.cwiseMin((from_[k] - more).cwiseMax(kept.low));
    kept.plan_high = kept.plan_high.cwiseMax((from_[k] + more).cwiseMin(kept.high));
  }
}

// docs/theory.md (21.1), (21.2): values stray from the segment between those of the ends.
bool TipConstraints::within_plan(std::size_t k, const Vector3d& a, const Vector3d& b,
                                 double width) const {
  const Kept& kept = kept_[k];
  if (kept.is_axis) {
    const double stray = stray_rad_ + width * width * bend_rad_ + rounding;
    return a.z() > 0.0 && b.z() > 0.0 &&
           std::max(a.head<2>().norm(), b.head<2>().norm()) + stray <= std::sin(kept.plan_angle);
  }
  const double stray = stray_m_ + width * width * bend_m_ + rounding;
  return (a.cwiseMin(b).array() - stray >= kept.plan_low.array()).all() &&
         (a.cwiseMax(b).array() + stray <= kept.plan_high.array()).all();
}

double TipConstraints::turn_of(const VectorXd& deviation) const {
  double out = 0.0;
  for (Index j = 0; j <= model_.robot().tip.link; ++j)
    if (!levers_.slides(j)) out += deviation[j];
  return out;
}

double TipConstraints::reserve_used(const VectorXd& deviation) const {
  double most = 0.0;
  for (const Kept& kept : kept_)
    most = std::max(
        most, (kept.is_axis ? turn_of(deviation) : levers_.tip().dot(deviation)) / kept.reserve);
  return most;
}

bool TipConstraints::keeps(const VectorXd& q) {
  stray_rad_ = stray_m_ = 0.0;
  place(q, from_);
  for (std::size_t k = 0; k < kept_.size(); ++k)
    if (!within_plan(k, from_[k], from_[k], 0.0)) return false;
  return true;
}

bool TipConstraints::motion_keeps(const VectorXd& a, const VectorXd& b, const VectorXd& stray) {
  set_motion(a, b, stray);
  place(b, to_);
  for (std::size_t k = 0; k < kept_.size(); ++k)
    if (!within_plan(k, to_[k], to_[k], 0.0)) return false;
  place(a, from_);
  return piece_keeps(0.0, 1.0, from_, to_, 0);
}

void TipConstraints::set_motion(const VectorXd& a, const VectorXd& b, const VectorXd& stray) {
  start_ = a;
  dq_ = b - a;
  q_ = stray;
  levers_.extend_travel(a, q_);
  levers_.extend_travel(b, q_);
  levers_.curvature(dq_, curvature_);
  bend_rad_ = 0.125 * turn_of(curvature_);
  bend_m_ = 0.125 * levers_.tip().dot(curvature_);
  stray_rad_ = turn_of(stray);
  stray_m_ = levers_.tip().dot(stray);
}

bool TipConstraints::piece_keeps(double from, double to, const Values& a, const Values& b,
                                 int depth) {
  bool proved = true;
  for (std::size_t k = 0; k < kept_.size() && proved; ++k)
    proved = within_plan(k, a[k], b[k], to - from);
  if (proved) return true;
  if (depth == depth_max) return false;
  Values& middle = middle_[static_cast<std::size_t>(depth)];
  const double half = 0.5 * (from + to);
  q_ = start_ + half * dq_;
  place(q_, middle);
  for (std::size_t k = 0; k < kept_.size(); ++k)
    if (!within_plan(k, middle[k], middle[k], 0.0)) return false;
  return piece_keeps(from, half, a, middle, depth + 1) &&
         piece_keeps(half, to, middle, b, depth + 1);
}

void TipConstraints::add_rows(const Kept& kept, const Vector3d& value) {
  if (kept.is_axis) {
    const double by = angle_of(value) - inner_share * kept.plan_angle;
    if (by <= 0.0) return;
    const Vector3d about = kept.from_world.transpose() * turn_axis(value);
    rows_.row(row_count_).noalias() = rotation_length * (about.transpose() * J_.topRows<3>());
    error_[row_count_++] = rotation_length * by;
    return;
  }
  for (Index i = 0; i < 3; ++i) {
    const auto [low, high] = inner(kept.plan_low[i], kept.plan_high[i]);
    const double by = value[i] < low ? low - value[i] : std::min(0.0, high - value[i]);
    if (by == 0.0) continue;
    rows_.row(row_count_).noalias() = kept.from_world.row(i) * J_.bottomRows<3>();
    error_[row_count_++] = by;
  }
}

// docs/theory.md (21.3)
bool TipConstraints::project(VectorXd& q, const dynamics::JointBox& box) {
  if (keeps(q)) return true;
  for (int k = 0; k < iterations_max; ++k) {
    place(q, from_);
    dynamics::frame_jacobian(model_, ws_, model_.robot().tip.link, tip_.p(), J_);
    row_count_ = 0;
    for (std::size_t i = 0; i < kept_.size(); ++i) add_rows(kept_[i], from_[i]);
    if (row_count_ == 0) break;
    const auto rows = rows_.topRows(row_count_);
    Eigen::MatrixXd G = rows * rows.transpose();
    G.diagonal().array() += damping;
    step_.noalias() = rows.transpose() * G.llt().solve(error_.head(row_count_)).eval();
    const double largest = step_.lpNorm<Eigen::Infinity>();
    if (largest > largest_step) step_ *= largest_step / largest;
    q = (q + step_).cwiseMax(box.lower).cwiseMin(box.upper);
    if (largest < 1e-4) break;
  }
  return keeps(q);
}

void TipConstraints::restrict(dynamics::TipTarget& target, const VectorXd& seed) {
  for (const Kept& kept : kept_) {
    if (kept.is_axis) {
      if (!target.turns) {
        place(seed, from_);
        target.rotation = tip_.R();
        target.turns = true;
        target.tolerance_rad = infinity;
      }
      const Vector3d value = kept.from_world * target.rotation * kept.axis;
      const double by = angle_of(value) - inner_share * kept.plan_angle;
      if (by > 0.0) {
        const Vector3d about = kept.from_world.transpose() * turn_axis(value);
        target.rotation = Eigen::AngleAxisd(by, about).toRotationMatrix() * target.rotation;
      }
      target.tolerance_rad = std::min(target.tolerance_rad, (1.0 - inner_share) * kept.plan_angle);
      continue;
    }
    Vector3d value = kept.from_world * (target.position - kept.origin);
    for (Index i = 0; i < 3; ++i) {
      const auto [low, high] = inner(kept.plan_low[i], kept.plan_high[i]);
      value[i] = std::clamp(value[i], low, std::max(low, high));
      if (std::isfinite(low))
        target.tolerance_m = std::min(target.tolerance_m, low - kept.plan_low[i]);
      if (std::isfinite(high))
        target.tolerance_m = std::min(target.tolerance_m, kept.plan_high[i] - high);
    }
    target.position = kept.origin + kept.from_world.transpose() * value;
  }
}

}  // namespace hamelin::search
