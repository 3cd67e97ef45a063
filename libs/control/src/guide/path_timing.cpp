#include "guide/path_timing.hpp"

#include <algorithm>
#include <array>
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
// Of bounds of rates, the shares that a motion uses, the change of a stop's braking, and both with
// the braking; and the largest such change, where the bounds do not say it [1/s²].
constexpr double rate_share = 0.5, ramp_share = 0.2, whole_rate = 0.9, braking_ramp_most = 2000.0;
constexpr double infinity = std::numeric_limits<double>::infinity();
// Intervals that keep less than what is enough are examined again [m].
constexpr double least_enough_m = 0.004;
// What a stop along a path may need of the margins, by what an arm at rest needs.
constexpr double tube_share = 2.5;
// Factors of such a margin that are tried.
constexpr std::array<double, 3> higher{4.0, 2.5, 1.6};
// Places at which torques are evaluated, that cost as much as a check.
constexpr long places_per_check = 8;
// The mass matrix is evaluated at so many places, and may be larger between them.
constexpr int mass_places = 5;
constexpr double mass_between = 1.1;

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
  out.jerk = rate_share * changes.jerk_max;
  if (changes.torque_rate > 0.0)
    out.torque_rate = VectorXd::Constant(model.dof(), rate_share * changes.torque_rate);
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

}  // namespace

PathTiming::PathTiming(const scene::Scene& scene, const model::Model& model,
                       const scene::SelfField* self, const Bounds& bounds,
                       const search::Settings& settings)
    : model_(model),
      limits_(limits_of(scene, model, bounds)),
      stop_acceleration_(bounds.changes.acceleration_max),
      enough_m_(std::max(tube_share * std::max(bounds.reserve.obstacles_m, bounds.reserve.self_m),
                         least_enough_m)),
      levers_(model, self),
      blending_(levers_),
      way_points_(model, levers_, limits_, settings.q_lower, settings.q_upper),
      law_(model, limits_),
      seed_(settings.seed),
      ws_(model) {
  const ModelledLimits modelled = modelled_limits(scene, model.robot());
  const double share = usual_check_s / std::max(usual_check_s, scene.guide.check_time_s);
  effort_ = {static_cast<int>(tries_max * share), static_cast<long>(improve_checks * share)};
  from_ = to_ = stray_ = VectorXd::Zero(model.dof());
  q_lower_ = modelled.q_lower;
  q_upper_ = modelled.q_upper;
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
  set_margins(*out, *margins_);
  raise_margins(*out, query);
  set_room(*out);
  set_mass(*out);
  set_braking(*out);
  out->stop_acceleration = stop_acceleration_;
  return out;
}

// docs/theory.md (14.30)
void PathTiming::set_margins(CertifiedPath& out, const search::Margins& margins) {
  const Index n = out.motion.nodes() - 1;
  out.clearance_m.resize(n);
  out.self_m.resize(n);
  for (Index k = 0; k < n; ++k) {
    out.motion.chord(k, from_, to_, stray_);
    const double loss = stray_.isZero(0.0) ? 0.0 : timing::Blending::loss_m;
    out.clearance_m[k] = margins.least(from_, to_) - loss;
    out.self_m[k] = std::min(margins.least(from_, to_), margins.self_most_m()) - loss;
  }
}

void PathTiming::raise_margins(CertifiedPath& out, search::Query& query) {
  for (Index k = 0; k + 1 < out.motion.nodes(); ++k) {
    double &clearance = out.clearance_m[k], &self = out.self_m[k];
    if (std::min(clearance, self) >= enough_m_) continue;
    out.motion.chord(k, from_, to_, stray_);
    const double stray = levers_.reach(stray_);
    const auto keeps = [&](double of_obstacles, double of_self) {
      search::Margins margins(of_obstacles + stray);
      margins.set_self_most(of_self + stray);
      query.set_margins(margins);
      return query.motion_clear(from_, to_);
    };
    const auto raised = [&](double m, double factor) { return std::min(enough_m_, factor * m); };
    for (const double factor : higher) {
      const double more = std::max(clearance, raised(clearance, factor)),
                   more_of_self = std::max(self, std::min(more, raised(self, factor)));
      if (!keeps(more, more_of_self)) continue;
      clearance = more;
      self = more_of_self;
      break;
    }
    for (const double factor : higher) {
      const double more = raised(clearance, factor);
      if (!(more > clearance) || !keeps(more, self)) continue;
      clearance = more;
      break;
    }
  }
}

