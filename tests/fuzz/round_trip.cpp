#include "round_trip.hpp"

#include <cmath>

#include "hamelin/description/robot_io.hpp"
#include "hamelin/model/model.hpp"
#include "targets.hpp"

namespace hamelin::fuzz {

namespace {

// Removes rotations, which are compared within rounding: a rotation matrix of doubles need not have
// a quaternion of doubles that gives exactly the same matrix.
Json without_rotations(Json robot) {
  robot["tip"].erase("quaternion_wxyz");
  for (Json& link : robot["links"]) link["com"].erase("quaternion_wxyz");
  return robot;
}

bool nearly_equal(const geometry::SE3& a, const geometry::SE3& b) {
  return (a.R() - b.R()).cwiseAbs().maxCoeff() <= 1e-14;
}

}  // namespace

void require_round_trip(const model::Robot& robot) {
  const std::string file = "again.json";
  const bool good = accepts(file, [&] {
    const Json written = description::robot_to_json(robot);
    const model::Robot again = description::robot_from_json(parse_json(written.dump(), file), file);
    const Json before = without_rotations(written),
               after = without_rotations(description::robot_to_json(again));
    if (before != after)
      require(false, "a robot keeps its values in JSON, but differs in " +
                         Json::diff(before, after).dump());
    for (std::size_t i = 0; i < robot.links.size(); ++i)
      require(nearly_equal(robot.links[i].com, again.links[i].com),
              "a link keeps its rotation in JSON");
    require(nearly_equal(robot.tip.pose, again.tip.pose), "the tip keeps its rotation in JSON");
    const model::Model model(again);
    require(model.dof() == robot.dof() && std::isfinite(model.reach()),
            "a robot gives a model of finite reach");
  });
  require(good, "an accepted robot's JSON form is accepted");
}

}  // namespace hamelin::fuzz
