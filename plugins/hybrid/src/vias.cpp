#include "vias.hpp"

#include <algorithm>

namespace hamelin::hybrid {

namespace {

constexpr int max_vias = 64, max_targets = 3, max_legs = 4, via_steps = 25, target_steps = 60;
constexpr Eigen::Index max_path_points = Eigen::Index{max_legs} * (via_steps + target_steps + 4);
constexpr double target_tolerance = 0.04;
constexpr double via_global_share = 0.25;
constexpr double min_improvement = 0.05;  // of the distance, by rollouts that do not arrive

}  // namespace

Vias::Vias(const planning::Setup& setup, Rollout& rollout, Roots& roots, const JointBox& box)
    : box_(box),
      rollout_(rollout),
      roots_(roots),
      seed_(setup.seed() ^ 0x76696173ULL),
      rng_(seed_),
      trial_(setup.dof(), max_path_points),
      best_(setup.dof(), max_path_points),
      start_(setup.dof()),
      via_(setup.dof()),
      point_(setup.dof()),
      to_(setup.dof()) {}

void Vias::begin(const hamelin_goal& goal, const Eigen::VectorXd& q, const JointPath* goal_path,
                 double from) {
  goal_ = &goal;
  start_ = q;
  follows_path_ = goal_path != nullptr;
  rollout_.set_goal(goal);
  best_.clear();
  arrives_ = improved_ = false;
  tried_ = 0;
  ++stalls_;
  if (follows_path_) {
    roots_.begin(goal, q, goal_path, from);
    phase_ = Phase::roots;
  } else {
    best_distance_ = rollout_.goal_distance(q) - min_improvement;
    start_via_rollout();
  }
}

void Vias::start_via_rollout() {
  if (tried_++ == max_vias) return finish(false);
  // Half of the trials continue from the best end so far.
  if (improved_ && best_.size() + via_steps + target_steps + 4 < best_.capacity() &&
      rng_.uniform() < 0.5) {
    trial_ = best_;
  } else {
    trial_.clear();
    trial_.add(start_);
  }
  begin_ = trial_.size();
  point_ = trial_.end();
  if (rng_.uniform() < via_global_share)
    box_.draw(rng_, via_);
  else
    box_.draw_near(rng_, point_, rng_.uniform(0.2, std::min(2.5, 0.6 + 0.2 * stalls_)), via_);
  target_ = 0;
  phase_ = Phase::to_via;
  rollout_.begin(point_, via_, via_steps, via_tolerance);
}

void Vias::start_target_rollout() {
  phase_ = Phase::to_target;
  trial_.keep(via_end_);
  point_ = trial_.end();
  if (!follows_path_) return rollout_.begin(point_, target_steps);
  to_ = roots_.q(target_);
  rollout_.begin(point_, to_, target_steps, target_tolerance);
}

void Vias::finish(bool arrived) {
  arrives_ = arrived;
  phase_ = Phase::done;
}

bool Vias::advance(int units) {
  while (units > 0 && phase_ != Phase::done) {
    if (phase_ == Phase::roots) {
      const int used = roots_.advance(units, rng_);
      units -= used;
      units_ += used;
      if (!roots_.done()) break;
      if (roots_.count() == 0) {
        finish(false);
      } else {
        best_distance_ = (roots_.q(0) - start_).norm() - min_improvement;
        start_via_rollout();
      }
    } else {
      --units;
      ++units_;
      advance_rollout();
    }
  }
  return phase_ == Phase::done;
}

void Vias::advance_rollout() {
  using Step = Rollout::Step;
  const Step step = rollout_.step();
  if (step == Step::moved) return trial_.add(rollout_.q());
  if (step == Step::touched) return start_via_rollout();
  if (phase_ == Phase::to_via) {
    if (trial_.size() < begin_ + 2) return start_via_rollout();
    // The first rollout that leads away from the start is used if no other succeeds.
    if (best_.empty()) best_ = trial_;
    via_end_ = trial_.size();
    return start_target_rollout();
  }
  const bool arrived = step == Step::arrived;
  if (arrived || rollout_.distance() < best_distance_) {
    best_distance_ =
        std::min(best_distance_, rollout_.distance() - (arrived ? 0.0 : min_improvement));
    best_ = trial_;
    improved_ = true;
    rejoin_arc_length_ = follows_path_ ? roots_.arc_length(target_) : 0.0;
    if (arrived) return finish(true);
  }
  // A path has several roots.
  if (follows_path_ && ++target_ < std::min(roots_.count(), max_targets))
    return start_target_rollout();
  start_via_rollout();
}

}  // namespace hamelin::hybrid
