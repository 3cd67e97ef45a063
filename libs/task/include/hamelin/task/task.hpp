#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/scene/allowance.hpp"
#include "hamelin/scene/obstacles.hpp"
#include "hamelin/scene/payload.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::task {

/// A solid of even density that is picked up and put down.
struct Object {
  scene::Obstacle solid;  ///< where it is at first, in the world
  double mass_kg = 0.0;
  bool in_map = false;                ///< whether the map of the scene has it, too
  scene::Allowance stands_on;         ///< at first: may be touched while it is lifted
  std::vector<geometry::SE3> grasps;  ///< poses of the tip in its frame
};

/// Take hold of an object, and lift it.
struct Pick {
  std::size_t object = 0;                                    ///< index of Task::objects
  Eigen::Vector3d approach_axis = Eigen::Vector3d::UnitZ();  ///< unit, in the tip's frame
  double approach_m = 0.1;                                   ///< straight to the grasp
  double lift_m = 0.05;                                      ///< straight up
};

/// Put down what is held.
struct Place {
  std::vector<geometry::SE3> poses;  ///< of the object in the world: it is left at one of them
  double gap_m = 0.003;              ///< above which it is let go
  double lower_m = 0.05;             ///< straight down
  double retreat_m = 0.1;            ///< straight back against the axis of the approach
  /// Of the object's z axis away from where it was at the pick; none: any.
  std::optional<double> tilt_rad;
  std::optional<double> speed_m_s;  ///< of the tip on the way; none: any
  scene::Allowance onto;            ///< may be touched while it is lowered
};

struct Move {
  scene::Goal goal;
};

using Step = std::variant<Pick, Place, Move>;

/// A task file (hamelin.task/1), read and checked. docs/schema/task.schema.json defines each field.
struct Task {
  scene::Scene scene;  ///< the objects are obstacles of it, after its own; no goals, no events
  std::vector<Object> objects;
  std::vector<Step> steps;
};

/// @param base_dir where relative paths start @param where prefix of each message, and the name of
///        the scene
/// @throws Error io, parse or invalid: "where: /json/pointer: what is wrong, what was expected"
[[nodiscard]] Task task_from_json(const Json& document, const std::filesystem::path& base_dir,
                                  const std::string& where);

/// An object as what a tip carries that is at its centre: mass, inertia, and balls and capsules
/// that cover it and stick out of it by about 5 mm.
[[nodiscard]] scene::Payload payload_of(const Object& object);
/// The same where the tip holds the object.
/// @param grasp pose of the tip in the object's frame, that of the payload
[[nodiscard]] scene::Payload held_at(const geometry::SE3& grasp, scene::Payload payload);

/// The steps as goals and events of a scene.
struct TaskPlan {
  scene::Scene scene;              ///< for a run
  std::vector<std::string> steps;  ///< one line each: what is taken for it
  std::string cause;               ///< one line: why a step cannot be done; empty: all can
  [[nodiscard]] bool found() const noexcept { return cause.empty(); }
};

/// Chooses grasps and places so that each step can be done from where the one before it ends: each
/// stretch of the way was found by a search and proved clear. A grasp from which the object cannot
/// be put down is not taken.
/// @param poll called now and then; it may throw to end this
/// @throws Error io, parse or invalid for a scene that cannot be planned in
[[nodiscard]] TaskPlan plan_task(const Task& task, const std::function<void()>& poll = {});

}  // namespace hamelin::task
