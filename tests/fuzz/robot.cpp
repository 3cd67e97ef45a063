#include "hamelin/description/robot_io.hpp"
#include "hamelin/model/model.hpp"
#include "round_trip.hpp"
#include "targets.hpp"

namespace hamelin::fuzz {

void robot(std::string_view bytes) {
  const std::string file = "robot.json";
  model::Robot robot;
  if (accepts(file, [&] { robot = description::robot_from_json(parse_json(bytes, file), file); }))
    require_round_trip(robot);
  else
    require(robot.links.empty(), "a refused robot leaves no data behind");
}

}  // namespace hamelin::fuzz
