// What a shield does about obstacles that move: docs/theory.md (14.24)–(14.29).
#include <algorithm>
#include <cmath>

#include "shield/shield.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// What must remain between the arm and where a moving obstacle is predicted [m].
constexpr double mover_margin_m = 0.005;
// Where a stop leaves more than this, no evasion is sought [m].
constexpr double comfortable_m = 0.02;
// A step is refused if the arm could be hit so soon after it: later places of an obstacle are
// known too badly [s].
constexpr double refused_within_s = 0.5;
// A move keeps so much more than its margin, so that the arm can leave where it ends [m].
constexpr double beyond_margin_m = 0.001;
// While the stop is clear itself, an evasion is examined in one of so many steps.
constexpr long evasion_steps = 8;

}  // namespace

std::string_view to_string(MoverProof proof) noexcept {
  switch (proof) {
    case MoverProof::clear:
      return "clear";
    case MoverProof::at_rest:
      return "at_rest";
    case MoverProof::none:
      break;
  }
  return "none";
}

bool Shield::list_movers(const Surroundings& world, const Node& node) {
  proof_.reset();
  predicted_.clear();
  bounded_.clear();
  all_listed_ = true;
  const scene::Environment& environment = world.environment;
  if (!environment.has_movers() || model_.shapes().empty()) return false;
  const scene::Shapes arm = place(node.q, arm_from_).arm;
  const Eigen::Vector3d& middle = arm.centers[arm.size() / 2];
  double reach = 0.0;  // of the arm about that point, within the horizon
  for (std::size_t s = 0; s < arm.size(); ++s)
    reach = std::max(reach, (arm.centers[s] - middle).norm() + arm.radii[s] +
                                (arm.is_capsule(s) ? arm.half_axes[s].norm() : 0.0));
  for (Index j = 0; j < node.q.size(); ++j)
    reach += levers_.shapes().col(j).maxCoeff() * MoverCheck::horizon_s * std::abs(node.v[j]);
  reach += levers_.shapes().maxCoeff() * Asides::longest;
  for (std::size_t k = 0; k < environment.obstacles().size(); ++k) {
    const scene::Obstacle& obstacle = environment.obstacles()[k];
    if (!environment.moves(k) || !scene::exists(obstacle, world.time_s) ||
        obstacle.shape == scene::Shape::frame)
      continue;
    const double near = reach + scene::bounding_radius(obstacle) +
                        MoverCheck::horizon_s * scene::max_speed(obstacle, world.time_s);
    if ((scene::motion_at(obstacle, world.time_s).pose.p() - middle).norm() > near) continue;
    auto& list = obstacle.prediction == scene::Prediction::speed_bound ? bounded_ : predicted_;
    if (list.size() < MoverCheck::movers_max)
      list.push_back(static_cast<int>(k));
    else
      all_listed_ = false;
  }
  return !predicted_.empty() || !bounded_.empty();
}

void Shield::note_proof() {
  ++counts_.proofs[static_cast<std::size_t>(*proof_)];
}

Shield::Foresight Shield::prove_stop_in_force(const Surroundings& world) {
  const Foresight in_force =
      prove(force_check_, world, {stop_.motion(), stop_.bounds(), stop_.time_s(), lead_s_});
  proof_ = in_force.proof;
  return in_force;
}

void Shield::go_on_among_movers(const Surroundings& world) {
  const Foresight in_force = prove_stop_in_force(world);
  const bool may_turn = stop_.at_rest() || !stop_.motion().moves() || !stop_.has_stopped();
  if (in_force.proof != MoverProof::none || predicted_.empty() || !may_turn) return;
  tried_ = stop_.motion();
  tried_.drop_move();
  double from_s = stop_.time_s();
  if (stop_.at_rest()) {
    tried_.set_at_rest(stop_.motion().end());
    from_s = 0.0;
  }
  straying_.bound_stop(tried_);
  const Foresight evasion = find_evasion(world, force_check_, from_s, zero_);
  if (evasion.proof == MoverProof::none) return;
  stop_.turn_to(tried_, from_s, straying_.bounds());
  ++counts_.evasions;
  proof_ = evasion.proof;
}

bool Shield::allow_for_movers(const Surroundings& world, const Step& step) {
  const Foresight tried = find_fail_safe(world, step);
  const bool evades = stopping_ && stop_.motion().moves() && !stop_.at_rest();
  const bool hit_soon = tried.proof == MoverProof::none && tried.clear_s < refused_within_s;
  if (hit_soon || (evades && tried.least_m < comfortable_m)) {
    if (prove_stop_in_force(world).proof != MoverProof::none) {
      blame(world);
      return false;
    }
  }
  asides_->pass(step.from.q);
  proof_ = tried.proof;
  return true;
}

void Shield::blame(const Surroundings& world) {
  MoverCheck& check = predicted_.empty() ? bounded_check_ : stop_check_;
  check.find_threat(ws_, {world.environment, world.time_s, lead_s_ + period_s_,
                          predicted_.empty() ? bounded_ : predicted_});
  const MoverCheck::Threat& threat = check.threat();
  refusal_ = {StopCause::obstacle, {threat.shape, threat.obstacle, -1, 0.0}, -1};
}

