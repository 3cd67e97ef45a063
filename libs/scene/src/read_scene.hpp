#pragma once
#include <filesystem>
#include <string>

#include "hamelin/scene/scene.hpp"

namespace hamelin::scene {

/// As scene_from_json(), but its parts may name what only another scene has.
[[nodiscard]] Scene parts_from_json(const Json& document, const std::filesystem::path& base_dir,
                                    const std::string& where);

}  // namespace hamelin::scene
