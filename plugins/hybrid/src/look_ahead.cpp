#include "look_ahead.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hamelin::hybrid {

namespace {

constexpr double near_m = 0.25;        // movers farther than this within the horizon are ignored
constexpr double look_clear_m = 0.01;  // least distance of a way that is clear
constexpr double dash_clear_m = 0.02;  // the same for the own way without rows of the movers
constexpr double arrival_share = 0.8;  // of the goal's tolerances, for arrival
constexpr double better_m = 0.003;     // a way that is not clear replaces one that is worse
constexpr double hopeless_m = -0.06;   // a way that comes so much nearer than look_clear_m ends
constexpr double standing_radius_m = 0.08;  // obstacles that stand beyond this distance are ignored
constexpr double self_radius_m = 0.03;
constexpr double look_joint_limit_rate = 6.0;  // speed per distance from a joint limit [1/s]
constexpr double rate_share = 0.6;             // of a distance that may be lost in a step
constexpr int look_passes = 12;
constexpr int first_random = 8, random_ways = 12;    // numbers of candidates
constexpr double far_aside = 1.5, near_aside = 0.9;  // distance of a random way's end [rad or m]
constexpr double variation = 0.4;  // of the end of the best random way, per joint [rad or m]
constexpr Eigen::Index looked_trail_points = 64;  // more than fit into the horizon
constexpr double far_m = 1.0;                     // distances beyond this are not measured

}  // namespace

LookAhead::LookAhead(const planning::Setup& setup, const model::Model& model, Law& law,
                     const PointMargins& margins, const planning::Host& host)
    : setup_(setup),
      model_(model),
      law_(law),
      margins_(margins),
      surroundings_(host, setup),
      movers_(host, model),
      trail_(setup.dof(), looked_trail_points, trail_spacing),
      ws_(model),
      arm_(model),
      obstacles_(setup, standing_radius_m),
      filter_(setup.dof(), 4 * Obstacles::max_points),
      rng_(setup.seed() ^ 0x65766164ULL),
      seed_(setup.seed() ^ 0x65766164ULL),
      places_(places),
      in_force_(setup.dof()),
      best_(setup.dof()),
      candidate_(setup.dof()) {
  const int n = setup.dof();
  for (auto* x : {&start_q_, &start_v_, &q_, &v_, &u_, &via_, &row_, &lower_, &upper_})
    *x = Eigen::VectorXd::Zero(n);
  M_ = M_inv_ = Eigen::MatrixXd::Identity(n, n);
}

void LookAhead::reset() {
  rng_ = Rng(seed_);
  done_ = true;
}

bool LookAhead::is_near(const scene::Shapes& arm, std::size_t count) {
  movers_.update(count);
  constexpr double check_s = 0.25;
  for (double ahead = 0.0; ahead <= horizon_s; ahead += check_s) {
    movers_.predict(ahead, places_[0]);
    if (movers_.clearance(arm, places_[0], near_m) < near_m) return true;
  }
  return false;
}

void LookAhead::begin(const Eigen::VectorXd& q, const Eigen::VectorXd& v, const Eigen::MatrixXd& M,
                      const Eigen::MatrixXd& M_inv, const Way& way, const Trail& trail,
                      const Evasion& in_force, bool keep, double lead_s, int budget) {
  start_q_ = q + lead_s * v;
  start_v_ = v;
  M_ = M;
  M_inv_ = M_inv;
  way_ = way;
  trail_.copy(trail);
  in_force_ = in_force;
  keep_ = keep;
  budget_ = budget;
  for (int i = 0; i < places; ++i)
    movers_.predict(lead_s + step_s * i, places_[static_cast<std::size_t>(i)]);
  best_.act = Act::own;
  best_.rows = true;
  best_.clear = false;
  best_clearance_ = -std::numeric_limits<double>::infinity();
  next_ = 0;
  done_ = !next_candidate();
}

// In the order of preference; the random ways come last.
bool LookAhead::next_candidate() {
  const auto take = [&](Act act, bool rows) {
    candidate_.act = act;
    candidate_.rows = rows;
    start_candidate();
    return true;
  };
  const bool evades = in_force_.act != Act::own;
  const auto take_in_force = [&] {
    candidate_ = in_force_;
    start_candidate();
    return true;
  };
  for (;;) {
    const int candidate = next_++;
    if (candidate >= first_random + random_ways) return false;
    if (candidate >= first_random) {
      draw_aside();
      return take(Act::aside, candidate % 3 == 1);
    }
    if (candidate == 0 && keep_ && evades) return take_in_force();
    if (candidate == 1) return take(Act::own, false);
    if (candidate == 2) return take(Act::own, true);
    if (candidate == 3 && !keep_ && evades) return take_in_force();
    if (candidate == 4) return take(Act::stop, true);
    if (candidate == 5 && trail_.size() > 0) return take(Act::back, false);
    if (candidate == 6 && trail_.size() > 0) return take(Act::back, true);
    if (candidate == 7) return take(Act::stop, false);
  }
}

void LookAhead::draw_aside() {
  Eigen::VectorXd& aside = candidate_.aside;
  for (Eigen::Index k = 0; k < aside.size(); ++k) aside[k] = rng_.uniform(-1.0, 1.0);
  // Half of them are variations of the best so far.
  if (next_ % 2 == 0 && best_.act == Act::aside) {
    aside *= variation;
    aside += best_.aside;
  } else {
    aside *= (next_ % 2 == 0 ? near_aside : far_aside) / std::max(0.2, aside.norm());
    aside += start_q_;
  }
  if (const auto limit = setup_.q_lower()) aside = aside.cwiseMax(*limit);
  if (const auto limit = setup_.q_upper()) aside = aside.cwiseMin(*limit);
}

