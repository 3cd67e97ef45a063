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

/// What runs of one robot, map, obstacles and goals share.
struct World {
  std::string key;  ///< equal for equal worlds
  model::Model model;
  std::vector<scene::Goal> goals;
  scene::Environment environment;
  bool judged = false;       ///< whether clearances can be told: something to hit, and all of it at hand
  double influence_m = 0.0;  ///< so far clearances are told
  Json json;
  std::vector<std::string> notes;
};

/// One point a joint on its axis, then the tip, base frame at q = 0: of all such chains from the base the one with the
/// smallest sum of squared lengths. A prismatic joint's point is free.
[[nodiscard]] std::vector<Eigen::Vector3d> skeleton(const model::Robot& robot);

/// Equal for runs of the same robot, map (by content), obstacles and goals.
[[nodiscard]] std::string world_key(const simulation::Recorded& recorded);

/// @param map_at_hand whether the scene's map is the very one that was run
/// @throws Error for a robot that cannot be read
[[nodiscard]] std::unique_ptr<World> make_world(const simulation::Recorded& recorded, std::string key, bool map_at_hand,
                                                Container& container);

}  // namespace hamelin::report
