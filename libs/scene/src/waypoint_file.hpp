#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/scene/motion.hpp"

namespace hamelin::scene {

struct WaypointFile {
  std::vector<Waypoint> waypoints;
  std::string where;  ///< the file and, for JSON, the place of the list: see WaypointPath
};
[[nodiscard]] WaypointFile read_waypoint_file(const std::filesystem::path& path);

/// @param list a JSON list
/// @param where of the list, "file: /json/pointer"
/// @throws Error invalid, "where/index: …"
[[nodiscard]] std::vector<Waypoint> waypoints_from_json(const Json& list, const std::string& where);

}  // namespace hamelin::scene
