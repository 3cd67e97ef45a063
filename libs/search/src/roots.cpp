#include "roots.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>

#include "hamelin/search/joint_metric.hpp"

namespace hamelin::search {

using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// Of each goal: attempts in all, attempts where nothing was found yet, and roots.
constexpr int attempts_max = 64, attempts_for_one = 640;
constexpr std::size_t roots_max = 6;
constexpr int steps_max = 40, steps_at_once = 8;  // of a batch towards its targets
// Share of the tolerance of a joint goal within which other places are drawn.
constexpr double joint_tolerance_share = 0.9;
// Share of a tip goal's tolerances within which other poses are drawn. Inverse kinematics takes the
// rest.
constexpr double tip_tolerance_share = 0.6;

// Another pose within the tolerances of the goal, since the goal itself is often near an obstacle.
dynamics::TipTarget draw_near(const dynamics::TipTarget& target, Rng& rng) {
  const auto draw = [&](double radius) -> Vector3d {
    Vector3d out;
    for (int i = 0; i < 3; ++i) out[i] = rng.uniform(-1.0, 1.0);
    return out * (radius / std::max(1.0, out.norm()));
  };
  dynamics::TipTarget out = target;
  out.position += draw(tip_tolerance_share * target.tolerance_m);
  const Vector3d turn = draw(tip_tolerance_share * target.tolerance_rad);
  out.rotation =
      Eigen::AngleAxisd(turn.norm(), turn.stableNormalized()).toRotationMatrix() * target.rotation;
  return out;
}

dynamics::TipTarget tip_target(const scene::Goal& goal) {
  dynamics::TipTarget out;
  out.position = goal.pose.p();
  out.rotation = goal.pose.R();
  out.turns = goal.type == scene::GoalType::pose;
  out.tolerance_m = goal.tolerance_m;
  if (out.turns) out.tolerance_rad = goal.tolerance_rad;
  return out;
}

}  // namespace

Roots::Roots(const model::Model& model, const dynamics::JointBox& box, const Settings& settings,
             const VectorXd& weights)
    : box_(box),
      settings_(settings),
      weights_(weights),
      root_lanes_(model, box),
      kinematics_(model, box),
      model_(model),
      ws_(model),
      q_(Eigen::MatrixXd::Zero(model.dof(), kernel::lanes)),
      sample_(VectorXd::Zero(model.dof())) {}

void Roots::begin(const Problem& problem) {
  problem_ = &problem;
  attempts_ = rounds_ = next_ = ordered_ = steps_ = 0;
  checks_ = 0;
  goal_ = 0;
  excess_.reset();
  found_.assign(problem.goals.size(), 0);
}

bool Roots::tries(std::size_t roots) const noexcept {
  const auto goals = static_cast<int>(problem_->goals.size());
  if (std::all_of(found_.begin(), found_.end(), [](char found) { return found != 0; }))
    return false;
  return roots < roots_max * problem_->goals.size() &&
         (in_batch() || attempts_ < goals * (roots == 0 ? attempts_for_one : attempts_max));
}

bool Roots::take(const VectorXd& q, Query& query, Root& root) {
  for (std::size_t i = 0; i < problem_->goals.size(); ++i) {
    const scene::Goal& goal = problem_->goals[i];
    if (!reaches(goal, q) || !keeps(query, q)) continue;
    const bool joint = goal.type == scene::GoalType::joint;
    const double least = std::max(1e-6, joint ? settings_.least_m : settings_.root_clearance_m);
    root = {q, query.clearance(q, least)};
    if (root.clearance < least) return false;
    if (joint) found_[i] = 1;
    return true;
  }
  return false;
}

bool Roots::reaches(const scene::Goal& goal, const VectorXd& q) {
  if (goal.type == scene::GoalType::joint)
    return (q - goal.q).lpNorm<Eigen::Infinity>() < goal.tolerance_rad;
  dynamics::forward_kinematics(model_, ws_, q);
  const geometry::SE3 tip = dynamics::tip_pose(model_, ws_);
  return (tip.p() - goal.pose.p()).norm() < goal.tolerance_m &&
         (goal.type != scene::GoalType::pose ||
          Eigen::AngleAxisd(goal.pose.R().transpose() * tip.R()).angle() < goal.tolerance_rad);
}

bool Roots::keeps(Query& query, const VectorXd& q) {
  TipConstraints* constraints = query.constraints();
  if (constraints == nullptr || constraints->keeps(q)) return true;
  if (const auto excess = constraints->excess(q); !excess_ || excess.by < excess_->by)
    excess_ = excess;
  return false;
}

