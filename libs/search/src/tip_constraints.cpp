#include "hamelin/search/tip_constraints.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <utility>

#include "hamelin/core/numbers.hpp"
#include "tip_rule.hpp"

namespace hamelin::search {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

constexpr double rounding = 1e-12;
constexpr int iterations_max = 30;
constexpr double damping = 1e-5;      // added to J Jᵀ [m²]
constexpr double largest_step = 0.3;  // of any joint [rad or m]
constexpr Index rows_per_rule = 6;

}  // namespace

TipConstraints::TipConstraints(const model::Model& model,
                               const std::vector<scene::TipConstraint>& constraints)
    : model_(model), levers_(model, nullptr), ws_(model), J_(6, model.dof()) {
  for (auto* x : {&start_, &dq_, &q_, &curvature_, &step_}) x->setZero(model.dof());
  for (std::size_t i = 0; i < constraints.size(); ++i) {
    scene::check(constraints[i], fmt::format("constraint {}", i + 1));
    if (const auto* axis = std::get_if<scene::AxisConstraint>(&constraints[i]))
      add(axis_rule(*axis), i + 1);
    if (const auto* box = std::get_if<scene::BoxConstraint>(&constraints[i]))
      add(box_rule(*box), i + 1);
  }
}

TipConstraints::~TipConstraints() = default;

void TipConstraints::add(const TipCurve& curve, const scene::WayTolerance& tolerance,
                         const std::optional<Ball>& within) {
  add(curve_rule(curve, tolerance, within), rules_.size() + 1);
}

void TipConstraints::add(std::unique_ptr<TipRule> rule, std::size_t number) {
  rules_.push_back(std::move(rule));
  numbers_.push_back(number);
  from_.resize(rules_.size());
  to_ = from_;
  middle_.fill(from_);
  rows_.setZero(rows_per_rule * static_cast<Index>(rules_.size()), model_.dof());
  error_.setZero(rows_.rows());
}

void TipConstraints::place(const VectorXd& q, Values& out) {
  dynamics::forward_kinematics(model_, ws_, q);
  tip_ = dynamics::tip_pose(model_, ws_);
  ++checks_;
  for (std::size_t k = 0; k < rules_.size(); ++k) out[k] = rules_[k]->value(tip_);
}

// docs/theory.md (21.1)
void TipConstraints::measure(const VectorXd& a, const VectorXd& b, std::vector<double>& by) {
  set_motion(a, b, VectorXd::Zero(a.size()));
  place(a, from_);
  place(b, to_);
  for (std::size_t k = 0; k < rules_.size(); ++k)
    by[k] = rules_[k]->excess(from_[k], to_[k], {bend_rad_, bend_m_});
}

double TipConstraints::largest_way(const VectorXd& a, const VectorXd& b) {
  set_motion(a, b, VectorXd::Zero(a.size()));
  place(a, from_);
  const Eigen::Vector3d p = tip_.p();
  place(b, from_);
  return (tip_.p() - p).norm() + 4.0 * bend_m_;  // the mean, and half of what it changes by
}

TipConstraints::Excess TipConstraints::excess(const VectorXd& q) {
  place(q, from_);
  Excess worst{0, -infinity};
  for (std::size_t k = 0; k < rules_.size(); ++k)
    if (const double by = rules_[k]->excess(from_[k]); by > worst.by) worst = {k, by};
  return worst;
}

TipConstraints::Excess TipConstraints::excess(const dynamics::TipTarget& target) const {
  Excess worst{0, -infinity};
  for (std::size_t k = 0; k < rules_.size(); ++k) {
    if (rules_[k]->turns() && !target.turns) continue;
    const double by = rules_[k]->excess(rules_[k]->value({target.rotation, target.position}));
    if (by > worst.by) worst = {k, by};
  }
  return worst;
}

std::string TipConstraints::describe(const Excess& excess) const {
  const TipRule& rule = *rules_[excess.constraint];
  return fmt::format("constraint {} ({}) is exceeded by {:.3g} {}", numbers_[excess.constraint],
                     rule.name(), excess.by, scene::unit_of(rule.name()));
}

void TipConstraints::admit(const VectorXd& q) {
  place(q, from_);
  for (std::size_t k = 0; k < rules_.size(); ++k) rules_[k]->admit(from_[k]);
}

