#include "round_trip.hpp"

#include <cmath>

#include "hamelin/description/robot_io.hpp"
#include "hamelin/model/model.hpp"
#include "targets.hpp"

namespace hamelin::fuzz {

namespace {

// Without rotations, which come back to rounding only: not each has a quaternion of doubles that leads back to it.
Json without_rotations(Json robot) {
  robot["tip"].erase("quaternion_wxyz");
  for (Json& link : robot["links"]) link["com"].erase("quaternion_wxyz");
  return robot;
}

bool close(const geometry::SE3& a, const geometry::SE3& b) {
  return (a.R() - b.R()).cwiseAbs().maxCoeff() <= 1e-14;
}

}  // namespace

void promise_round_trip(const model::Robot& robot) {
  const std::string file = "again.json";
  const bool good = accepts(file, [&] {
    const Json written = description::robot_to_json(robot);
    const model::Robot again = description::robot_from_json(parse_json(written.dump(), file), file);
    const Json before = without_rotations(written), after = without_rotations(description::robot_to_json(again));
    if (before != after)
      promise(false, "a robot survives its JSON form, differs in " + Json::diff(before, after).dump());
    for (std::size_t i = 0; i < robot.links.size(); ++i)
      promise(close(robot.links[i].com, again.links[i].com), "a link's rotation survives its JSON form");
    promise(close(robot.tip.pose, again.tip.pose), "the tip's rotation survives its JSON form");
    const model::Model model(again);
    promise(model.dof() == robot.dof() && std::isfinite(model.reach()), "a robot makes a model of finite reach");
  });
  promise(good, "an accepted robot's JSON form is accepted");
}

}  // namespace hamelin::fuzz