bool Roots::attempt(Query& query, Rng& rng, Root& root) {
  if (steps_ > 0) {
    continue_batch();
    return false;
  }
  return next_ < ordered_ ? at_tip(query, root) : at_next_goal(query, rng, root);
}

bool Roots::at_next_goal(Query& query, Rng& rng, Root& root) {
  const std::size_t which = goal_;
  const scene::Goal& goal = problem_->goals[which];
  const bool joint = goal.type == scene::GoalType::joint;
  bool found = false;
  if (joint && found_[which] == 0) {
    found = at_joints(goal, query, rng, root);
    found_[which] = found ? 1 : 0;
  }
  if (!joint) begin_batch(goal, query, rng);
  batch_goal_ = which;
  attempts_ += joint ? 1 : kernel::lanes;
  if (++goal_ == problem_->goals.size()) {
    goal_ = 0;
    ++rounds_;
  }
  return found;
}

bool Roots::at_joints(const scene::Goal& goal, Query& query, Rng& rng, Root& root) {
  root.q = goal.q;
  if (rounds_ > 0)  // the goal itself is not clear, but a place within its tolerance may be
    for (double& x : root.q)
      x += joint_tolerance_share * goal.tolerance_rad * rng.uniform(-1.0, 1.0);
  if (!keeps(query, root.q)) return false;
  root.clearance = query.clearance(root.q, settings_.least_m);
  return root.clearance > 0.0 && root.clearance >= settings_.least_m;
}

// The first posture of all is the start, with the goal itself as its target.
void Roots::begin_batch(const scene::Goal& goal, Query& query, Rng& rng) {
  const dynamics::TipTarget target = tip_target(goal);
  for (int l = 0; l < kernel::lanes; ++l) {
    const bool first = rounds_ == 0 && l == 0;
    dynamics::TipTarget& drawn = targets_[static_cast<std::size_t>(l)];
    drawn = first ? target : draw_near(target, rng);
    box_.draw(rng, sample_);
    if (first) sample_ = problem_->start.cwiseMax(box_.lower).cwiseMin(box_.upper);
    if (query.constraints() != nullptr) restrict(*query.constraints(), drawn);
    q_.col(l) = sample_;
  }
  if (!root_lanes_.fits()) return order_batch(kernel::all_lanes);
  root_lanes_.begin(targets_, q_);
  steps_ = steps_max;
}

// If no root is found, it may be because the goal itself exceeds a constraint.
void Roots::restrict(TipConstraints& constraints, dynamics::TipTarget& target) {
  if (const auto excess = constraints.excess(target); excess.by > 0.0 && !excess_.has_value())
    excess_ = excess;
  constraints.restrict(target, sample_);
}

void Roots::continue_batch() {
  const unsigned near = root_lanes_.advance(steps_at_once);
  checks_ += steps_at_once;
  steps_ -= steps_at_once;
  if (near == kernel::all_lanes) steps_ = 0;
  if (steps_ > 0) return;
  root_lanes_.write(q_);
  order_batch(near);
}

// The postures that came near to their targets, those near the start first.
void Roots::order_batch(unsigned near) {
  next_ = ordered_ = 0;
  std::array<double, kernel::lanes> apart{};
  for (; near != 0; near &= near - 1U) {
    const int l = std::countr_zero(near);
    sample_ = q_.col(l);
    apart[static_cast<std::size_t>(l)] = weighted_distance(weights_, problem_->start, sample_);
    order_[static_cast<std::size_t>(ordered_++)] = l;
  }
  std::sort(order_.begin(), order_.begin() + ordered_, [&](int a, int b) {
    const double x = apart[static_cast<std::size_t>(a)], y = apart[static_cast<std::size_t>(b)];
    return x < y || (x == y && a < b);
  });
}

// Most attempts look for places with all the clearance that is asked for, the last quarter for any
// that a path may end at.
double Roots::least_clearance() const noexcept {
  const int quarter = 4 * (rounds_ - 1) * kernel::lanes / attempts_max;
  if (quarter < 2) return settings_.root_clearance_m;
  return quarter == 2 ? 0.5 * (settings_.root_clearance_m + settings_.least_m) : settings_.least_m;
}

bool Roots::at_tip(Query& query, Root& root) {
  const int lane = order_[static_cast<std::size_t>(next_++)];
  ++checks_;
  sample_ = q_.col(lane);
  if (!kinematics_.solve(targets_[static_cast<std::size_t>(lane)], sample_)) return false;
  if (query.constraints() != nullptr &&
      (!keeps(query, sample_) || !reaches(problem_->goals[batch_goal_], sample_)))
    return false;
  const double least = std::max(1e-6, least_clearance());
  root.q = sample_;
  root.clearance = query.clearance(root.q, least);
  return root.clearance >= least;
}

}  // namespace hamelin::search
