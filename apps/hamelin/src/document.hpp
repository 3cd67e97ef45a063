#pragma once
#include <filesystem>
#include <string_view>

#include "hamelin/io/json.hpp"

namespace hamelin::app {

/// The kinds of files that hamelin reads or writes.
enum class Kind {
  map,
  urdf,
  robot,
  scene,
  task,
  result,
  explanation,
  path,
  trajectory,
  primitives,
  spheres,
  waypoints,
  log,
  sweep,
  records,
  summary,
  comparison,
  accuracy,
  problems,
  benchmark,
  archive
};

[[nodiscard]] std::string_view to_string(Kind kind) noexcept;

/// The kind of a file, recognised by its content.
/// @throws Error io, parse (neither map, XML nor JSON) or invalid (JSON of another schema)
[[nodiscard]] Kind kind_of(const std::filesystem::path& file);

}  // namespace hamelin::app
