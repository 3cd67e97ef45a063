#include "arm_field.hpp"

#include <Eigen/Geometry>
#include <algorithm>

namespace hamelin::gyro {

using Eigen::Vector3d;
using reactive::NearPoint;

namespace {

// The short repulsion: its gain [m⁴/s²] and the distance below which it is constant [m], as planner
// apf has them by default, and the distance between parts of the arm below which it acts [m]. These
// always lie near each other, so they are not turned.
constexpr double eta = 1e-6, least_m = 0.002, self_range_m = 0.03;
// Below this speed [m/s] a point has no direction to turn.
constexpr double least_speed = 1e-4;

}  // namespace

ArmField::ArmField(const planning::Setup& setup, const Json& params)
    : drive_(setup, {params.at("cruise_speed"), params.at("rho0_m")}),
      rest_(setup),
      turning_(setup.model(), params),
      hold_{eta, params.at("hold_m"), std::min(least_m, params.at("hold_m").get<double>())},
      self_{eta, self_range_m, least_m} {}

void ArmField::tick(const planning::Tick& tick, planning::Command& command) {
  drive_.update(tick);
  int turned = -1;
  for (const auto& point : drive_.points()) {
    const bool self = point.obstacle == NearPoint::self;
    const reactive::Repulsion& repulsion = self ? self_ : hold_;
    if (point.distance < repulsion.rho0)
      drive_.push(point, drive_.goal_factor() * repulsion.force(point.distance));
    drive_.brake(point);
    // Of neighbouring points of one link only the nearest is turned.
    if (!self && point.distance < turning_.range_m() && point.link != turned &&
        turn(point, command))
      turned = point.link;
  }
  drive_.apply(command);
  rest_.check(tick, drive_.at_goal(), command);
}

// docs/theory.md (9.10), (9.15)
bool ArmField::turn(const NearPoint& point, planning::Command& command) {
  const Vector3d velocity = drive_.velocity(point);
  const double speed = velocity.norm();
  if (speed < least_speed || velocity.dot(point.direction) >= 0.0) return false;
  const Vector3d e =
      drive_.goal_factor() * turning_.rate(point.distance, -point.direction, velocity / speed);
  const Eigen::Matrix3d M_x = drive_.inertia(point);
  if (turning_.variant() == Variant::published)
    drive_.pull(point, M_x * e.cross(velocity));
  else
    drive_.turn(point, Turning::neutral(M_x, e), command);
  return true;
}

}  // namespace hamelin::gyro
