#pragma once
#include <cstdint>
#include <span>

#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/self_collision.hpp"

/// What planners are shown, as structs of the plugin interface.
namespace hamelin::control {

/// @param obstacle_id of the contact's obstacle, see WorldView::obstacle_id
[[nodiscard]] hamelin_contact to_c(const scene::Contact& contact, std::int32_t obstacle_id);
[[nodiscard]] hamelin_self_contact to_c(const scene::SelfContact& contact);

/// Writes the obstacles of an environment that exist now, and where they are at a moment.
/// @param ids of its obstacles; empty: their indices
/// @return how many there are, even if out is smaller
std::size_t list_obstacles(const scene::Environment& environment, std::span<const std::int32_t> ids,
                           const scene::Moment& moment, scene::Among among,
                           const planning::ArrayOut<hamelin_obstacle_state>& out);

}  // namespace hamelin::control
