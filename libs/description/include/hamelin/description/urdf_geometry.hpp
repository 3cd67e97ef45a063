#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/geometry/se3.hpp"

namespace hamelin::description {

/// One `<collision>` or `<visual>` of a URDF link: a shape and its pose in the link's frame.
struct LinkShape {
  enum class Kind { sphere, box, cylinder, mesh };
  Kind kind = Kind::sphere;
  geometry::SE3 pose;                                ///< of the shape, in the link's frame
  double radius_m = 0.0;                             ///< sphere, cylinder
  double length_m = 0.0;                             ///< cylinder: along its z, centred
  Eigen::Vector3d size_m = Eigen::Vector3d::Zero();  ///< box: full extents, centred
  std::string mesh;                                  ///< package://, file:// or a path
  Eigen::Vector3d scale = Eigen::Vector3d::Ones();   ///< mesh: factors of its coordinates
  int line = 0;                                      ///< of the shape in the URDF
};

/// A link and its shapes in the file.
struct LinkGeometry {
  std::string name;
  int line = 0;
  std::string parent;  ///< parent link, to which a joint connects this link; empty for the root
  std::vector<LinkShape> collision, visual;
};

/// The shapes of all links of a .urdf, in the file's order. Sizes are positive and finite.
/// @throws Error io, parse or invalid: "file: line N: link 'x': what is wrong, what was expected"
[[nodiscard]] std::vector<LinkGeometry> read_urdf_geometry(const std::filesystem::path& file);

}  // namespace hamelin::description
