#include "roots.hpp"

#include <Eigen/Geometry>
#include <algorithm>

namespace hamelin::search {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// Of each goal: attempts in all, attempts where nothing was found yet, and roots.
constexpr int attempts_max = 60, attempts_for_one = 600;
constexpr std::size_t roots_max = 6;
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

Roots::Roots(const model::Model& model, const dynamics::JointBox& box, const Settings& settings)
    : box_(box), settings_(settings), kinematics_(model, box), q_(VectorXd::Zero(model.dof())) {}

void Roots::begin(const Problem& problem) {
  problem_ = &problem;
  attempt_ = 0;
  q_ = problem.start;
  found_.assign(problem.goals.size(), 0);
}

bool Roots::tries(std::size_t roots) const noexcept {
  const auto goals = static_cast<int>(problem_->goals.size());
  if (std::all_of(found_.begin(), found_.end(), [](char found) { return found != 0; }))
    return false;
  return roots < roots_max * problem_->goals.size() &&
         attempt_ < goals * (roots == 0 ? attempts_for_one : attempts_max);
}

bool Roots::attempt(Query& query, Rng& rng, Root& root) {
  const std::size_t goals = problem_->goals.size();
  const auto which = static_cast<std::size_t>(attempt_) % goals;
  const int attempt = attempt_++ / static_cast<int>(goals);
  if (found_[which] != 0) return false;
  const scene::Goal& goal = problem_->goals[which];
  if (goal.type != scene::GoalType::joint) return at_tip(goal, attempt, query, rng, root);
  found_[which] = at_joints(goal, attempt, query, rng, root) ? 1 : 0;
  return found_[which] != 0;
}

bool Roots::at_joints(const scene::Goal& goal, int attempt, Query& query, Rng& rng,
                      Root& root) const {
  root.q = goal.q;
  if (attempt > 0)  // the goal itself is not clear, but a place within its tolerance may be
    for (double& x : root.q)
      x += joint_tolerance_share * goal.tolerance_rad * rng.uniform(-1.0, 1.0);
  root.clearance = query.clearance(root.q, settings_.least_m);
  return root.clearance > 0.0 && root.clearance >= settings_.least_m;
}

// Most attempts look for places with all the clearance that is asked for, the last quarter for any
// that a path may end at.
double Roots::clearance_of_attempt(int attempt) const noexcept {
  const int quarter = 4 * attempt / attempts_max;
  if (quarter < 2) return settings_.root_clearance_m;
  return quarter == 2 ? 0.5 * (settings_.root_clearance_m + settings_.least_m) : settings_.least_m;
}

bool Roots::at_tip(const scene::Goal& goal, int attempt, Query& query, Rng& rng, Root& root) {
  const dynamics::TipTarget target = tip_target(goal);
  const bool reaches = kinematics_.solve(attempt > 0 ? draw_near(target, rng) : target, q_);
  if (reaches) {
    const double least = std::max(1e-6, clearance_of_attempt(attempt));
    root.q = q_;
    root.clearance = query.clearance(q_, least);
    box_.draw(rng, q_);
    return root.clearance >= least;
  }
  box_.draw(rng, q_);
  return false;
}

}  // namespace hamelin::search
