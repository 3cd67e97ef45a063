#include "plants.hpp"

#ifdef HAMELIN_WITH_MUJOCO
#include "hamelin/mujoco/plant.hpp"
#endif

namespace hamelin::app {

simulation::PlantFactory plant_factory() {
#ifdef HAMELIN_WITH_MUJOCO
  return mujoco::make_plant;
#else
  return {};
#endif
}

}  // namespace hamelin::app