double TipConstraints::turn_of(const VectorXd& deviation) const {
  double out = 0.0;
  for (Index j = 0; j <= model_.robot().tip.link; ++j)
    if (!levers_.slides(j)) out += deviation[j];
  return out;
}

double TipConstraints::reserve_used(const VectorXd& deviation) const {
  const TipStray used{turn_of(deviation), levers_.tip().dot(deviation)};
  double most = 0.0;
  for (const auto& rule : rules_) most = std::max(most, rule->reserve_used(used));
  return most;
}

bool TipConstraints::keeps(const VectorXd& q) {
  stray_rad_ = stray_m_ = 0.0;
  place(q, from_);
  return plans_keep(from_, from_, 0.0);
}

bool TipConstraints::motion_keeps(const VectorXd& a, const VectorXd& b, const VectorXd& stray) {
  set_motion(a, b, stray);
  place(b, to_);
  if (!plans_keep(to_, to_, 0.0)) return false;
  place(a, from_);
  return piece_keeps(0.0, 1.0, from_, to_, 0);
}

void TipConstraints::set_motion(const VectorXd& a, const VectorXd& b, const VectorXd& stray) {
  start_ = a;
  dq_ = b - a;
  q_ = stray;
  levers_.extend_travel(a, q_);
  levers_.extend_travel(b, q_);
  levers_.curvature(dq_, curvature_);
  bend_rad_ = 0.125 * turn_of(curvature_);
  bend_m_ = 0.125 * levers_.tip().dot(curvature_);
  stray_rad_ = turn_of(stray);
  stray_m_ = levers_.tip().dot(stray);
}

// docs/theory.md (21.1): values stray from the segment between those of the ends.
bool TipConstraints::plans_keep(const Values& a, const Values& b, double width) const {
  const double share = width * width;
  const TipStray stray{stray_rad_ + share * bend_rad_ + rounding,
                       stray_m_ + share * bend_m_ + rounding};
  for (std::size_t k = 0; k < rules_.size(); ++k)
    if (!rules_[k]->plan_keeps(a[k], b[k], stray)) return false;
  return true;
}

bool TipConstraints::piece_keeps(double from, double to, const Values& a, const Values& b,
                                 int depth) {
  if (plans_keep(a, b, to - from)) return true;
  if (depth == depth_max) return false;
  Values& middle = middle_[static_cast<std::size_t>(depth)];
  const double half = 0.5 * (from + to);
  q_ = start_ + half * dq_;
  place(q_, middle);
  return plans_keep(middle, middle, 0.0) && piece_keeps(from, half, a, middle, depth + 1) &&
         piece_keeps(half, to, middle, b, depth + 1);
}

// docs/theory.md (21.3)
bool TipConstraints::project(VectorXd& q, const dynamics::JointBox& box) {
  if (keeps(q)) return true;
  for (int k = 0; k < iterations_max; ++k) {
    place(q, from_);
    dynamics::frame_jacobian(model_, ws_, model_.robot().tip.link, tip_.p(), J_);
    Index count = 0;
    for (const auto& rule : rules_) rule->add_rows(tip_, J_, rows_, error_, count);
    if (count == 0) break;
    const auto rows = rows_.topRows(count);
    Eigen::MatrixXd G = rows * rows.transpose();
    G.diagonal().array() += damping;
    step_.noalias() = rows.transpose() * G.llt().solve(error_.head(count)).eval();
    const double largest = step_.lpNorm<Eigen::Infinity>();
    if (largest > largest_step) step_ *= largest_step / largest;
    q = (q + step_).cwiseMax(box.lower).cwiseMin(box.upper);
    if (largest < 1e-4) break;
  }
  return keeps(q);
}

void TipConstraints::restrict(dynamics::TipTarget& target, const VectorXd& seed) {
  const bool turns =
      std::any_of(rules_.begin(), rules_.end(), [](const auto& rule) { return rule->turns(); });
  if (turns && !target.turns) {
    place(seed, from_);
    target.rotation = tip_.R();
    target.turns = true;
    target.tolerance_rad = infinity;
  }
  for (const auto& rule : rules_) rule->restrict(target);
}

}  // namespace hamelin::search
