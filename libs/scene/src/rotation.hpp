#pragma once
#include <Eigen/Geometry>

#include "hamelin/scene/motion.hpp"

namespace hamelin::scene {

/// The rotation of a quaternion from a file, whose norm is one to within the precision of its
/// digits.
[[nodiscard]] inline Eigen::Matrix3d rotation_of(const Quaternion& wxyz) {
  return Eigen::Quaterniond(wxyz[0], wxyz[1], wxyz[2], wxyz[3]).normalized().toRotationMatrix();
}

}  // namespace hamelin::scene
