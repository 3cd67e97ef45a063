#pragma once
#include <fmt/format.h>
#include <Eigen/Geometry>

#include <string>

#include "hamelin/model/robot.hpp"

/// The chains of the reference data, defined without make_chain.
namespace hamelin::test {

inline model::Robot chain_along_y(int n, double length, const Eigen::Matrix3d& inertia,
                                  const std::string& axes) {
  model::Robot robot;
  robot.name = "chain";
  for (int i = 0; i < n; ++i) {
    model::Link link;
    link.name = fmt::format("link{}", i + 1);
    link.parent = i - 1;
    link.joint.name = fmt::format("j{}", i + 1);
    const char letter = axes[static_cast<std::size_t>(i) % axes.size()];
    const Eigen::Vector3d axis = letter == 'x'   ? Eigen::Vector3d::UnitX()
                                 : letter == 'y' ? Eigen::Vector3d::UnitY()
                                                 : Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d at{0.0, length * i, 0.0};
    link.joint.screw << axis, -axis.cross(at);
    link.com =
        geometry::SE3{Eigen::Matrix3d::Identity(), at + Eigen::Vector3d{0.0, 0.5 * length, 0.0}};
    link.mass_kg = 1.0;
    link.inertia_kg_m2 = inertia;
    robot.links.push_back(link);
  }
  robot.tip = {"tip", n - 1,
               geometry::SE3{Eigen::Matrix3d::Identity(), Eigen::Vector3d{0.0, length * n, 0.0}}};
  return robot;
}

/// Example 5.1 of Shen, Wang, Shi (2021): three planar links of 0.1 m, unit masses and inertias.
inline model::Robot planar3() {
  return chain_along_y(3, 0.1, Eigen::Matrix3d::Identity(), "x");
}

/// A spatial chain of solid cylinders of radius 0.03 m and length 0.2 m with axes x, z, x, …
inline model::Robot spatial_chain(int n) {
  const double length = 0.2, radius = 0.03;
  const double across = length * length / 12.0 + radius * radius / 4.0,
               along = radius * radius / 2.0;
  return chain_along_y(n, length, Eigen::Vector3d(across, along, across).asDiagonal(), "xzx");
}

}  // namespace hamelin::test
