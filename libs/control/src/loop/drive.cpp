#include "loop/drive.hpp"

#include "loop/ideal_drive.hpp"
#include "loop/position_drive.hpp"
#include "loop/torque_drive.hpp"

namespace hamelin::control {

using Eigen::VectorXd;

ChangeBounds DriveOptions::changes(const scene::Scene& scene) const {
  if (kind == DriveKind::ideal) return {};
  const double torque_rate = scene.actuation.torque_rate_max_Nm_s.value_or(0.0);
  if (kind == DriveKind::torque) return {torque_rate, {}, {}};
  return {torque_rate, acceleration_max, jerk_max};
}

std::unique_ptr<Drive> make_drive(const scene::Scene& scene, const model::Model& model,
                                  const DriveOptions& options, const LimitReserve& reserve) {
  switch (options.kind) {
    case DriveKind::torque:
      return std::make_unique<TorqueDrive>(scene, model, options);
    case DriveKind::position:
      return std::make_unique<PositionDrive>(scene, model, options, reserve);
    case DriveKind::ideal:
      break;
  }
  return std::make_unique<IdealDrive>(scene, *options.arm, options);
}

bool can_be_sent(const VectorXd& x) {
  constexpr double largest = 1e12;
  return (x.array().abs() <= largest).all();
}

}  // namespace hamelin::control
