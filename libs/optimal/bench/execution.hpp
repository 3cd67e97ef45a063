#pragma once
#include "hamelin/optimal/solve.hpp"

/// What torques do to an arm, by gauss:8 at 1e-12.
namespace hamelin::optimal {

/// The largest error of a joint at the end if torques that are linear between the knots move the
/// arm [rad or m]: each interval is done in 100 parts, in each of which the torque is its mean.
/// With `held`, each torque is held from half a step before its knot to half a step after it.
[[nodiscard]] double executed_error(const Problem& problem, const MatrixXd& torque, double h,
                                    bool held);

/// The same with the torques along the motion, at 20 points per interval and linear between them.
[[nodiscard]] double motion_error(const Problem& problem, const Solution& found);

}  // namespace hamelin::optimal
