#include "detail.hpp"
#include "round_trip.hpp"
#include "targets.hpp"

namespace hamelin::fuzz {

void urdf(std::string_view bytes) {
  const std::string file = "arm.urdf";
  model::Robot robot;
  if (accepts(file, [&] { robot = description::detail::read_urdf(std::string(bytes), file, {}); }))
    require_round_trip(robot);
  else
    require(robot.links.empty(), "a refused robot leaves no data behind");
}

}  // namespace hamelin::fuzz
