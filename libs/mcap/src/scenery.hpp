#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "foxglove.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::mcap {

/// What is around the arm: the map, obstacles and goals. Each function that returns an update
/// returns none if nothing has changed since its last call.
class Scenery {
 public:
  /// @param scene must outlive this object, as the model
  /// @param has_map whether the map of the run is available and unchanged
  /// @throws Error io, parse or invalid
  Scenery(const scene::Scene& scene, const model::Model& model, bool has_map);

  /// Appends the poses in the world of base and map.
  void add_static_transforms(std::uint64_t time_ns, Json& transforms) const;
  /// Appends the poses in the world of obstacles that move.
  void add_transforms(std::uint64_t time_ns, double time_s, Json& transforms) const;
  /// Applies the map of the next event of the scene that has one.
  /// @throws Error io, parse or invalid
  void change_map();
  /// The obstacle that an event attaches under this name, if it is one, is not shown any more.
  void take_up(const std::string& load);
  /// The occupied space, in merged boxes.
  [[nodiscard]] std::optional<Json> map(std::uint64_t time_ns, double time_s);
  /// The obstacles that exist.
  [[nodiscard]] std::optional<Json> obstacles(std::uint64_t time_ns, double time_s);
  /// @param index of the goal that the arm moves to
  [[nodiscard]] std::optional<Json> goals(std::uint64_t time_ns, std::size_t index);

 private:
  [[nodiscard]] Entity obstacle_entity(std::uint64_t time_ns, std::size_t k) const;
  [[nodiscard]] std::optional<Entity> goal_entity(std::uint64_t time_ns, std::size_t k,
                                                  std::size_t index) const;

  const scene::Scene& scene_;
  const model::Model& model_;
  bool has_map_;
  scene::Environment environment_;
  std::vector<std::string> names_;  ///< of obstacles, each different
  bool map_changed_ = true;
  std::size_t next_event_ = 0;
  std::vector<bool> existing_;             ///< obstacles of the last update; empty: none yet
  std::optional<std::size_t> goal_index_;  ///< of the last update
};

}  // namespace hamelin::mcap
