#pragma once
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/scene/scene.hpp"

/// What a scene models of its robot.
namespace hamelin::scene {

/// Kinds of limits that are in force: the scene models them, and the robot states them for at least
/// one joint.
struct LimitsInForce {
  bool position = false, velocity = false, torque = false;
};

[[nodiscard]] LimitsInForce limits_in_force(const ModelFlags& flags, const model::Robot& robot);

/// Gravity, limits, self-collision, payload, damping and dry friction that a scene models, as
/// `hamelin scene info --json` prints them under "model". For each kind of limit: whether it is on,
/// and how many joints of the robot file have one.
/// @param arm model of the scene's robot, with gravity and payload
[[nodiscard]] Json modelled_info(const Scene& scene, const model::Model& arm);

/// The same in two lines of text: gravity, limits and self-collision; then payload, damping and dry
/// friction.
[[nodiscard]] std::vector<std::string> describe_modelled(const Json& info);

/// Why the arm cannot start as the scene says: a joint is beyond a position or velocity limit in
/// force, or needs more than its effort limit to hold the arm against gravity. Empty if it can.
/// Names the place in the scene and the key that switches the limit off.
/// @throws Error invalid if start/q or start/v does not fit the arm
[[nodiscard]] std::string start_defect(const Scene& scene, const model::Model& arm);

}  // namespace hamelin::scene
