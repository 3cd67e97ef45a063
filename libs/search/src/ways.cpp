#include "hamelin/search/ways.hpp"

namespace hamelin::search {

namespace {

// What is followed beyond a stretch, so that the arm is on it before it counts.
constexpr double beyond_m = 1e-3, beyond_tolerances = 2.0;

TipCurve outwards(const scene::Stretch& stretch, const geometry::SE3& end, double sign) {
  Eigen::Vector3d direction = sign * stretch.direction.normalized();
  if (!stretch.in_world) direction = end.R() * direction;
  const double length = stretch.distance_m + beyond_m + beyond_tolerances * stretch.tolerance.m;
  return TipCurve::line(end, {end.R(), end.p() + length * direction});
}

}  // namespace

TipCurve way_curve(const scene::Goal& goal, const geometry::SE3& start) {
  const geometry::SE3 nearest = scene::nearest_pose(goal, start);
  const geometry::SE3 end{goal.type == scene::GoalType::pose ? nearest.R() : start.R(),
                          nearest.p()};
  return goal.way->through_m ? TipCurve::arc(start, *goal.way->through_m, end)
                             : TipCurve::line(start, end);
}

TipCurve approach_curve(const scene::Stretch& approach, const geometry::SE3& goal) {
  return outwards(approach, goal, -1.0);
}

TipCurve retreat_curve(const scene::Stretch& retreat, const geometry::SE3& start) {
  return outwards(retreat, start, 1.0);
}

TipConstraints::Ball ball_of(const scene::Stretch& stretch, const geometry::SE3& end) {
  return {end.p(), stretch.distance_m};
}

}  // namespace hamelin::search
