#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/scene/scene.hpp"
#include "reader.hpp"

namespace hamelin::scene {

/// As scene_from_json(), but its parts may name what only another scene has.
[[nodiscard]] Scene parts_from_json(const Json& document, const std::filesystem::path& base_dir,
                                    const std::string& where);

/// Parts of scenes that several others have.
[[nodiscard]] Motion read_motion(const Reader& in, const std::filesystem::path& folder);
[[nodiscard]] std::vector<Box> read_boxes(const Reader& in, const char* key);
[[nodiscard]] std::vector<Goal> read_goals(const Reader& in, const std::filesystem::path& folder);

}  // namespace hamelin::scene
