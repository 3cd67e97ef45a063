#pragma once
#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "container.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/simulation/replay.hpp"

namespace hamelin::report {

/// Robot, map, obstacles and goals, shared by the runs that have the same ones.
struct World {
  std::string key;  ///< equal for equal worlds
  model::Model model;
  std::vector<scene::Goal> goals;
  scene::Environment environment;
  bool has_clearances = false;  ///< whether there is something to hit and everything is available
  double influence_m = 0.0;     ///< largest clearance that is computed
  Json json;
  std::vector<std::string> notes;
};

/// One point per joint on the joint's axis, then the tip, in the base frame at q = 0: of all such
/// chains from the base the one with the smallest sum of squared lengths. The point of a prismatic
/// joint is free.
[[nodiscard]] std::vector<Eigen::Vector3d> skeleton(const model::Robot& robot);

/// A key that is equal for runs of the same robot, map (by content), obstacles and goals.
[[nodiscard]] std::string world_key(const simulation::Recorded& recorded);

/// @param has_map whether the map of the run is available and unchanged
/// @throws Error for a robot that cannot be read
[[nodiscard]] std::unique_ptr<World> make_world(const simulation::Recorded& recorded,
                                                std::string key, bool has_map,
                                                Container& container);

}  // namespace hamelin::report
