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
  out->limits = law_.limits();
  checks_ += law_.evaluated() / places_per_check;
  certifier_.certify(*out, *margins_, query);
  out->stop_acceleration = stop_acceleration_;
  return out;
}

}  // namespace hamelin::control
