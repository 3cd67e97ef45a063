#pragma once
#include "hamelin/simulation/plant.hpp"

namespace hamelin::app {

/// Makes the plants of this build that are not hamelin's own; empty if there are none.
[[nodiscard]] simulation::PlantFactory plant_factory();

}  // namespace hamelin::app
