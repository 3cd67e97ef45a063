#pragma once
#include <Eigen/Core>
#include <variant>
#include <vector>

#include "hamelin/dynamics/kernel/planar.hpp"
#include "hamelin/dynamics/kernel/spatial.hpp"
#include "hamelin/dynamics/kernel/sweeps.hpp"
#include "hamelin/model/model.hpp"

namespace hamelin::dynamics {

/// All scratch of the algorithms for one model and one thread. Made once; nothing allocates afterwards.
class Workspace {
 public:
  explicit Workspace(const model::Model& model);

  /// A link's joint-aligned frame in the world, as the last forward_kinematics left it.
  struct Frame {
    Eigen::Matrix3d R;
    Eigen::Vector3d p;
    Eigen::Vector3d axis;  ///< the joint's axis (revolute) or direction (prismatic), unit, world
  };

  std::variant<kernel::Scratch<kernel::Spatial<double>>, kernel::Scratch<kernel::Planar<double>>> links;
  std::vector<Frame> frames;
  /// Angular velocity and velocity of a frame's origin, or moment about it and force; world axes.
  struct Pair {
    Eigen::Vector3d angular, linear;
  };
  std::vector<Pair> motions, forces;
  Eigen::VectorXd column_in, column_out;  ///< joint vectors of operational_inertia
};

/// Calls f(Space{}, chain, scratch) with the group of this model: one branch a call, none inside.
template <class F>
decltype(auto) with_group(const model::Model& model, Workspace& ws, F&& f) {
  if (const auto* planar = std::get_if<model::PlanarChain>(&model.chain()))
    return f(kernel::Planar<double>{}, *planar, std::get<1>(ws.links));
  return f(kernel::Spatial<double>{}, std::get<0>(model.chain()), std::get<0>(ws.links));
}

}  // namespace hamelin::dynamics
