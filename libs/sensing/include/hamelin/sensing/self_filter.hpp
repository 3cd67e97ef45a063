#pragma once
#include <Eigen/Core>

#include "hamelin/scene/shapes.hpp"

namespace hamelin::sensing {

/// Removes the points that may be on the arm: those within `margin_m` of its shapes, or within
/// them. The others are moved to the front in their order. No allocation.
/// @param arm its shapes when the points were seen, in the frame of the points
/// @param margin_m for the noise of the points, and what the shapes leave out of the arm
/// @param points 3 × N [m], finite
/// @return how many remain
/// @throws Error invalid for a margin that is negative or not finite
Eigen::Index remove_arm(const scene::Shapes& arm, double margin_m,
                        Eigen::Ref<Eigen::Matrix3Xf> points);

}  // namespace hamelin::sensing
