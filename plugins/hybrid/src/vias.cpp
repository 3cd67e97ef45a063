#include "vias.hpp"

#include <algorithm>

namespace hamelin::hybrid {

namespace {

constexpr int most_vias = 64, most_targets = 3, most_legs = 4, via_steps = 25, target_steps = 60;
constexpr Eigen::Index most_points = Eigen::Index{most_legs} * (via_steps + target_steps + 4);
constexpr double target_tolerance = 0.04;
constexpr double via_global_share = 0.25;
constexpr double worth = 0.05;  // nearer to the goal by this much, a way that does not arrive is taken

}  // namespace

Vias::Vias(const planning::Setup& setup, Rollout& rollout, Roots& roots, const JointBox& box)
    : box_(box),
      rollout_(rollout),
      roots_(roots),
      rng_(setup.seed() ^ 0x76696173ULL),
      trial_(setup.dof(), most_points),
      best_(setup.dof(), most_points),
      start_(setup.dof()),
      via_(setup.dof()),
      point_(setup.dof()),
      to_(setup.dof()) {}

void Vias::begin(const hamelin_goal& goal, const Eigen::VectorXd& q, const Way* path, double from) {
  goal_ = &goal;
  start_ = q;
  path_ = path != nullptr;
  rollout_.take_goal(goal);
  best_.clear();
  arrives_ = nearer_ = false;
  tried_ = 0;
  ++stalls_;
  if (path_) {
    roots_.begin(goal, q, path, from);
    phase_ = Phase::roots;
  } else {
    best_distance_ = rollout_.goal_distance(q) - worth;
    next_via();
  }
}

void Vias::next_via() {
  if (tried_++ == most_vias) return over(false);
  // half of the trials go on from the best end so far
  if (nearer_ && best_.size() + via_steps + target_steps + 4 < best_.capacity() && rng_.uniform() < 0.5) {
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

void Vias::head_for_target() {
  phase_ = Phase::to_target;
  trial_.keep(via_end_);
  point_ = trial_.end();
  if (!path_) return rollout_.begin(point_, target_steps);
  to_ = roots_.q(target_);
  rollout_.begin(point_, to_, target_steps, target_tolerance);
}

void Vias::over(bool arrived) {
  arrives_ = arrived;
  phase_ = Phase::over;
}

bool Vias::advance(int units) {
  while (units > 0 && phase_ != Phase::over) {
    if (phase_ == Phase::roots) {
      const int used = roots_.advance(units, rng_);
      units -= used;
      units_ += used;
      if (!roots_.done()) break;
      if (roots_.count() == 0) {
        over(false);
      } else {
        best_distance_ = (roots_.q(0) - start_).norm() - worth;
        next_via();
      }
    } else {
      --units;
      ++units_;
      roll();
    }
  }
  return phase_ == Phase::over;
}

void Vias::roll() {
  using Step = Rollout::Step;
  const Step step = rollout_.step();
  if (step == Step::moved) return trial_.add(rollout_.q());
  if (step == Step::touched) return next_via();
  if (phase_ == Phase::to_via) {
    if (trial_.size() < begin_ + 2) return next_via();
    // the last resort, where nothing comes of any: the first that leads away from here
    if (best_.empty()) best_ = trial_;
    via_end_ = trial_.size();
    return head_for_target();
  }
  const bool arrived = step == Step::arrived;
  if (arrived || rollout_.distance() < best_distance_) {
    best_distance_ = std::min(best_distance_, rollout_.distance() - (arrived ? 0.0 : worth));
    best_ = trial_;
    nearer_ = true;
    along_ = path_ ? roots_.along(target_) : 0.0;
    if (arrived) return over(true);
  }
  // a path has several places to come back to
  if (path_ && ++target_ < std::min(roots_.count(), most_targets)) return head_for_target();
  next_via();
}

}  // namespace hamelin::hybrid