void PathTiming::set_room(CertifiedPath& out) {
  if (q_lower_.size() == 0) return;
  const Index n = out.motion.nodes() - 1;
  out.room.resize(model_.dof(), n);
  for (Index k = 0; k < n; ++k) {
    out.motion.chord(k, from_, to_, stray_);
    out.room.col(k) =
        (from_.cwiseMin(to_) - q_lower_).cwiseMin(q_upper_ - from_.cwiseMax(to_)) - stray_;
  }
}

// docs/theory.md (14.37)
void PathTiming::set_braking(CertifiedPath& out) const {
  if (!limits_.have_rates()) return;
  const timing::TimedPath& motion = out.motion;
  const Index n = motion.nodes();
  double ramp = braking_ramp_most;
  for (Index k = 0; k < n; ++k)
    for (Index j = 0; j < model_.dof(); ++j) {
      const auto bound = [&](const VectorXd& rate, double size) {
        if (rate.size() > 0 && size * ramp > ramp_share * rate[j] / rate_share)
          ramp = ramp_share * rate[j] / rate_share / size;
      };
      bound(limits_.jerk, std::abs(motion.tangent(j, k)) * motion.speed[k]);
      bound(limits_.torque_rate, std::abs(motion.inertia(j, k)) * motion.speed[k]);
    }
  out.braking_ramp = ramp;
  out.braking_max = VectorXd::Constant(n, infinity);
  for (Index k = 0; k < n; ++k) bound_braking(out, k);
}

void PathTiming::bound_braking(CertifiedPath& out, Index k) const {
  const timing::TimedPath& motion = out.motion;
  // what a row is without braking, and with it per β, at a node
  const auto row = [&](const MatrixXd& by_rate, const MatrixXd& by_square, Index j, Index i) {
    const double s = motion.speed[i];
    return std::pair(by_rate(j, i) * motion.rate_at(i) + by_square(j, i) * s * s,
                     by_rate(j, i) * s);
  };
  double& most = out.braking_max[k];
  const auto bound = [&](const MatrixXd& by_rate, const MatrixXd& by_square, double limit,
                         Index j) {
    const auto [value, slope] = row(by_rate, by_square, j, k);
    double change = 0.0, change_of_slope = 0.0;
    for (const Index i : {k - 1, k + 1}) {
      if (i < 0 || i >= motion.nodes()) continue;
      const auto [other, other_slope] = row(by_rate, by_square, j, i);
      const double h = std::abs(motion.time_s[i] - motion.time_s[k]);
      change = std::max(change, std::abs(other - value) / h);
      change_of_slope = std::max(change_of_slope, std::abs(other_slope - slope) / h);
    }
    const double left =
        whole_rate * limit / rate_share - change - out.braking_ramp * std::abs(slope);
    const double per_braking = 2.0 * std::abs(value) + change_of_slope;
    if (per_braking * most > left) most = std::max(0.0, left / per_braking);
  };
  for (Index j = 0; j < model_.dof(); ++j) {
    if (limits_.jerk.size() > 0) bound(motion.tangent, motion.curvature, limits_.jerk[j], j);
    if (limits_.torque_rate.size() > 0)
      bound(motion.inertia, motion.bias, limits_.torque_rate[j], j);
    // at rest, where the motion itself needs nothing
    const auto bound_at_rest = [&](double left, double slope) {
      if (slope * most > left) most = std::max(0.0, left / slope);
    };
    if (limits_.torque.size() > 0)
      bound_at_rest(limits_.torque[j] - std::abs(motion.gravity(j, k)),
                    std::abs(motion.inertia(j, k)) * motion.speed[k]);
    bound_at_rest(limits_.acceleration[j], std::abs(motion.tangent(j, k)) * motion.speed[k]);
  }
}

void PathTiming::set_mass(CertifiedPath& out) {
  MatrixXd M(model_.dof(), model_.dof());
  VectorXd q(model_.dof()), unused(q);
  out.mass = MatrixXd::Zero(model_.dof(), model_.dof());
  for (int k = 0; k < mass_places; ++k) {
    out.motion.curve.at(out.motion.curve.end() * k / (mass_places - 1), q, unused, unused);
    dynamics::mass_matrix(model_, ws_, q, M);
    out.mass = out.mass.cwiseMax(mass_between * M.cwiseAbs());
  }
}

}  // namespace hamelin::control
