#include "guide/path_timing.hpp"

#include <algorithm>
#include <array>
#include <utility>

namespace hamelin::control {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Shares of the limits that a motion uses. The rest is for what keeps the arm on it.
constexpr double speed_share = 0.99, acceleration_share = 14.0 / 15.0, torque_share_most = 0.9,
                 torque_share_kept = 0.04;
constexpr double default_acceleration = 15.0;  // [rad/s² or m/s²]
// Changes of way-points that are tried, what each costs besides proofs in checks, and what these
// may cost; fewer where checks take longer than so [s]: the arm waits for them.
constexpr double tries_max = 200.0, improve_checks = 2000.0, usual_check_s = 2e-6;
constexpr long checks_per_try = 5;
// Intervals that keep less are examined again [m].
constexpr double enough_m = 0.004;
// Factors of such a margin that are tried.
constexpr std::array<double, 3> higher{4.0, 2.5, 1.6};
// Nodes of a motion that cost as much as a check.
constexpr Index nodes_per_check = 4;
// The mass matrix is evaluated at so many places, and may be larger between them.
constexpr int mass_places = 5;
constexpr double mass_between = 1.1;

}  // namespace

timing::Limits path_limits(const scene::Scene& scene, const model::Model& model,
                           const LimitReserve& reserve, const Json& params) {
  const ModelledLimits modelled = modelled_limits(scene, model.robot());
  timing::Limits out;
  out.velocity = modelled.velocity_max;
  if (reserve.velocity.size() == out.velocity.size()) out.velocity -= reserve.velocity;
  out.velocity *= speed_share;
  const auto found = params.find("acceleration_max");
  const double most =
      found != params.end() && found->is_number() ? found->get<double>() : default_acceleration;
  out.acceleration = VectorXd::Constant(model.dof(), acceleration_share * most);
  const double share =
      std::min(torque_share_most, scene::safety_bounds(scene).torque_share - torque_share_kept);
  out.torque = share * modelled.effort_max;
  return out;
}

PathTiming::PathTiming(const scene::Scene& scene, const model::Model& model,
                       const scene::SelfField* self, timing::Limits limits,
                       const search::Settings& settings)
    : model_(model),
      levers_(model, self),
      blending_(levers_),
      way_points_(model, levers_, limits, settings.q_lower, settings.q_upper),
      law_(model, std::move(limits)),
      seed_(settings.seed),
      ws_(model) {
  const ModelledLimits modelled = modelled_limits(scene, model.robot());
  const double share = usual_check_s / std::max(usual_check_s, scene.guide.check_time_s);
  effort_ = {static_cast<int>(tries_max * share), static_cast<long>(improve_checks * share)};
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
  const bool found = law_.solve(out->motion);
  cause_ = found ? std::string_view() : law_.cause();
  if (!found) return nullptr;
  out->limits = law_.limits();
  checks_ += out->motion.nodes() / nodes_per_check;
  set_margins(*out, *margins_);
  raise_margins(*out, query);
  set_room(*out);
  set_mass(*out);
  return out;
}

// docs/theory.md (14.30)
void PathTiming::set_margins(CertifiedPath& out, const search::Margins& margins) const {
  const timing::TimedPath& motion = out.motion;
  const Index n = motion.nodes() - 1;
  out.clearance_m.resize(n);
  out.self_m.resize(n);
  VectorXd from(model_.dof()), to(from), unused(from), bend(from);
  motion.curve.at(0.0, from, unused, unused);
  for (Index k = 0; k < n; ++k) {
    const double a = motion.place[k], b = motion.place[k + 1];
    const Index piece = motion.curve.at(0.5 * (a + b), to, unused, unused);
    motion.curve.bound_bend(piece, a, b, bend);
    const double loss = bend.isZero(0.0) ? 0.0 : timing::Blending::loss_m;
    motion.curve.at(b, to, unused, unused);
    out.clearance_m[k] = margins.least(from, to) - loss;
    out.self_m[k] = std::min(margins.least(from, to), margins.self_most_m()) - loss;
    from.swap(to);
  }
}

void PathTiming::raise_margins(CertifiedPath& out, search::Query& query) const {
  const timing::TimedPath& motion = out.motion;
  VectorXd from(model_.dof()), to(from), unused(from), bend(from);
  for (Index k = 0; k + 1 < motion.nodes(); ++k) {
    if (std::min(out.clearance_m[k], out.self_m[k]) >= enough_m) continue;
    const double a = motion.place[k], b = motion.place[k + 1];
    const Index piece = motion.curve.at(0.5 * (a + b), from, to, unused);
    motion.curve.bound_bend(piece, a, b, bend);
    const double stray = blending_.reach(0.125 * (b - a) * (b - a) * bend);
    motion.curve.at(a, from, unused, unused);
    motion.curve.at(b, to, unused, unused);
    for (const double factor : higher) {
      const auto raised = [&](double m) { return std::max(m, std::min(enough_m, factor * m)); };
      const double clearance = raised(out.clearance_m[k]), self = raised(out.self_m[k]);
      search::Margins margins(clearance + stray);
      margins.set_self_most(self + stray);
      query.set_margins(margins);
      if (!query.motion_clear(from, to)) continue;
      out.clearance_m[k] = clearance;
      out.self_m[k] = std::min(self, clearance);
      break;
    }
  }
}

void PathTiming::set_room(CertifiedPath& out) const {
  if (q_lower_.size() == 0) return;
  const timing::TimedPath& motion = out.motion;
  const Index n = motion.nodes() - 1;
  out.room.resize(model_.dof(), n);
  VectorXd from(model_.dof()), to(from), unused(from), bend(from);
  for (Index k = 0; k < n; ++k) {
    const double a = motion.place[k], b = motion.place[k + 1];
    const Index piece = motion.curve.at(0.5 * (a + b), from, to, unused);
    motion.curve.bound_bend(piece, a, b, bend);
    motion.curve.at(a, from, unused, unused);
    motion.curve.at(b, to, unused, unused);
    out.room.col(k) = (from.cwiseMin(to) - q_lower_).cwiseMin(q_upper_ - from.cwiseMax(to)) -
                      0.125 * (b - a) * (b - a) * bend;
  }
}

void PathTiming::set_mass(CertifiedPath& out) {
  MatrixXd M(model_.dof(), model_.dof());
  VectorXd q(model_.dof()), unused(q);
  out.mass = VectorXd::Zero(model_.dof());
  for (int k = 0; k < mass_places; ++k) {
    out.motion.curve.at(out.motion.curve.end() * k / (mass_places - 1), q, unused, unused);
    dynamics::mass_matrix(model_, ws_, q, M);
    out.mass = out.mass.cwiseMax(mass_between * M.cwiseAbs().rowwise().sum());
  }
}

}  // namespace hamelin::control
