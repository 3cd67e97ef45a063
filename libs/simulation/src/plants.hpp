#pragma once
#include <memory>

#include "hamelin/simulation/plant.hpp"
#include "simulated_arm.hpp"

namespace hamelin::simulation {

/// Hamelin's own plant, at the start of a scene. @throws Error as SimulatedArm
[[nodiscard]] std::unique_ptr<SimulatedArm> make_simulated_arm(const scene::Scene& scene,
                                                               const model::Model& model);

/// The plant of a scene, at its start.
/// @throws Error as SimulatedArm, and usage if the factory is missing that the plant needs
[[nodiscard]] std::unique_ptr<Plant> make_plant(const scene::Scene& scene,
                                                const model::Model& model,
                                                const PlantFactory& factory);

}  // namespace hamelin::simulation
