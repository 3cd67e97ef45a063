#pragma once
#include "hamelin/scene/environment.hpp"
#include "hamelin/sensing/occupancy_grid.hpp"

namespace hamelin::sensing {

/// A grid that knows what the map of an environment knows, as surely as all measurements together
/// tell. Where unknown space is free, what is not occupied is unknown. Its box is that around
/// scene::Environment::map_ball().
/// @throws Error invalid as OccupancyGrid, also if there is no map
[[nodiscard]] OccupancyGrid grid_of(const scene::Environment& environment,
                                    const SensorModel& model);

}  // namespace hamelin::sensing
