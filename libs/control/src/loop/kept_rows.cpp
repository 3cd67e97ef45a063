#include "loop/kept_rows.hpp"

#include <algorithm>
#include <cmath>
#include <variant>

#include "hamelin/scene/goal.hpp"
#include "hamelin/search/tip_constraints.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

// A box has two sides along each of its axes.
constexpr Index rows_max = 6 * static_cast<Index>(scene::constraints_max);

}  // namespace

KeptRows::KeptRows(Index dof)
    : J_(dynamics::Matrix6Xd::Zero(6, dof)),
      slack_(Eigen::VectorXd::Zero(rows_max)),
      gradient_(Eigen::MatrixXd::Zero(dof, rows_max)) {}

void KeptRows::update(const model::Model& model, const dynamics::Workspace& ws,
                      const std::vector<scene::TipConstraint>& constraints) {
  count_ = 0;
  if (constraints.empty()) return;
  const geometry::SE3 tip = dynamics::tip_pose(model, ws);
  dynamics::frame_jacobian(model, ws, model.robot().tip.link, tip.p(), J_);
  for (const scene::TipConstraint& constraint : constraints)
    std::visit([&](const auto& each) { add(each, tip); }, constraint);
}

// The angle between two vectors has no derivative where it is zero, and nothing to keep there.
void KeptRows::add(const scene::AxisConstraint& axis, const geometry::SE3& tip) {
  const Vector3d a = tip.R() * axis.axis.normalized(), d = axis.direction.normalized(),
                 about = a.cross(d);
  const double across = about.norm();
  slack_[count_] = axis.angle_rad - search::plan_reserve(axis) - std::atan2(across, a.dot(d));
  if (across > 1e-9)
    gradient_.col(count_).noalias() = J_.topRows<3>().transpose() * (about / across);
  else
    gradient_.col(count_).setZero();
  ++count_;
}

void KeptRows::add(const scene::BoxConstraint& box, const geometry::SE3& tip) {
  const Vector3d reserve = search::plan_reserve(box);
  const Vector3d at = box.pose.R().transpose() * (tip.p() - box.pose.p());
  for (Index i = 0; i < 3; ++i)
    for (const double side : {-1.0, 1.0}) {
      const double bound = side < 0.0 ? box.low_m[i] : box.high_m[i];
      if (!std::isfinite(bound)) continue;
      slack_[count_] = side * (bound - at[i]) - reserve[i];
      gradient_.col(count_).noalias() =
          -side * (J_.bottomRows<3>().transpose() * box.pose.R().col(i));
      ++count_;
    }
}

}  // namespace hamelin::control
