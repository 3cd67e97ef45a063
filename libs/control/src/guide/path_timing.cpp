#include "guide/path_timing.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace hamelin::control {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Shares of the limits that a motion uses. The rest is for what keeps the arm on it.
constexpr double speed_share = 0.99, acceleration_share = 14.0 / 15.0, torque_share_most = 0.9,
                 torque_share_kept = 0.04, least_torque_share = 0.01;
constexpr double default_acceleration = 40.0;  // [rad/s² or m/s²]
// Changes of way-points that are tried, what each costs besides proofs in checks, and what these
// may cost; fewer where checks take longer than so [s]: the arm waits for them.
constexpr double tries_max = 250.0, improve_checks = 1000.0, usual_check_s = 2e-6;
constexpr long checks_per_try = 8;
constexpr double infinity = std::numeric_limits<double>::infinity();
// Intervals that keep less than what is enough are examined again [m].
constexpr double least_enough_m = 0.004;
// What a stop along a path may need of the margins, by what an arm at rest needs.
constexpr double tube_share = 2.5;
// Places at which torques are evaluated, that cost as much as a check.
constexpr long places_per_check = 8;

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

timing::Limits limits_of(const scene::Scene& scene, const model::Model& model,
                         const PathTiming::Bounds& bounds) {
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

double enough(const LimitReserve& reserve) {
  return std::max(tube_share * std::max(reserve.obstacles_m, reserve.self_m), least_enough_m);
}

}  // namespace

PathTiming::PathTiming(const scene::Scene& scene, const model::Model& model,
                       const scene::SelfField* self, const Bounds& bounds,
                       const search::Settings& settings)
    : limits_(limits_of(scene, model, bounds)),
      stop_acceleration_(bounds.changes.acceleration_max),
      levers_(model, self),
      blending_(levers_),
      way_points_(model, levers_, limits_, settings.q_lower, settings.q_upper),
      law_(model, limits_),
      certifier_(model, levers_, modelled_limits(scene, model.robot()), enough(bounds.reserve)),
      seed_(settings.seed) {
  const double share = usual_check_s / std::max(usual_check_s, scene.guide.check_time_s);
  effort_ = {static_cast<int>(tries_max * share), static_cast<long>(improve_checks * share)};
}

void PathTiming::begin(std::uint64_t number) {
  rng_ = Rng(seed_ + number);
  best_.reset();
}

void PathTiming::consider(const MatrixXd& points, const search::Margins& margins,
                          search::Query& query) {
  timing::BlendedPath path(points);
  blending_.widen(path, margins, query);
  const double duration = way_points_.duration_s(path);
  ++checks_;
  if (best_ && duration >= best_s_) return;
  best_s_ = duration;
  best_ = std::move(path);
  margins_ = margins;
}

std::unique_ptr<CertifiedPath> PathTiming::make(search::Query& query) {
  checks_ += checks_per_try * effort_.tries;
  (void)way_points_.improve(*best_, *margins_, query, rng_, effort_);
  auto out = std::make_unique<CertifiedPath>();
  out->motion.curve = best_->curve();
  if (!law_.solve(out->motion)) return nullptr;
  out->limits = limits_;
  checks_ += law_.evaluated() / places_per_check;
  certifier_.certify(*out, *margins_, query);
  out->stop_acceleration = stop_acceleration_;
  return out;
}

}  // namespace hamelin::control
