#pragma once
#include <string>
#include <string_view>

#include "hamelin/scene/map_file.hpp"

/// The lines with which a file of a map begins.
namespace hamelin::scene {

inline constexpr double resolution_min = 1e-5, resolution_max = 1e4;

struct StatedHeader {
  MapHeader header;
  int size_line = 0;  ///< number of the line that has the node count
};

/// @param where the file's name, for messages
/// @throws Error parse
[[nodiscard]] StatedHeader read_map_header(std::string_view bytes, const std::string& where);

/// @throws Error parse: "where: place: message"
[[noreturn]] void refuse_map(const std::string& where, const std::string& place,
                             const std::string& message);

}  // namespace hamelin::scene
