#pragma once
#include <Eigen/Core>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/scene/motion.hpp"

namespace hamelin::scene {

/// An axis of the tip stays within an angle of a direction of the world.
struct AxisConstraint {
  Eigen::Vector3d axis = Eigen::Vector3d::UnitZ();       ///< in the tip's frame, of any length
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< in the world, of any length
  double angle_rad = 0.0;                                ///< above 0, at most 1.5
};

/// The tip's point stays within a box. One that is thin along an axis is a plane, along two a line.
struct BoxConstraint {
  geometry::SE3 pose;                                ///< of the box's frame in the world
  Quaternion quaternion_wxyz{1, 0, 0, 0};            ///< of the pose, as it was given
  Eigen::Vector3d low_m = Eigen::Vector3d::Zero();   ///< in its frame; may be −∞
  Eigen::Vector3d high_m = Eigen::Vector3d::Zero();  ///< above low_m; may be ∞
};

/// The tip's point is no faster.
struct SpeedConstraint {
  double m_s = 0.0;  ///< above 0
};

/// What the tip keeps on the whole way to a goal.
using TipConstraint = std::variant<AxisConstraint, BoxConstraint, SpeedConstraint>;

/// The largest speed that constraints allow [m/s]; infinite without one of speed.
[[nodiscard]] double speed_max_m_s(const std::vector<TipConstraint>& constraints) noexcept;

/// The unit in which a constraint of this type is exceeded: "rad", "m", "m/s".
[[nodiscard]] std::string_view unit_of(std::string_view type) noexcept;

/// "axis", "box", "speed"
[[nodiscard]] std::string_view type_name(const TipConstraint& constraint) noexcept;

/// @throws Error invalid, "where: what is wrong", for numbers that are not finite or out of their
///         range
void check(const TipConstraint& constraint, const std::string& where);

/// In the format of a goal's constraints.
[[nodiscard]] Json to_json(const TipConstraint& constraint);

}  // namespace hamelin::scene
