#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/scene/scene.hpp"

/// Parts of a scene in the format of a scene file, for programs that change them while an arm
/// moves. Each part is checked against the schema, and messages name its place in a scene:
/// "where: /goals/0/q: what is wrong, what was expected". Relative paths start from base_dir.
namespace hamelin::scene {

/// A list of goals, or a single one. @throws Error io, parse or invalid
[[nodiscard]] std::vector<Goal> goals_from_json(const Json& document,
                                                const std::filesystem::path& base_dir,
                                                const std::string& where);

/// A map; null is none. @throws Error invalid
[[nodiscard]] std::optional<MapSpec> map_from_json(const Json& document,
                                                   const std::filesystem::path& base_dir,
                                                   const std::string& where);

/// A change of the map. Its time is 0 unless it is given. @throws Error invalid
[[nodiscard]] MapChangeSpec map_change_from_json(const Json& document,
                                                 const std::filesystem::path& base_dir,
                                                 const std::string& where);

/// An obstacle that is attached to none. @throws Error io, parse or invalid
[[nodiscard]] Obstacle obstacle_from_json(const Json& document,
                                          const std::filesystem::path& base_dir,
                                          const std::string& where);

/// A body for the tip, as /model/payload. @throws Error invalid
[[nodiscard]] Payload payload_from_json(const Json& document, const std::string& where);

}  // namespace hamelin::scene
