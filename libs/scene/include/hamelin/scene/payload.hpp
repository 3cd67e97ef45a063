#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "hamelin/model/model.hpp"
#include "hamelin/model/robot.hpp"
#include "hamelin/scene/map_change.hpp"

namespace hamelin::scene {

/// A body fixed to the tip. All coordinates are in the tip's frame.
struct Payload {
  double mass_kg = 0.0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< centre of mass
  /// About the centre of mass, in the axes of the tip's frame.
  Eigen::Matrix3d inertia_kg_m2 = Eigen::Matrix3d::Zero();
  std::string name = "payload";          ///< of the part of the arm that its shapes form
  std::vector<model::Sphere> spheres;    ///< `part` is not used
  std::vector<model::Segment> capsules;  ///< `part` is not used
  /// Whether the controller knows its shapes; a run's judge knows them in any case.
  bool shapes_known = true;
};

/// Checks a payload: finite numbers, mass and radii in range, a possible inertia, a name.
/// @param where prefix of the message
/// @throws Error invalid
void check(const Payload& payload, const std::string& where);

/// Upper bound of the distance from the tip to any point of a payload's shapes [m].
[[nodiscard]] double reach_beyond_tip(const Payload& payload);

/// A robot with bodies fixed to its tip: their masses and inertias join those of the link that
/// carries the tip, by the parallel-axis theorem. The shapes of each form a part of that link.
/// @throws Error invalid for a name that a link or part of the robot has already
[[nodiscard]] model::Robot with_payloads(model::Robot robot, std::span<const Payload> payloads);

/// A model of the arm that carries payloads. Parts of the arm that a payload touches when it is
/// attached may go on to touch it.
/// @param bare the arm without them @param touching_m how near counts as touching [m]
/// @param self_collision whether it is modelled
/// @param q configuration in which the last of them is attached; dof numbers
/// @throws Error invalid for a name that a link or part of the robot has already
[[nodiscard]] model::Model carrying(const model::Model& bare, std::span<const Payload> payloads,
                                    bool self_collision, double touching_m,
                                    const Eigen::VectorXd& q);

/// What happens during a run, once, at a time or when goals were reached.
struct Event {
  std::optional<double> time_s;              ///< not before this time; or
  std::optional<std::size_t> goals_reached;  ///< not before so many goals are reached
  std::optional<Payload> attach;             ///< fixed to the tip from then on
  /// Name of the obstacle that `attach` is: not in the world until it is detached, and from then on
  /// where the tip leaves it; empty: it is none.
  std::string obstacle;
  std::optional<std::string> detach;  ///< name of what is not fixed to it any more
  std::optional<MapChangeSpec> map;   ///< its time is not used
  /// Whether a run ends if the controller refuses what is attached; else it goes on without it.
  bool required = true;
};

/// What events add to an arm at most.
struct PayloadBounds {
  double reach_m = 0.0;    ///< beyond the tip
  std::size_t shapes = 0;  ///< at a time
};
/// @param arm without what the events attach @param where prefix of messages
/// @throws Error invalid for a payload that does not fit the arm
[[nodiscard]] PayloadBounds payload_bounds(std::span<const Event> events, const model::Model& arm,
                                           const std::string& where);

}  // namespace hamelin::scene
