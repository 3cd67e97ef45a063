#pragma once
#include <Eigen/Core>

#include "hamelin/core/rng.hpp"

namespace hamelin::dynamics {

/// The box in joint space from which random joint vectors are drawn [rad or m].
struct JointBox {
  /// @param q_lower, q_upper joint limits, of size zero where they are not modelled: ±π
  /// @param reserve kept from joint limits
  JointBox(Eigen::Index dof, const Eigen::VectorXd& q_lower, const Eigen::VectorXd& q_upper,
           double reserve);
  void draw(Rng& rng, Eigen::VectorXd& q) const;
  Eigen::VectorXd lower, upper;
};

}  // namespace hamelin::dynamics
