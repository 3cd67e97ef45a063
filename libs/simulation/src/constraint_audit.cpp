#include "constraint_audit.hpp"

#include <fmt/format.h>

#include "hamelin/core/numbers.hpp"

namespace hamelin::simulation {

namespace {

void raise(log::Result::Constraint& figure, double excess, double time_s) {
  if (!(excess > figure.excess)) return;
  figure.excess = excess;
  figure.time_s = time_s;
}

}  // namespace

ConstraintAudit::ConstraintAudit(const scene::Scene& scene, const model::Model& model)
    : scene_(scene), model_(model) {
  for (const scene::Goal& goal : scene.goals) {
    Goal& out = goals_.emplace_back();
    if (goal.constraints.empty()) continue;
    out.speed_max_m_s = scene::speed_max_m_s(goal.constraints);
    for (const scene::TipConstraint& constraint : goal.constraints)
      out.figures.push_back({goals_.size(), out.figures.size() + 1,
                             std::string(scene::type_name(constraint)), -infinity, 0.0});
  }
  take_load();
}

void ConstraintAudit::take_load() {
  for (std::size_t i = 0; i < goals_.size(); ++i)
    if (const auto& constraints = scene_.goals[i].constraints; !constraints.empty())
      goals_[i].kept = std::make_unique<search::TipConstraints>(model_, constraints);
}

// A motion between two nodes is taken to be straight in joint space.
void ConstraintAudit::observe(const Eigen::VectorXd& q, double time_s) {
  if (goal_ < goals_.size() && goals_[goal_].kept) {
    Goal& goal = goals_[goal_];
    const bool moved = goal.seen && time_s > last_s_;
    by_.resize(goal.kept->size());
    goal.kept->measure(moved ? last_ : q, q, by_);
    goal.seen = true;
    for (std::size_t k = 0; k < by_.size(); ++k)
      raise(goal.figures[goal.kept->number(k) - 1], by_[k], time_s);
    for (log::Result::Constraint& figure : goal.figures)
      if (figure.type == "speed" && moved)
        raise(figure, goal.kept->largest_way(last_, q) / (time_s - last_s_) - goal.speed_max_m_s,
              time_s);
  }
  last_ = q;
  last_s_ = time_s;
}

std::vector<log::Result::Constraint> ConstraintAudit::figures() const {
  std::vector<log::Result::Constraint> out;
  for (const Goal& goal : goals_)
    if (goal.seen) out.insert(out.end(), goal.figures.begin(), goal.figures.end());
  return out;
}

std::vector<std::string> ConstraintAudit::violations() const {
  std::vector<std::string> out;
  for (const log::Result::Constraint& each : figures())
    if (each.excess > 0.0)
      out.push_back(fmt::format("goal {}: constraint {} ({}) was exceeded by {:.3g} {} at {:.6g} s",
                                each.goal, each.constraint, each.type, each.excess,
                                scene::unit_of(each.type), each.time_s));
  return out;
}

}  // namespace hamelin::simulation
