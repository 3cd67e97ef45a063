#include "guide/path_certifier.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "hamelin/timing/blended_path.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Factors of a margin that are tried, where it is less than there is.
constexpr std::array higher{4.0, 2.5, 1.6};
// Of bounds of rates, the shares that a motion uses, the change of a stop's braking, and both with
// the braking; and the largest such change, where the bounds do not say it [1/s²].
constexpr double rate_share = CertifiedPath::rate_share, ramp_share = 0.2, whole_rate = 0.9,
                 braking_ramp_most = 2000.0;
// The mass matrix is evaluated at so many places, and may be larger between them.
constexpr int mass_places = 5;
constexpr double mass_between = 1.1;

}  // namespace

PathCertifier::PathCertifier(const model::Model& model, const scene::Levers& levers,
                             const ModelledLimits& modelled, double enough_m)
    : model_(model),
      levers_(levers),
      q_lower_(modelled.q_lower),
      q_upper_(modelled.q_upper),
      enough_m_(enough_m),
      ws_(model) {
  chord_.from = chord_.to = chord_.stray = VectorXd::Zero(model.dof());
}

void PathCertifier::certify(CertifiedPath& path, const search::Margins& margins,
                            search::Query& query) {
  const Index n = path.motion.nodes() - 1;
  path.clearance_m.resize(n);
  path.self_m.resize(n);
  for (Index k = 0; k < n; ++k) {
    path.motion.chord(k, chord_.from, chord_.to, chord_.stray);
    set_margins(path, k, margins, query);
  }
  complete(path);
}

void PathCertifier::complete(CertifiedPath& path) {
  set_room(path);
  set_mass(path);
  set_braking(path);
}

void PathCertifier::set_room(CertifiedPath& path) {
  if (q_lower_.size() == 0) return;
  path.room.resize(q_lower_.size(), path.motion.nodes() - 1);
  for (Index k = 0; k < path.room.cols(); ++k) {
    path.motion.chord(k, chord_.from, chord_.to, chord_.stray);
    path.room.col(k) = (chord_.from.cwiseMin(chord_.to) - q_lower_)
                           .cwiseMin(q_upper_ - chord_.from.cwiseMax(chord_.to)) -
                       chord_.stray;
  }
}

// docs/theory.md (14.30). Near a tight start or goal paths are proved with less than there is.
void PathCertifier::set_margins(CertifiedPath& path, Index interval, const search::Margins& margins,
                                search::Query& query) {
  double &clearance = path.clearance_m[interval], &self = path.self_m[interval];
  const double loss = chord_.stray.isZero(0.0) ? 0.0 : timing::Blending::loss_m,
               proved = margins.least(chord_.from, chord_.to);
  clearance = proved - loss;
  self = std::min(proved, margins.self_most_m()) - loss;
  if (std::min(clearance, self) < enough_m_) raise_margins(clearance, self, query);
}

bool PathCertifier::keeps(double of_obstacles_m, double of_self_m, search::Query& query) const {
  const double stray = levers_.reach(chord_.stray);
  search::Margins margins(of_obstacles_m + stray);
  margins.set_self_most(of_self_m + stray);
  query.set_margins(margins);
  return query.motion_clear(chord_.from, chord_.to);
}

// Both together, and then the one from obstacles alone.
void PathCertifier::raise_margins(double& clearance_m, double& self_m, search::Query& query) const {
  const auto raised = [&](double m, double factor) { return std::min(enough_m_, factor * m); };
  for (const bool both : {true, false})
    for (const double factor : higher) {
      const double more = std::max(clearance_m, raised(clearance_m, factor)),
                   more_of_self =
                       both ? std::max(self_m, std::min(more, raised(self_m, factor))) : self_m;
      if (!both && !(more > clearance_m)) continue;
      if (!keeps(more, more_of_self, query)) continue;
      clearance_m = more;
      self_m = more_of_self;
      break;
    }
}

// docs/theory.md (14.37)
void PathCertifier::set_braking(CertifiedPath& path) const {
  const timing::Limits& limits = path.limits;
  if (!limits.have_rates()) return;
  const timing::TimedPath& motion = path.motion;
  const Index n = motion.nodes();
  double ramp = braking_ramp_most;
  for (Index k = 0; k < n; ++k)
    for (Index j = 0; j < model_.dof(); ++j) {
      const auto bound = [&](const VectorXd& rate, double size) {
        if (rate.size() > 0 && size * ramp > ramp_share * rate[j] / rate_share)
          ramp = ramp_share * rate[j] / rate_share / size;
      };
      bound(limits.jerk, std::abs(motion.tangent(j, k)) * motion.speed[k]);
      bound(limits.torque_rate, std::abs(motion.inertia(j, k)) * motion.speed[k]);
    }
  path.braking_ramp = ramp;
  path.braking_max = VectorXd::Constant(n, std::numeric_limits<double>::infinity());
  for (Index k = 0; k < n; ++k) bound_braking(path, k);
}

void PathCertifier::bound_braking(CertifiedPath& path, Index k) const {
  const timing::TimedPath& motion = path.motion;
  const timing::Limits& limits = path.limits;
  // what a row is without braking, and with it per β, at a node
  const auto row = [&](const MatrixXd& by_rate, const MatrixXd& by_square, Index j, Index i) {
    const double s = motion.speed[i];
    return std::pair(by_rate(j, i) * motion.rate_at(i) + by_square(j, i) * s * s,
                     by_rate(j, i) * s);
  };
  double& most = path.braking_max[k];
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
        whole_rate * limit / rate_share - change - path.braking_ramp * std::abs(slope);
    const double per_braking = 2.0 * std::abs(value) + change_of_slope;
    if (per_braking * most > left) most = std::max(0.0, left / per_braking);
  };
  for (Index j = 0; j < model_.dof(); ++j) {
    if (limits.jerk.size() > 0) bound(motion.tangent, motion.curvature, limits.jerk[j], j);
    if (limits.torque_rate.size() > 0) bound(motion.inertia, motion.bias, limits.torque_rate[j], j);
    // at rest, where the motion itself needs nothing
    const auto bound_at_rest = [&](double left, double slope) {
      if (slope * most > left) most = std::max(0.0, left / slope);
    };
    if (limits.torque.size() > 0)
      bound_at_rest(limits.torque[j] - std::abs(motion.gravity(j, k)),
                    std::abs(motion.inertia(j, k)) * motion.speed[k]);
    bound_at_rest(limits.acceleration[j], std::abs(motion.tangent(j, k)) * motion.speed[k]);
  }
}

void PathCertifier::set_mass(CertifiedPath& path) {
  MatrixXd M(model_.dof(), model_.dof());
  VectorXd q(model_.dof()), unused(q);
  path.mass = MatrixXd::Zero(model_.dof(), model_.dof());
  for (int k = 0; k < mass_places; ++k) {
    path.motion.curve.at(path.motion.curve.end() * k / (mass_places - 1), q, unused, unused);
    dynamics::mass_matrix(model_, ws_, q, M);
    path.mass = path.mass.cwiseMax(mass_between * M.cwiseAbs());
  }
}

}  // namespace hamelin::control
