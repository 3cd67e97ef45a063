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

/// What the readers share.
namespace hamelin::description {

using geometry::SE3;
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

/// The sidecar that the options give, if any.
/// @throws Error io, parse or invalid
[[nodiscard]] std::optional<SphereFile> sidecar_of(const RobotOptions& options);

/// Adds an SRDF's pairs to those that are there, each once.
/// @return what to note: how many, of which file, how many were there before
[[nodiscard]] std::string join_pairs(std::vector<std::pair<std::string, std::string>>& disabled,
                                     const std::vector<DisabledPair>& more, const std::filesystem::path& file);

/// @param where the file's name, for messages
[[nodiscard]] Robot read_urdf(const std::string& text, const std::string& where, const RobotOptions& options);

/// Brings each rotation to one that a quaternion of doubles gives exactly (a change of some 1e-16), so that a robot
/// survives its JSON form bit for bit; where none is found nearby, to rounding.
void round_to_quaternions(Robot& robot);

/// "a, b, c"
[[nodiscard]] std::string join(const std::vector<std::string>& names);

/// Makes the screw's direction a unit vector.
/// @return what to note, empty if it was one (to 1e-6)
/// @throws Error invalid if it is zero; `where` opens the message
[[nodiscard]] std::string normalise_screw(Joint& joint, const std::string& where);

/// Notes a warning, once, for an inertia with a model::triangle_fault.
/// @param strict refuse it instead
/// @throws Error invalid, which `where` opens
void judge_inertia(Robot& robot, const std::string& link, const Eigen::Matrix3d& inertia, bool strict,
                   const std::string& where);

}  // namespace detail
}  // namespace hamelin::description
