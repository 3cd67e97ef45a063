#include "arm_field.hpp"

namespace hamelin::apf {

ArmField::ArmField(const planning::Setup& setup, const Json& params)
    : drive_(setup, {params.at("cruise_speed"), params.at("rho0_m")}),
      rest_(setup),
      repulsion_{params.at("eta"), params.at("rho0_m"), params.at("distance_min_m")} {}

void ArmField::tick(const planning::Tick& tick, planning::Command& command) {
  drive_.update(tick);
  for (const auto& point : drive_.points()) {
    if (point.distance < repulsion_.rho0)
      drive_.push(point, drive_.goal_factor() * repulsion_.force(point.distance));
    drive_.brake(point);
  }
  drive_.apply(command);
  rest_.check(tick, drive_.at_goal(), command);
}

}  // namespace hamelin::apf
