#pragma once
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/core/text.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/description/srdf.hpp"
#include "hamelin/model/robot.hpp"

/// Functions that the readers of robot files share.
namespace hamelin::description {

using geometry::SE3;
using model::Frame;
using model::Joint;
using model::JointType;
using model::Link;
using model::Robot;
using model::Segment;
using model::Sphere;
using model::Vector6d;

namespace detail {

/// Spheres and capsules by link, and pairs of links that never count as colliding.
struct SphereFile {
  std::string where;  ///< the file's name, for messages
  std::map<std::string, std::vector<Sphere>> links;
  std::map<std::string, std::vector<Segment>> capsules;
  std::vector<std::pair<std::string, std::string>> self_collision_disabled;
};

/// @param where the file's name, for messages
/// @throws Error invalid
[[nodiscard]] SphereFile read_spheres(const Json& document, const std::string& where);

/// The sidecar named or contained in the options, if any.
/// @throws Error io, parse or invalid
[[nodiscard]] std::optional<SphereFile> sidecar_of(const RobotOptions& options);

/// Adds an SRDF's pairs to the disabled pairs, each once.
/// @return a note with the file's name, the number of its pairs and the number of new ones
[[nodiscard]] std::string merge_pairs(std::vector<std::pair<std::string, std::string>>& disabled,
                                      const std::vector<DisabledPair>& more,
                                      const std::filesystem::path& file);

/// @param where the file's name, for messages
[[nodiscard]] Robot read_urdf(const std::string& text, const std::string& where,
                              const RobotOptions& options);

/// Changes each rotation by about 1e-16 to one that a quaternion of doubles represents exactly. A
/// robot can then be written as JSON and read back bit for bit. If no such rotation is found
/// nearby, the rotation is reproduced to rounding only.
void round_to_quaternions(Robot& robot);

/// "a, b, c"
[[nodiscard]] std::string join(const std::vector<std::string>& names);

/// Makes the screw's direction a unit vector.
/// @param where prefix of error messages
/// @return a note; empty if the direction already was a unit vector (to 1e-6)
/// @throws Error invalid if the direction is zero
[[nodiscard]] std::string normalise_screw(Joint& joint, const std::string& where);

/// Adds a warning to the robot, once, if an inertia has a model::triangle_fault.
/// @param strict whether to throw an Error instead
/// @param where prefix of error messages
/// @throws Error invalid if `strict`
void check_triangle_inequality(Robot& robot, const std::string& link,
                               const Eigen::Matrix3d& inertia, bool strict,
                               const std::string& where);

}  // namespace detail
}  // namespace hamelin::description
