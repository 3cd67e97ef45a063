#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <span>

#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::mppi {

/// The positions of the tip at the knots of a motion, for drawing it [m, world].
/// @param points control points, one per column
/// @param out as many positions as it has room for, at most points.cols() − 2
/// @return their number
template <class Points>
Eigen::Index tip_path(const model::Model& model, dynamics::Workspace& ws, const Points& points,
                      std::span<Eigen::Vector3d> out) {
  const Eigen::Index count = std::min(points.cols() - 2, static_cast<Eigen::Index>(out.size()));
  Eigen::VectorXd q(points.rows());
  for (Eigen::Index i = 0; i < count; ++i) {
    q = (points.col(i) + 4.0 * points.col(i + 1) + points.col(i + 2)) / 6.0;
    dynamics::forward_kinematics(model, ws, q);
    out[static_cast<std::size_t>(i)] = dynamics::tip_pose(model, ws).p();
  }
  return count;
}

}  // namespace hamelin::mppi