Shield::Foresight Shield::prove(MoverCheck& check, const Surroundings& world, const Examined& of) {
  const auto& [motion, stray, from_s, lead_s] = of;
  double margin = margin_m_;
  for (Index j = 0; j < stray.tracking.size(); ++j)
    margin += levers_.shapes().col(j).maxCoeff() * stray.tracking[j];
  if (stray.shapes.size() > 0) margin += stray.shapes.maxCoeff();
  margin = std::max(margin, mover_margin_m);
  Foresight found{MoverProof::none, 0.0, MoverCheck::far_m};
  if (!all_listed_) return found;
  if (!predicted_.empty()) {
    const MoverCheck::Proof proof =
        check.check(ws_, {world.environment, world.time_s, lead_s, predicted_}, motion, from_s,
                    MoverCheck::horizon_s, margin);
    found.clear_s = proof.clear_s;
    found.least_m = proof.least_m;
    if (proof.clear_s < MoverCheck::horizon_s) return found;
  }
  found.proof = MoverProof::clear;
  if (bounded_.empty()) return found;
  const double until = std::max(0.0, motion.duration_s() - from_s);
  const MoverCheck::World bounded{world.environment, world.time_s, lead_s, bounded_};
  const bool out_of_reach =
      until <= MoverCheck::horizon_s &&
      bounded_check_.check(ws_, bounded, motion, from_s, until, margin).clear_s >= until;
  if (out_of_reach || bounded_check_.retreats(ws_, bounded, motion, from_s, until, margin))
    found.proof = MoverProof::at_rest;
  else
    found = {MoverProof::none, 0.0, 0.0};
  return found;
}

// docs/theory.md (14.29)
Shield::Foresight Shield::find_fail_safe(const Surroundings& world, const Step& step) {
  const Foresight stop =
      prove(stop_check_, world, {tried_, straying_.bounds(), 0.0, lead_s_ + period_s_});
  if (predicted_.empty() || stop.least_m > comfortable_m) {
    has_aside_ = false;
    return stop;
  }
  const bool hit = stop.proof == MoverProof::none;
  if (!hit && counts_.steps % evasion_steps != 0) return stop;
  const Foresight evasion = find_evasion(world, stop_check_, 0.0, step.to.v);
  if (hit && evasion.clear_s > stop.clear_s) return evasion;
  if (tried_.moves()) {  // it is needed when the stop is not clear any more
    tried_.drop_move();
    straying_.bound_stop(tried_);
  }
  return stop;
}

// The one that was found last, or else one other.
Shield::Foresight Shield::find_evasion(const Surroundings& world, MoverCheck& stopped,
                                       double from_s, const VectorXd& ahead) {
  if (has_aside_) {
    const Foresight found = try_move(move_line_, move_check_, world, from_s, aside_);
    has_aside_ = found.proof != MoverProof::none;
    if (has_aside_) return found;
  }
  stopped.find_threat(ws_, {world.environment, world.time_s, lead_s_ + period_s_, predicted_});
  asides_->propose(ws_, stopped.threat(), tried_.stop_end(), ahead, aside_);
  const Foresight found = try_move(other_line_, other_check_, world, from_s, aside_);
  has_aside_ = found.proof != MoverProof::none;
  return found;
}

Shield::Foresight Shield::try_move(LineCheck& line, MoverCheck& check, const Surroundings& world,
                                   double from_s, const VectorXd& target) {
  constexpr Foresight none{MoverProof::none, 0.0, 0.0};
  const VectorXd& from = tried_.stop_end();
  way_ = target - from;
  const std::optional<double> time_s = move_time_.find(from, way_);
  if (!time_s || *time_s > MoverCheck::horizon_s) return none;
  tried_.set_move(target, *time_s);
  straying_.include_move(tried_);
  line_stray_ = straying_.tracking();
  Foresight found = none;
  if (keeps_limits(target) && line_is_clear(line, world, place(from, arm_end_), target))
    found = prove(check, world, {tried_, straying_.bounds(), from_s, lead_s_ + period_s_});
  if (found.proof != MoverProof::none) return found;
  tried_.drop_move();
  straying_.bound_stop(tried_);
  return none;
}

bool Shield::keeps_limits(const VectorXd& q) const {
  for (Index j = 0; j < limits_.q_lower.size(); ++j) {
    const double reserve = straying_.tracking()[j] + straying_.errors()[j];
    if (q[j] < limits_.q_lower[j] + reserve || q[j] > limits_.q_upper[j] - reserve) return false;
  }
  return true;
}

bool Shield::line_is_clear(LineCheck& line, const Surroundings& world, const LineCheck::End& from,
                           const VectorXd& to) {
  if (!world.environment.has_obstacles() && self_ == nullptr) return true;
  levers_.extend_travel(to, straying_.tracking());
  return is_clear(line, world, from, place(to, arm_line_), line_stray_, beyond_margin_m);
}

}  // namespace hamelin::control
