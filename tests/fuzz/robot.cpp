#include "hamelin/description/robot_io.hpp"
#include "hamelin/model/model.hpp"
#include "round_trip.hpp"
#include "targets.hpp"

namespace hamelin::fuzz {

void robot(std::string_view bytes) {
  const std::string file = "robot.json";
  model::Robot robot;
  if (accepts(file, [&] { robot = description::robot_from_json(parse_json(bytes, file), file); }))
    promise_round_trip(robot);
  else
    promise(robot.links.empty(), "a refused robot leaves nothing");
}

}  // namespace hamelin::fuzz
