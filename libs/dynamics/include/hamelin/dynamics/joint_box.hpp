#pragma once
#include <Eigen/Core>

#include "hamelin/core/rng.hpp"

namespace hamelin::dynamics {

/// The box in joint space from which random joint vectors are drawn [rad or m].
struct JointBox {
  /// @param q_lower, q_upper joint limits, of size zero where they are not modelled, infinite for a
  ///        joint without one: ±π, or a full turn from the other limit if that is beyond ±π
  /// @param reserve kept from joint limits, at most half of the range between both
  /// @throws Error usage for limits of another size, NaN, a lower limit above the upper one, or a
  ///         reserve that is negative or not finite
  JointBox(Eigen::Index dof, const Eigen::VectorXd& q_lower, const Eigen::VectorXd& q_upper,
           double reserve);
  /// @param q dof numbers, not a vector of the box
  void draw(Rng& rng, Eigen::VectorXd& q) const;
  Eigen::VectorXd lower, upper;
};

}  // namespace hamelin::dynamics
