#pragma once
#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/scene/boxes.hpp"

namespace hamelin::scene {

/// What an arm may touch on the way to a goal: it is no obstacle then.
struct Allowance {
  std::vector<Box> boxes_m;  ///< in the map's frame: its voxels there, unknown ones included
  std::vector<std::string> obstacles;  ///< by name

  [[nodiscard]] bool operator==(const Allowance&) const = default;
  [[nodiscard]] bool empty() const noexcept { return boxes_m.empty() && obstacles.empty(); }
  [[nodiscard]] bool names(std::string_view obstacle) const {
    return std::find(obstacles.begin(), obstacles.end(), obstacle) != obstacles.end();
  }
};

/// @throws Error invalid, "where: what is wrong", for a box without volume or with numbers that are
///         not finite, and an obstacle without a name
void check(const Allowance& allowance, const std::string& where);

}  // namespace hamelin::scene
