#pragma once
#include <string>

#include "hamelin/scene/obstacles.hpp"

namespace hamelin::test {

/// A sphere at rest.
inline scene::Obstacle ball(const std::string& name, const Eigen::Vector3d& at,
                            double radius = 0.1) {
  scene::Obstacle out;
  out.name = name;
  out.radius_m = radius;
  out.pose = {Eigen::Matrix3d::Identity(), at};
  return out;
}

}  // namespace hamelin::test
