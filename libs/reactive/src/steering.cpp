#include "hamelin/reactive/steering.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

namespace hamelin::reactive {

namespace {

constexpr double endless = std::numeric_limits<double>::infinity();
constexpr double look_s = 0.05;                // between the beginnings of looks
constexpr int watch_units = 1, try_units = 4;  // postures per tick, while the course is watched
                                               // and while candidates are tried
constexpr double arrival_bonus = 10.0, arrival_per_s = 0.1;
constexpr double keep_gain = 0.02, switch_gain = 0.1;
constexpr double basin_s = 1.0;  // without a new best of where the unturned course ends
constexpr double stall_after_s = 0.3, stall_progress = 0.01;
constexpr double stall_width_squared = 0.25;  // [rad² or m²]
constexpr std::size_t stalls_max = 64;
constexpr double longest_turn_s = 1.6, shortest_random_share = 0.15;
constexpr std::array turn_shares{0.25, 0.5, 0.75, 1.0};
constexpr std::array turn_angles{std::numbers::pi / 2, std::numbers::pi / 3,
                                 2.0 * std::numbers::pi / 3};

}  // namespace

TurnKinds turn_kinds(std::string_view name) {
  if (name == "tangents") return TurnKinds::tangents;
  return name == "axes" ? TurnKinds::axes : TurnKinds::all;
}

Steering::Steering(const planning::Host& host, const planning::Setup& setup,
                   const model::Model& model, const LawParams& law, const PointMargins& margins,
                   const SteeringParams& params)
    : setup_(setup),
      surroundings_(host, setup),
      prediction_(setup, model, law, margins, surroundings_),
      turner_(setup.dof()),
      params_(params),
      seed_(setup.seed()),
      rng_(seed_),
      period_s_(setup.control_period_s()),
      cruise_speed_(law.cruise_speed),
      stalls_(stalls_max, Eigen::VectorXd::Zero(setup.dof())) {
  q_ = Eigen::VectorXd::Zero(setup.dof());
  turn_.direction = candidate_.direction = best_turn_.direction = none_.direction = q_;
  sideways_.setZero(setup.dof(), Prediction::sideways_max);
  restart();
}

void Steering::restart() {
  rng_ = Rng(seed_);
  phase_ = Phase::idle;
  turn_.left_s = 0.0;
  begun_s_ = -endless;
  sideways_count_ = index_ = looks_in_vain_ = 0;
  stall_count_ = 0;
  overall_.distance = standing_.distance = predicted_.distance = endless;
  arrives_ = false;
}

void Steering::advance(double time_s, const Eigen::VectorXd& q, double distance,
                       const hamelin_goal& goal, bool moving) {
  if (turn_.on()) turn_.left_s -= period_s_;
  note_stall(time_s, q, distance);
  if (phase_ == Phase::idle && time_s >= begun_s_ + look_s - 1e-9)
    begin_look(time_s, q, goal, moving);
  int units = phase_ == Phase::candidate ? try_units : watch_units;
  for (; units > 0 && phase_ != Phase::idle; --units) {
    ++units_;
    if (!prediction_.step()) finish_prediction();
  }
}

bool Steering::Best::improves(double candidate, double time_s) {
  if (!(candidate < distance - stall_progress)) return false;
  distance = candidate;
  since_s = time_s;
  return true;
}

// Where the arm stands at a balance of attraction and what blocks it.
void Steering::note_stall(double time_s, const Eigen::VectorXd& q, double distance) {
  if (overall_.improves(distance, time_s)) looks_in_vain_ = 0;
  if (turn_.on()) {
    standing_ = {std::min(distance, standing_.distance), time_s};
  } else if (!standing_.improves(distance, time_s) && time_s - standing_.since_s > stall_after_s) {
    remember(q);
    standing_ = {distance, time_s};
  }
}

// Where the course without a turn ends again and again.
void Steering::note_basin(const Eigen::VectorXd& end, double distance) {
  if (predicted_.improves(distance, begun_s_) || begun_s_ - predicted_.since_s <= basin_s) return;
  remember(end);
  predicted_.since_s = begun_s_;
}

void Steering::begin_look(double time_s, const Eigen::VectorXd& q, const hamelin_goal& goal,
                          bool moving) {
  begun_s_ = time_s;
  q_ = q;
  goal_ = &goal;
  moving_ = moving;
  found_ = false;
  tried_ = 0;
  phase_ = Phase::straight;
  predict(none_);
}

void Steering::predict(const Turn& turn) {
  prediction_.begin(q_, *goal_, turn, moving_);
}

double Steering::cost() const {
  if (prediction_.arrives()) return arrival_per_s * prediction_.time_s() - arrival_bonus;
  double out = prediction_.distance();  // infinite if it is lost
  for (std::size_t i = 0; i < std::min(stall_count_, stalls_.size()); ++i)
    out += std::exp(-(prediction_.end() - stalls_[i]).squaredNorm() / stall_width_squared);
  return out;
}

void Steering::finish_prediction() {
  const double J = cost();
  if (phase_ == Phase::straight) {
    straight_cost_ = least_cost_ = J;
    arrives_ = prediction_.arrives();
    if (!arrives_) sideways_count_ = prediction_.sideways(sideways_);
    if (!arrives_ && !prediction_.is_lost()) note_basin(prediction_.end(), prediction_.distance());
    if (turn_.on()) {
      phase_ = Phase::present;
      return predict(turn_);
    }
  } else if (phase_ == Phase::present) {
    if (J < straight_cost_ - keep_gain) {
      least_cost_ = J;
      arrives_ = prediction_.arrives();
    } else {
      turn_.left_s = 0.0;
    }
  } else if (may_turn() && (J < least_cost_ - switch_gain || (found_ && J < least_cost_))) {
    least_cost_ = J;
    best_turn_ = candidate_;
    found_ = true;
  }
  if (arrives_) return finish_look();
  try_next();
}

// An arm that follows a target leaves it only where it surely comes back to it.
bool Steering::may_turn() const {
  return prediction_.arrives() || goal_->type != HAMELIN_GOAL_FOLLOW;
}

void Steering::try_next() {
  if (tried_++ == params_.candidates) return finish_look();
  phase_ = Phase::candidate;
  draw_candidate();
  if (candidate_.on())
    predict(candidate_);
  else
    finish_look();
}

void Steering::finish_look() {
  phase_ = Phase::idle;
  if (tried_ > 0) ++looks_in_vain_;
  if (found_) turn_ = best_turn_;
}

// The next one of a cyclic list.
void Steering::draw_candidate() {
  const int n = setup_.dof(), tangents = 2 * sideways_count_;
  const int structured = tangents + (params_.kinds == TurnKinds::tangents ? 0 : 2 * n);
  const int all = structured + (params_.kinds == TurnKinds::all ? std::max(4, structured / 2) : 0);
  candidate_.left_s = 0.0;
  if (all == 0) return;
  const int round = index_ / all, i = index_ % all;
  ++index_;
  const auto r = static_cast<std::size_t>(round);
  const auto k = static_cast<std::size_t>(i);
  const double side = i % 2 == 0 ? 1.0 : -1.0;
  candidate_.angle = turn_angles[(r + k) % turn_angles.size()];
  candidate_.left_s = longest_turn_s * turn_shares[(r + k / 2) % turn_shares.size()];
  if (i < tangents) {
    candidate_.direction = side * sideways_.col(i / 2);
  } else if (i < structured) {
    candidate_.direction.setZero();
    candidate_.direction[(i - tangents) / 2] = side;
  } else {
    for (auto& x : candidate_.direction) x = rng_.normal();
    candidate_.left_s = longest_turn_s * rng_.uniform(shortest_random_share, 1.0);
  }
}

void Steering::apply(const Eigen::MatrixXd& M, Eigen::VectorXd& u) {
  if (turn_.on()) turner_.apply(turn_, M, cruise_speed_, u);
}

}  // namespace hamelin::reactive
