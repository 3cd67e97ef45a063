#include "evader.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace hamelin::hybrid {

namespace {

// Time between the starts of two looks, and time for which an evasion is kept while it is clear
// [s].
constexpr double look_period_s = 0.02, evasion_kept_s = 0.2;
constexpr Eigen::Index trail_points = 512;

}  // namespace

Evader::Evader(const planning::Host& host, const planning::Setup& setup, const model::Model& model,
               Law& law, const PointMargins& margins)
    : model_(model),
      period_s_(setup.control_period_s()),
      look_ticks_(std::max<std::uint64_t>(
          1, static_cast<std::uint64_t>(std::lround(look_period_s / period_s_)))),
      movers_(host, model),
      arm_(model),
      trail_(setup.dof(), trail_points, trail_spacing),
      evasion_(setup.dof()),
      look_(setup, model, law, margins, host),
      row_(Eigen::VectorXd::Zero(setup.dof())) {}

void Evader::set_params(const LookAheadParams& params, int budget, int steps) noexcept {
  look_.set_params(params);
  budget_ = budget;
  const int ticks = static_cast<int>(look_ticks_);
  steps_ = std::max(steps, (budget + ticks - 1) / ticks);
}

void Evader::reset() {
  trail_.clear();
  trail_age_ = 0;
  look_.reset();
  ticks_ = 0;
  since_s_ = 0.0;
  go_own_way();
}

void Evader::go_own_way() {
  evasion_.act = Act::own;
  evasion_.rows = evasion_.clear = true;
  clearance_ahead_.reset();
  looks_ = false;
}

void Evader::update(const planning::Tick& tick, const Arm& arm, const Way& way) {
  movers_.update(tick.moving_count());
  if (!active()) {
    if (evades() || looks_) go_own_way();
    return;
  }
  arm_.place(model_, arm.ws);
  movers_.predict(0.0, places_[0]);
  if (evasion_.act == Act::back)
    trail_.forget(std::exchange(trail_age_, 0));
  else
    trail_.add(arm.q);
  if (looks_ && !(way == way_)) looks_ = false;  // it looked along another way
  if (ticks_++ % look_ticks_ == 0) {
    if (looks_) take_look(tick.time_s());
    way_ = way;
    looks_ = look_.is_near(arm_.view(), tick.moving_count());
    if (!looks_) return go_own_way();
    const bool keep = evasion_.clear && tick.time_s() - since_s_ < evasion_kept_s;
    look_.begin(arm.q, arm.v, arm.M, arm.M_inv, way, trail_, evasion_, keep,
                static_cast<double>(look_ticks_) * period_s_, budget_);
  }
  if (looks_) look_.advance(steps_);
}

void Evader::take_look(double time_s) {
  const Evasion& found = look_.result();
  if (found.act != evasion_.act || found.aside != evasion_.aside) {
    since_s_ = time_s;
    trail_age_ = 0;
  }
  evasion_ = found;
  clearance_ahead_ = look_.clearance();
}

void Evader::add_rows(const Arm& arm, const Eigen::VectorXd& w, SafetyFilter& filter) {
  const scene::Shapes shapes = arm_.view();
  for (const double ahead : MoverRows::times_s) {
    movers_.predict(ahead, places_[1]);
    movers_.each_near(
        shapes, places_[1], MoverRows::margin_m + MoverRows::speed_m_s * ahead,
        [&](const MoverPoint& point) {
          if (movers_.has_passed(point, places_[0][static_cast<std::size_t>(point.mover)])) return;
          row_of(point, model_, arm.ws, shapes, row_);
          double bound = (MoverRows::margin_m - point.distance) / ahead;
          if (const double present = row_.dot(w); present < bound)
            bound = std::min(bound, present + filter.braking_room(row_, w));
          (void)filter.add_row(row_, bound, 0.0, MoverRows::softness);
        });
  }
}

}  // namespace hamelin::hybrid
