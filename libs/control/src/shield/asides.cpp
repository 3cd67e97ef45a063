#include "shield/asides.hpp"

#include <Eigen/Geometry>
#include <algorithm>

namespace hamelin::control {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// Distance between configurations of the trail, and lengths of ways, one after the other [rad or
// m].
constexpr double trail_spacing = 0.1;
constexpr Index trail_points = 16;
constexpr std::array<double, 3> lengths{0.25, 0.5, Asides::longest};
constexpr double least_row = 1e-6;

}  // namespace

Asides::Asides(const model::Model& model, const ModelledLimits& limits, const VectorXd& reserve,
               std::uint64_t seed)
    : model_(model), rng_(seed), trail_(model.dof(), trail_points, trail_spacing) {
  if (limits.q_lower.size() == 0) return;
  lower_ = limits.q_lower + reserve;
  upper_ = limits.q_upper - reserve;
}

void Asides::propose(dynamics::Workspace& ws, const MoverCheck::Threat& threat,
                     const VectorXd& from, const VectorXd& ahead, VectorXd& target) {
  const int kind = next_ % kinds;
  const double length = lengths[static_cast<std::size_t>(next_ / kinds) % lengths.size()];
  next_ = (next_ + 1) % (kinds * static_cast<int>(lengths.size()));
  target.setZero();
  if (kind < directions && threat.shape >= 0) {
    const Vector3d& n = threat.direction;
    const Vector3d t = n.unitOrthogonal(), u = n.cross(t);
    const std::array<Vector3d, directions> ways{n, n + t, n - t, n + u, n - u, Vector3d::UnitZ()};
    dynamics::forward_kinematics(model_, ws, threat.q);
    dynamics::point_jacobian_transpose(model_, ws,
                                       model_.shapes()[static_cast<std::size_t>(threat.shape)].link,
                                       threat.point, ways[static_cast<std::size_t>(kind)], target);
  } else if (kind < directions + 2 && trail_.size() > 0) {
    const Index age = std::min(trail_.size() - 1, static_cast<Index>(length / trail_spacing));
    target = trail_.point(age) - from;
  } else if (kind == directions + 2) {
    target = ahead;
  }
  if (target.norm() < least_row)
    for (double& x : target) x = rng_.uniform(-1.0, 1.0);
  target = from + length / target.norm() * target;
  if (lower_.size() > 0) target = target.cwiseMax(lower_).cwiseMin(upper_);
}

}  // namespace hamelin::control
