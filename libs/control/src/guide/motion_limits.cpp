#include "guide/motion_limits.hpp"

#include <algorithm>
#include <limits>

#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::control {

using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Shares of the limits that a motion uses. The rest is for what keeps the arm on it.
constexpr double speed_share = 0.99, acceleration_share = 14.0 / 15.0, torque_share_most = 0.9,
                 torque_share_kept = 0.04, least_torque_share = 0.01;
constexpr double default_acceleration = 40.0;  // [rad/s² or m/s²]
constexpr double infinity = std::numeric_limits<double>::infinity();
// Less is never enough [m].
constexpr double least_enough_m = 0.004;
// What a stop along a path may need of the margins, by what an arm at rest needs.
constexpr double tube_share = 2.5;

// docs/theory.md (19.14): where rates are bounded, larger accelerations take longer to be reached.
void lower_acceleration(const scene::Scene& scene, const model::Model& model,
                        timing::Limits& limits) {
  VectorXd jerk = VectorXd::Constant(model.dof(), infinity);
  if (limits.jerk.size() > 0) jerk = limits.jerk;
  if (limits.torque_rate.size() > 0) {
    dynamics::Workspace ws(model);
    MatrixXd M(model.dof(), model.dof());
    dynamics::mass_matrix(
        model, ws, scene.start_q.size() > 0 ? scene.start_q : VectorXd::Zero(model.dof()), M);
    jerk = jerk.cwiseMin(limits.torque_rate.cwiseQuotient(M.diagonal()));
  }
  limits.acceleration = limits.acceleration.cwiseMin((0.5 * jerk).array().pow(2.0 / 3).matrix());
}

}  // namespace

timing::Limits motion_limits(const scene::Scene& scene, const model::Model& model,
                             const MotionBounds& bounds) {
  const auto& [reserve, params, changes] = bounds;
  const ModelledLimits modelled = modelled_limits(scene, model.robot());
  timing::Limits out;
  out.velocity = modelled.velocity_max;
  if (reserve.velocity.size() == out.velocity.size()) out.velocity -= reserve.velocity;
  out.velocity *= speed_share;
  const auto found = params.find("path_acceleration");
  const double most =
      found != params.end() && found->is_number() ? found->get<double>() : default_acceleration;
  out.acceleration = VectorXd::Constant(model.dof(), most);
  if (changes.acceleration_max.size() > 0)
    out.acceleration = out.acceleration.cwiseMin(changes.acceleration_max);
  out.acceleration *= acceleration_share;
  out.jerk = CertifiedPath::rate_share * changes.jerk_max;
  if (changes.torque_rate > 0.0)
    out.torque_rate =
        VectorXd::Constant(model.dof(), CertifiedPath::rate_share * changes.torque_rate);
  // what is unknown of friction and masses is left to what keeps the arm on its way
  const scene::SafetyBounds unknown = scene::safety_bounds(scene);
  const double share = std::max(
      least_torque_share, std::min(torque_share_most, unknown.torque_share - torque_share_kept) -
                              unknown.friction_share);
  out.acceleration *= 1.0 - unknown.mass_error;
  out.torque = share * modelled.effort_max;
  if (out.have_rates()) lower_acceleration(scene, model, out);
  return out;
}

double enough_margin_m(const LimitReserve& reserve) {
  return std::max(tube_share * std::max(reserve.obstacles_m, reserve.self_m), least_enough_m);
}

}  // namespace hamelin::control
