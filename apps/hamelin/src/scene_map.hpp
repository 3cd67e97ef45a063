#pragma once
#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>

#include "hamelin/io/json.hpp"

/// `hamelin scene info` of a map file, and `hamelin scene crop`.
namespace hamelin::app {

struct MapInfoOptions {
  std::optional<double> scale, threshold, reach;
  std::string base;  ///< "X,Y,Z"; empty: none given
};

/// Describes a map within the ball of radius `reach` around `base`, in the map's frame. If neither
/// is given, the ball contains all occupied leaves and is centred on them.
[[nodiscard]] Json map_info(const std::filesystem::path& file, const MapInfoOptions& options);

/// The description as text.
[[nodiscard]] std::string map_text(const Json& info);

/// A line "  label   text", with texts aligned under each other.
[[nodiscard]] std::string info_line(std::string_view label, const std::string& text);
[[nodiscard]] std::string percent(const Json& share);
[[nodiscard]] std::string bytes_text(std::size_t bytes);

void add_scene_crop(CLI::App& scene);

}  // namespace hamelin::app
