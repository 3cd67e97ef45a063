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

// Changes of way-points that are tried, what each costs besides proofs in checks, and what these
// may cost; fewer where checks take longer than so [s]: the arm waits for them.
constexpr double tries_max = 250.0, improve_checks = 1000.0, usual_check_s = 2e-6;
constexpr long checks_per_try = 8;
// Of a bound of the tip's speed, what a motion uses. The rest is for what keeps the arm on it.
constexpr double tip_speed_share = 0.9;
// How far a new path goes on straight where it leaves another one [rad or m].
constexpr double straight_ahead = 0.1, least_ahead = 1e-3;
// Places at which torques are evaluated, that cost as much as a check.
constexpr long places_per_check = 8;

}  // namespace

PathTiming::PathTiming(const scene::Scene& scene, const model::Model& model,
                       const scene::SelfField* self, const MotionBounds& bounds,
                       const search::Settings& settings)
    : stop_acceleration_(bounds.changes.acceleration_max),
      levers_(model, self),
      blending_(levers_),
      law_(model, motion_limits(scene, model, bounds)),
      way_points_(model, levers_, law_.limits(), settings.q_lower, settings.q_upper),
      certifier_(model, levers_, modelled_limits(scene, model.robot()),
                 enough_margin_m(bounds.reserve)),
      seed_(settings.seed) {
  const double share = usual_check_s / std::max(usual_check_s, scene.guide.check_time_s);
  effort_ = {static_cast<int>(tries_max * share), static_cast<long>(improve_checks * share)};
}

void PathTiming::begin(std::uint64_t number, double tip_speed_m_s) {
  law_.set_tip_speed(tip_speed_share * tip_speed_m_s);
  way_points_.set_tip_speed(tip_speed_share * tip_speed_m_s);
  rng_ = Rng(seed_ + number);
  best_.reset();
  lead_ = {};
  leads_ = false;
  lead_speed_ = 0.0;
}

void PathTiming::lead_to(const Lead& lead, double place) {
  const timing::TimedPath::Along begin = lead.path->motion.along(lead.time_s);
  constexpr double least = 1e-9;
  if (place - begin.place > least) lead_ = lead.path->motion.curve.part(begin.place, place);
  leads_ = true;
  lead_speed_ = begin.speed;
  lead_clearance_m_ = lead.path->clearance_m.minCoeff();
  lead_self_m_ = lead.path->self_m.minCoeff();
}

void PathTiming::begin_past(const Lead& lead, VectorXd& from) {
  const timing::TimedPath& motion = lead.path->motion;
  const double end = motion.curve.next_straight(motion.along(lead.time_s).place);
  lead_to(lead, end);
  VectorXd unused(from.size()), other(from.size());
  motion.curve.at(end, from, unused, other);
}

void PathTiming::begin_with(const Lead& lead, double braking_s, VectorXd& from, VectorXd& towards) {
  const timing::TimedPath& motion = lead.path->motion;
  const double end = motion.curve.next_straight(motion.along(lead.time_s + braking_s).place);
  lead_to(lead, end);
  VectorXd along(from.size()), unused(from.size());
  motion.curve.at(end, from, along, unused);
  towards =
      from + std::min(straight_ahead, motion.curve.end() - end + least_ahead) * along.normalized();
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
  timing::WayPoints::Effort effort = effort_;
  effort.fixed = leads_ ? 2 : 1;
  (void)way_points_.improve(*best_, *margins_, query, rng_, effort);
  auto out = std::make_unique<CertifiedPath>();
  const double led = lead_.pieces() > 0 ? lead_.end() : 0.0;
  out->motion.curve = best_->curve();
  if (led > 0.0) {
    lead_.add(out->motion.curve);
    std::swap(lead_, out->motion.curve);
  }
  if (!law_.solve(out->motion, lead_speed_)) return nullptr;
  out->limits = law_.limits();
  checks_ += law_.evaluated() / places_per_check;
  certifier_.certify(*out, *margins_, query);
  // its own proof holds for what the arm is on already
  for (Index k = 0; k < out->clearance_m.size() && out->motion.place[k] < led; ++k) {
    out->clearance_m[k] = std::min(out->clearance_m[k], lead_clearance_m_);
    out->self_m[k] = std::min(out->self_m[k], lead_self_m_);
  }
  out->stop_acceleration = stop_acceleration_;
  return out;
}

}  // namespace hamelin::control
