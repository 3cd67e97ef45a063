#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/scene/map_region.hpp"
#include "hamelin/scene/scene.hpp"
#include "reader.hpp"

namespace hamelin::scene {

/// As scene_from_json(), but its parts may name what only another scene has.
[[nodiscard]] Scene parts_from_json(const Json& document, const std::filesystem::path& base_dir,
                                    const std::string& where);

/// The parts of a scene, one source each. Where a `scene` is given, its earlier parts are already
/// read.
[[nodiscard]] std::vector<Goal> read_goals(const Reader& in, const std::filesystem::path& folder);
[[nodiscard]] std::vector<Obstacle> read_obstacles(const Reader& in,
                                                   const std::filesystem::path& folder);
[[nodiscard]] MapSpec read_map_spec(const Reader& in, const std::filesystem::path& folder);
[[nodiscard]] std::vector<SensorSpec> read_sensors(const Reader& in, const Scene& scene);
[[nodiscard]] ModelFlags read_model(const Reader& in);
[[nodiscard]] Actuation read_actuation(const Reader& in, double step_s);
[[nodiscard]] PlantType read_plant(const Reader& in, const Reader& plant, ActuationType actuation);
[[nodiscard]] Safety read_safety(const Reader& in);
[[nodiscard]] std::vector<Event> read_events(const Reader& in, const std::filesystem::path& folder,
                                             const Scene& scene);
[[nodiscard]] std::vector<WrenchSpec> read_wrenches(const Reader& in);

/// What several parts have.
[[nodiscard]] Motion read_motion(const Reader& in, const std::filesystem::path& folder);
[[nodiscard]] std::vector<Box> read_boxes(const Reader& in, const char* key);
[[nodiscard]] MapChangeSpec read_map_change(const Reader& in, const std::filesystem::path& folder);
[[nodiscard]] Payload read_payload(const Reader& in);

}  // namespace hamelin::scene
