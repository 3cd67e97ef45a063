#pragma once
#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/description/urdf_geometry.hpp"
#include "hamelin/geometry/se3.hpp"
#include "xml.hpp"

/// A URDF as it stands in the file, before anything is made of it.
namespace hamelin::description::detail {

struct UrdfInertial {
  geometry::SE3 pose;  ///< of the COM frame, in the link's frame
  double mass_kg = 0.0;
  Eigen::Matrix3d inertia_kg_m2 = Eigen::Matrix3d::Zero();  ///< in the COM frame
};

struct UrdfLink {
  LinkGeometry shapes;  ///< with the link's name, line and parent
  std::optional<UrdfInertial> inertial;

  [[nodiscard]] const std::string& name() const noexcept { return shapes.name; }
};

struct UrdfLimits {
  bool has_position = false;  ///< whether the file gives lower or upper; each is 0 if it does not
  double lower = 0.0, upper = 0.0, effort = 0.0, velocity = 0.0;
};

struct UrdfJoint {
  enum class Type { revolute, continuous, prismatic, fixed, floating, planar };
  std::string name;
  int line = 0;
  Type type = Type::fixed;
  std::string parent, child;
  geometry::SE3 origin;                             ///< of the child's frame in the parent's at q = 0
  Eigen::Vector3d axis = Eigen::Vector3d::UnitX();  ///< in the child's frame, as given
  std::optional<UrdfLimits> limits;
  double damping = 0.0, friction = 0.0;
  std::optional<std::string> mimics;  ///< the joint that <mimic> names
};
[[nodiscard]] const char* to_string(UrdfJoint::Type type);

struct UrdfFile {
  std::string name;             ///< of the robot
  std::vector<UrdfLink> links;  ///< in the file's order
  std::vector<UrdfJoint> joints;
  std::string root;                    ///< the link that no joint carries
  std::map<std::string, int> skipped;  ///< elements that are not read, and how many of each
};

/// What of <visual> is read: nothing is counted as skipped if it is.
enum class Visuals { skip, read };

/// Reads and checks: names given once, each a number where one belongs, joints that make a tree.
/// @param where the file's name, for messages
/// @throws Error parse or invalid: "file: line N: link 'x': what is wrong, what was expected"
[[nodiscard]] UrdfFile read_urdf_file(const std::string& text, const std::string& where, Visuals visuals);

/// The shapes of a link's elements of one name, <collision> or <visual>. Sizes may still be zero or negative.
/// @throws Error parse
[[nodiscard]] std::vector<LinkShape> read_shapes(const tinyxml2::XMLElement& link, const char* tag, const Owner& owner);

/// @throws Error invalid unless all sizes of the shape are positive
void check_sizes(const LinkShape& shape, const Owner& owner);

/// The element that a shape is made of: "sphere", "box", "cylinder" or "mesh".
[[nodiscard]] const char* tag_of(LinkShape::Kind kind);

}  // namespace hamelin::description::detail
