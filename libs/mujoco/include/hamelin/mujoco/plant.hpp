#pragma once
#include <memory>

#include "hamelin/simulation/plant.hpp"

namespace hamelin::mujoco {

/// The largest number of joints of an arm: MuJoCo's reader nests no deeper.
inline constexpr int joints_max = 90;

/// A plant that MuJoCo simulates: the arm of the setup, with its resistance and, where the scene
/// models them, its joint limits and contact with itself; the scene's obstacles, moving ones
/// included, and the occupied space of its map. The README says what is modelled how.
/// @throws Error invalid for an arm with more than joints_max joints; as scene::make_environment
[[nodiscard]] std::unique_ptr<simulation::Plant> make_plant(const simulation::PlantSetup& setup);

}  // namespace hamelin::mujoco
