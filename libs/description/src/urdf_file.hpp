#pragma once
#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/description/urdf_geometry.hpp"
#include "hamelin/geometry/se3.hpp"
#include "xml.hpp"

/// The content of a URDF file as it is, before a robot is made of it.
namespace hamelin::description::detail {

struct UrdfInertial {
  geometry::SE3 pose;  ///< of the COM frame, in the link's frame
  double mass_kg = 0.0;
  Eigen::Matrix3d inertia_kg_m2 = Eigen::Matrix3d::Zero();  ///< in the COM frame
};

struct UrdfLink {
  LinkGeometry shapes;  ///< also holds the link's name, line and parent
  std::optional<UrdfInertial> inertial;

  [[nodiscard]] const std::string& name() const noexcept { return shapes.name; }
};

struct UrdfLimits {
  bool has_position = false;  ///< whether the file gives lower or upper; a missing one is 0
  double lower = 0.0, upper = 0.0, effort = 0.0, velocity = 0.0;
};

struct UrdfJoint {
  enum class Type { revolute, continuous, prismatic, fixed, floating, planar };
  std::string name;
  int line = 0;
  Type type = Type::fixed;
  std::string parent, child;
  geometry::SE3 origin;                             ///< child's frame in the parent's at q = 0
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
  std::string root;                    ///< the link that is the child of no joint
  std::map<std::string, int> skipped;  ///< count of each kind of element that is not read
};

/// Whether <visual> is read.
enum class Visuals { skip, read };

/// Reads and checks a URDF: names are unique, values are numbers where numbers are expected, and
/// the joints form a tree.
/// @param where the file's name, for messages
/// @throws Error parse or invalid: "file: line N: link 'x': what is wrong, what was expected"
[[nodiscard]] UrdfFile read_urdf_file(const std::string& text, const std::string& where,
                                      Visuals visuals);

/// The shapes of a link's elements of one name, <collision> or <visual>. Sizes may still be zero or
/// negative.
/// @throws Error parse
[[nodiscard]] std::vector<LinkShape> read_shapes(const tinyxml2::XMLElement& link, const char* tag,
                                                 const Owner& owner);

/// @throws Error invalid unless all sizes of the shape are positive
void check_sizes(const LinkShape& shape, const Owner& owner);

/// The name of a shape's element: "sphere", "box", "cylinder" or "mesh".
[[nodiscard]] const char* tag_of(LinkShape::Kind kind);

}  // namespace hamelin::description::detail
