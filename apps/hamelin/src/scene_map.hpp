#pragma once
#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>

#include "hamelin/io/json.hpp"

/// `hamelin scene info` of a bare map, and `hamelin scene crop`.
namespace hamelin::app {

struct MapInfoOptions {
  std::optional<double> scale, threshold, reach;
  std::string base;  ///< "X,Y,Z"; empty: none given
};

/// What a map holds within a ball: around `base` of radius `reach` in the map's own frame; if neither is given the one
/// that holds all that is occupied.
[[nodiscard]] Json map_info(const std::filesystem::path& file, const MapInfoOptions& options);

/// The same for a reader.
[[nodiscard]] std::string map_text(const Json& info);

/// Lines "  label   text" under each other.
[[nodiscard]] std::string info_line(std::string_view label, const std::string& text);
[[nodiscard]] std::string percent(const Json& share);
[[nodiscard]] std::string bytes_text(std::size_t bytes);

void add_scene_crop(CLI::App& scene);

}  // namespace hamelin::app