void LookAhead::start_candidate() {
  q_ = start_q_;
  v_ = start_v_;
  position_ = way_.position;
  age_ = 0;
  step_ = 0;
  clearance_ = far_m;
}

void LookAhead::finish_candidate() {
  const double enough =
      candidate_.act == Act::own && !candidate_.rows ? dash_clear_m : look_clear_m;
  const double left = clearance_ - enough;
  if (left >= 0.0 || clearance_ > best_clearance_ + better_m) {
    best_ = candidate_;
    best_.clear = left >= 0.0;
    best_clearance_ = clearance_;
  }
  done_ = best_.clear || !next_candidate();
}

void LookAhead::advance(int units) {
  for (; units > 0 && !done_; --units) {
    ++units_;
    if (budget_-- <= 0) {
      done_ = true;
      return;
    }
    step();
  }
}

void LookAhead::step() {
  dynamics::forward_kinematics(model_, ws_, q_);
  arm_.place(model_, ws_);
  const scene::Shapes arm = arm_.view();
  clearance_ = movers_.clearance(arm, places_[static_cast<std::size_t>(step_)], clearance_);
  const double enough = std::max(best_clearance_, look_clear_m + hopeless_m);
  const bool arrived = has_arrived();
  if (step_ == 0) starts_at_goal_ = arrived;
  if (step_ == steps || (arrived && !starts_at_goal_) ||
      (clearance_ < look_clear_m && clearance_ < enough))
    return finish_candidate();

  surroundings_.query(q_, standing_radius_m, self_radius_m);
  obstacles_.update(model_, ws_, surroundings_.contacts(), surroundings_.self_contacts());
  margins_.set(obstacles_.points(), law_.margin_weight(model_, ws_, q_, *way_.goal));
  double gain = evasion_gain, acceleration = evasion_acceleration;
  set_velocity(gain, acceleration);
  filter_.begin(M_, M_inv_);
  add_standing_rows();
  if (candidate_.rows) add_mover_rows(arm);
  set_box();
  v_ += (std::min(1.0, gain * step_s) * (u_ - v_))
            .cwiseMin(acceleration * step_s)
            .cwiseMax(-acceleration * step_s);
  (void)filter_.project(v_, look_passes);
  q_ += step_s * v_;
  ++step_;
}

// The arm need not stay at a goal that it reaches. If it is there already, nobody has told it to
// leave, so the way goes on.
bool LookAhead::has_arrived() const {
  return candidate_.act == Act::own &&
         v_.lpNorm<Eigen::Infinity>() < arrival_share * way_.goal->speed_max &&
         law_.within(model_, ws_, q_, *way_.goal, arrival_share);
}

void LookAhead::set_velocity(double& gain, double& acceleration) {
  if (candidate_.act != Act::own) {
    evasion_velocity(candidate_, trail_, q_, age_, u_);
  } else if (way_.waits) {
    u_.setZero();
  } else {
    Target target{way_.goal, way_.via};
    if (way_.path != nullptr) {
      position_ = way_.path->carrot(position_, q_, way_.ahead, via_);
      target = {way_.goal, &via_, position_ < way_.path->length()};
    }
    (void)law_.attract(model_, ws_, q_, target, u_);
    gain = target.via != nullptr ? params_.follow_gain : params_.velocity_gain;
    acceleration = params_.drive_acceleration;
  }
  if (const auto limit = setup_.velocity_max()) {
    double excess = 1.0;
    for (Eigen::Index k = 0; k < u_.size(); ++k)
      excess = std::max(excess, std::abs(u_[k]) / (*limit)[k]);
    u_ /= excess;
  }
}

void LookAhead::add_standing_rows() {
  const double rate = std::min(params_.approach_rate, rate_share / step_s);
  for (const auto& point : obstacles_.points()) {
    const double x = point.distance - point.margin;
    (void)filter_.add_row(point.row, -rate * x,
                          -rate * std::max(1e-9, point.distance - 0.5 * point.margin));
  }
}

// docs/theory.md (10.34)
void LookAhead::add_mover_rows(const scene::Shapes& arm) {
  const Movers::Places& now = places_[static_cast<std::size_t>(step_)];
  for (const double ahead : MoverRows::times_s) {
    const Movers::Places& then =
        places_[static_cast<std::size_t>(step_ + static_cast<int>(std::lround(ahead / step_s)))];
    movers_.each_near(arm, then, MoverRows::margin_m + 1.5 * ahead, [&](const MoverPoint& point) {
      const auto m = static_cast<std::size_t>(point.mover);
      if (movers_.has_passed(point, now[m])) return;
      row_of(point, model_, ws_, arm, row_);
      (void)filter_.add_row(row_, (MoverRows::margin_m - point.distance) / ahead, 0.0,
                            MoverRows::softness);
    });
  }
}

void LookAhead::set_box() {
  lower_ = v_.array() - step_s * params_.acceleration_max;
  upper_ = v_.array() + step_s * params_.acceleration_max;
  if (const auto limit = setup_.velocity_max()) {
    lower_ = lower_.cwiseMax(-*limit);
    upper_ = upper_.cwiseMin(*limit);
  }
  if (const auto limit = setup_.q_lower())
    lower_ = lower_.cwiseMax(look_joint_limit_rate * (*limit - q_).cwiseMin(0.0));
  if (const auto limit = setup_.q_upper())
    upper_ = upper_.cwiseMin(look_joint_limit_rate * (*limit - q_).cwiseMax(0.0));
  upper_ = upper_.cwiseMax(lower_);
  filter_.set_box(lower_, upper_);
}

}  // namespace hamelin::hybrid
