#pragma once
#include "hamelin/io/json.hpp"
#include "hamelin/model/model.hpp"

namespace hamelin::scene {

/// What `hamelin robot info --json` prints of a robot, without its file: joints with limits and
/// masses, numbers of shapes and of pairs that are checked for self-collision, notes and warnings.
[[nodiscard]] Json robot_info(const model::Model& model);

}  // namespace hamelin::scene
