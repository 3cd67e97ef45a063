#pragma once
#include <fmt/format.h>

#include <utility>

#include "hamelin/control/line_buffer.hpp"
#include "hamelin/scene/environment.hpp"

namespace hamelin::control {

/// Writes to the end of a line, without allocating.
template <class... Args>
void append(LineBuffer& line, fmt::format_string<Args...> format, Args&&... args) {
  const auto written =
      fmt::format_to_n(line.end(), line.room(), format, std::forward<Args>(args)...);
  line.extend(written.size);
}

/// As Environment::describe().
inline void append_obstacle(LineBuffer& line, const scene::Environment& environment, int obstacle) {
  if (obstacle == scene::Contact::map) return append(line, "the map");
  if (obstacle == scene::Contact::unknown) return append(line, "unknown space");
  append(line, "obstacle '{}'", environment.obstacles()[static_cast<std::size_t>(obstacle)].name);
}

}  // namespace hamelin::control
