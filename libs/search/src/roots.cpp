#include "roots.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "hamelin/core/numbers.hpp"
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

// @param pose one of those that the goal leaves open
dynamics::TipTarget tip_target(const scene::Goal& goal, const geometry::SE3& pose) {
  dynamics::TipTarget out;
  out.position = pose.p();
  out.rotation = pose.R();
  out.turns = goal.type == scene::GoalType::pose;
  out.tolerance_m = goal.tolerance_m;
  if (out.turns) out.tolerance_rad = goal.tolerance_rad;
  return out;
}

geometry::SE3 draw_pose(const scene::Goal& goal, Rng& rng) {
  if (!scene::is_region(goal)) return goal.pose;
  Vector3d at = goal.low_m;
  for (int i = 0; i < 3; ++i)
    if (goal.high_m[i] > at[i]) at[i] = rng.uniform(at[i], goal.high_m[i]);
  Eigen::Matrix3d R = goal.pose.R();
  if (goal.free_axis)
    R = R * Eigen::AngleAxisd(rng.uniform(-std::numbers::pi, std::numbers::pi), *goal.free_axis);
  return {R, goal.pose.p() + goal.pose.R() * at};
}

}  // namespace

std::string why_not(const GoalFigures& goal) {
  if (goal.tried == 0) return "not tried: another was reached before";
  if (goal.reached == 0) return fmt::format("no posture reaches it ({} tried)", goal.tried);
  if (goal.exceeding == goal.reached) return "all postures exceed a constraint of the tip";
  if (goal.clear == 0) return fmt::format("all {} postures are in contact", goal.reached);
  if (goal.blocked == goal.clear)
    return fmt::format("the approaches of {} clear postures are blocked", goal.clear);
  return "another was reached first";
}

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
  rounds_ = next_ = ordered_ = steps_ = 0;
  attempts_ = checks_ = batches_ = 0;
  joint_ = tip_ = 0;
  excess_.reset();
  found_.assign(problem.goals.size(), 0);
  figures_.assign(problem.goals.size(), {});
  order_goals();
}

void Roots::order_goals() {
  const std::vector<scene::Goal>& goals = problem_->goals;
  dynamics::forward_kinematics(model_, ws_, problem_->start);
  start_tip_ = dynamics::tip_pose(model_, ws_);
  joints_.clear();
  tips_.clear();
  std::vector<double> apart(goals.size());
  for (std::size_t i = 0; i < goals.size(); ++i) {
    (goals[i].type == scene::GoalType::joint ? joints_ : tips_).push_back(i);
    apart[i] = (scene::nearest_pose(goals[i], start_tip_).p() - start_tip_.p()).norm();
  }
  const auto turns = [&](std::size_t i) { return goals[i].type == scene::GoalType::pose; };
  std::stable_sort(tips_.begin(), tips_.end(), [&](std::size_t a, std::size_t b) {
    return turns(a) != turns(b) ? turns(a) : apart[a] < apart[b];
  });
  poses_ = static_cast<std::size_t>(std::count_if(tips_.begin(), tips_.end(), turns));
}

bool Roots::tries(std::size_t roots) const noexcept {
  const auto goals = static_cast<long>(problem_->goals.size());
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
    root = {q, query.clearance(q, least), i};
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
  const geometry::SE3 wanted = scene::nearest_pose(goal, tip);
  return (tip.p() - wanted.p()).norm() < goal.tolerance_m &&
         (goal.type != scene::GoalType::pose ||
          Eigen::AngleAxisd(wanted.R().transpose() * tip.R()).angle() < goal.tolerance_rad);
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

// All joint goals have their turn, then a batch of those of the tip.
bool Roots::at_next_goal(Query& query, Rng& rng, Root& root) {
  bool found = false;
  if (joint_ < joints_.size()) {
    found = found_[joints_[joint_]] == 0 && at_joints(query, rng, root);
    ++attempts_;
    ++joint_;
  } else if (!tips_.empty()) {
    begin_batch(query, rng);
    attempts_ += kernel::lanes;
  }
  if (joint_ == joints_.size() && (tips_.empty() || in_batch())) {
    joint_ = 0;
    ++rounds_;
  }
  return found;
}

bool Roots::at_joints(Query& query, Rng& rng, Root& root) {
  root.goal = joints_[joint_];
  const scene::Goal& goal = problem_->goals[root.goal];
  GoalFigures& figures = figures_[root.goal];
  root.q = goal.q;
  if (rounds_ > 0)  // the goal itself is not clear, but a place within its tolerance may be
    for (double& x : root.q)
      x += joint_tolerance_share * goal.tolerance_rad * rng.uniform(-1.0, 1.0);
  ++figures.tried;
  ++figures.reached;
  if (!keeps(query, root.q)) {
    ++figures.exceeding;
    return false;
  }
  root.clearance = query.clearance(root.q, settings_.least_m);
  const bool clear = root.clearance > 0.0 && root.clearance >= settings_.least_m;
  found_[root.goal] = clear ? 1 : 0;
  figures.clear += clear ? 1 : 0;
  return clear;
}

// The lanes of a batch take turns at goals of one kind.
void Roots::choose_goals() {
  const bool turns = tip_ < poses_;
  const std::size_t first = turns ? 0 : poses_, end = turns ? poses_ : tips_.size();
  for (std::size_t& goal : lane_goals_) {
    goal = tips_[tip_];
    if (++tip_ == end) tip_ = first;
  }
  const bool both = poses_ > 0 && poses_ < tips_.size();
  if (both) tip_ = turns ? poses_ : 0;
}

// The first posture of each goal is the start, with the place of the goal that is nearest to it as
// its target.
void Roots::begin_batch(Query& query, Rng& rng) {
  choose_goals();
  ++batches_;
  for (int l = 0; l < kernel::lanes; ++l) {
    const auto lane = static_cast<std::size_t>(l);
    const scene::Goal& goal = problem_->goals[lane_goals_[lane]];
    const bool first = figures_[lane_goals_[lane]].tried++ == 0;
    dynamics::TipTarget& drawn = targets_[lane];
    drawn = first ? tip_target(goal, scene::nearest_pose(goal, start_tip_))
                  : draw_near(tip_target(goal, draw_pose(goal, rng)), rng);
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
// that a path may end at. Where there are many goals, fewer attempts are made at each.
double Roots::least_clearance() const noexcept {
  const double before = static_cast<double>((batches_ - 1) * kernel::lanes),
               all = attempts_max * std::sqrt(static_cast<double>(tips_.size()));
  const long quarter = static_cast<long>(4.0 * before / all);
  if (quarter < 2) return settings_.root_clearance_m;
  return quarter == 2 ? 0.5 * (settings_.root_clearance_m + settings_.least_m) : settings_.least_m;
}

bool Roots::at_tip(Query& query, Root& root) {
  const int lane = order_[static_cast<std::size_t>(next_++)];
  root.goal = lane_goals_[static_cast<std::size_t>(lane)];
  GoalFigures& figures = figures_[root.goal];
  ++checks_;
  sample_ = q_.col(lane);
  if (!kinematics_.solve(targets_[static_cast<std::size_t>(lane)], sample_)) return false;
  if (query.constraints() != nullptr && !reaches(problem_->goals[root.goal], sample_)) return false;
  ++figures.reached;
  if (!keeps(query, sample_)) {
    ++figures.exceeding;
    return false;
  }
  const double least = std::max(1e-6, least_clearance());
  root.q = sample_;
  root.clearance = query.clearance(root.q, least);
  const bool clear = root.clearance >= least;
  figures.clear += clear ? 1 : 0;
  return clear;
}

}  // namespace hamelin::search
