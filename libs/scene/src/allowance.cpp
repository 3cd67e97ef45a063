#include "hamelin/scene/allowance.hpp"

#include <fmt/format.h>

#include "hamelin/core/error.hpp"

namespace hamelin::scene {

void check(const Allowance& allowance, const std::string& where) {
  const auto refuse = [&](const std::string& what) {
    throw Error(ErrorCode::invalid, where + what);
  };
  for (std::size_t i = 0; i < allowance.boxes_m.size(); ++i) {
    const Box& box = allowance.boxes_m[i];
    if (!box.lo.allFinite() || !box.hi.allFinite())
      refuse(fmt::format("/boxes_m/{}: is not finite, expected finite numbers", i));
    if (!(box.lo.array() < box.hi.array()).all())
      refuse(fmt::format(
          "/boxes_m/{}: the low corner is not below the high one on each axis, expected [x, y, z, "
          "x, y, z]",
          i));
  }
  for (std::size_t i = 0; i < allowance.obstacles.size(); ++i)
    if (allowance.obstacles[i].empty())
      refuse(fmt::format("/obstacles/{}: is empty, expected the name of an obstacle", i));
}

}  // namespace hamelin::scene
