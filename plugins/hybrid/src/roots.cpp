#include "roots.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace hamelin::hybrid {

namespace {

// Tip goals: Newton-like steps along the law's attraction.
constexpr int attempts = 60, iterations = 40;
constexpr double newton_step = 0.25;
constexpr double tolerance_share = 0.6;  // of the goal's tolerances, kept by roots
// Smallest distances of a root from obstacles and between parts of the arm [m].
constexpr double clear_m = 0.003, clear_self_m = 0.001;
// Paths: step of the search, and offsets of the roots behind the exit of the blocked stretch [rad
// or m].
constexpr double path_step = 0.02;
constexpr std::array<double, 3> exit_offsets = {0.1, 0.4, 0.9};

}  // namespace

JointBox::JointBox(const planning::Setup& setup, const Eigen::VectorXd& joint_weights)
    : lower(setup.dof()), upper(setup.dof()), weights(joint_weights) {
  const auto low = setup.q_lower(), high = setup.q_upper();
  for (int i = 0; i < setup.dof(); ++i) {
    lower[i] = low && std::isfinite((*low)[i]) ? (*low)[i] : -std::numbers::pi;
    upper[i] = high && std::isfinite((*high)[i]) ? (*high)[i] : std::numbers::pi;
  }
}

void JointBox::draw(Rng& rng, Eigen::VectorXd& q) const {
  for (Eigen::Index i = 0; i < q.size(); ++i) q[i] = rng.uniform(lower[i], upper[i]);
}

void JointBox::draw_near(Rng& rng, const Eigen::VectorXd& center, double radius,
                         Eigen::VectorXd& q) const {
  for (Eigen::Index i = 0; i < q.size(); ++i) q[i] = rng.normal() * weights[i];
  q *= radius / std::max(1e-9, q.norm());
  q = (center + q).cwiseMax(lower).cwiseMin(upper);
}

Roots::Roots(const planning::Setup& setup, const model::Model& model, const LawParams& law,
             const JointBox& box, Surroundings& surroundings)
    : model_(model),
      box_(box),
      surroundings_(surroundings),
      ws_(model),
      law_(setup, model, law),
      start_(setup.dof()),
      x_(setup.dof()),
      u_(setup.dof()),
      q_(setup.dof(), max_count) {
  arc_lengths_.reserve(max_count);
}

void Roots::begin(const hamelin_goal& goal, const Eigen::VectorXd& q, const JointPath* path,
                  double from) {
  goal_ = &goal;
  path_ = path;
  start_ = q;
  count_ = attempt_ = iteration_ = 0;
  arc_lengths_.clear();
  found_block_ = done_ = false;
  s_ = from;
  x_ = q;
  if (path_ == nullptr && goal.type == HAMELIN_GOAL_JOINT) {
    add(planning::ConstVectorMap(goal.q, q.size()), 0.0);
    done_ = true;
  }
}

void Roots::add(const Eigen::Ref<const Eigen::VectorXd>& q, double arc_length) {
  if (count_ == max_count) return;
  q_.col(count_++) = q;
  arc_lengths_.push_back(arc_length);
}

int Roots::advance(int units, Rng& rng) {
  int used = 0;
  for (; used < units && !done_; ++used) {
    if (path_ != nullptr)
      search_path();
    else
      solve_tip(rng);
  }
  return used;
}

void Roots::solve_tip(Rng& rng) {
  dynamics::forward_kinematics(model_, ws_, x_);
  const bool reached = law_.within(model_, ws_, x_, *goal_, tolerance_share);
  if (!reached && iteration_++ < iterations) {
    law_.attract(model_, ws_, x_, {goal_, nullptr}, u_);
    x_ = (x_ + newton_step * u_).cwiseMax(box_.lower).cwiseMin(box_.upper);
    return;
  }
  if (reached && surroundings_.is_clear(x_, clear_m, clear_self_m)) add(x_, 0.0);
  iteration_ = 0;
  if (++attempt_ == attempts || count_ == max_count) return finish();
  box_.draw(rng, x_);
}

// Finds the next blocked stretch of the path, its exit, and the roots behind it.
void Roots::search_path() {
  path_->at(s_, x_);
  const bool last = s_ >= path_->length();
  if (last) {
    add(x_, s_);  // the goal is a root even without clearance
    done_ = true;
    return;
  }
  if (!surroundings_.is_clear(x_, clear_m, clear_self_m)) {
    found_block_ = true;
    if (count_ == 0) exit_ = s_;
  } else if (found_block_) {
    const auto known = static_cast<std::size_t>(count_);
    if (known < exit_offsets.size() && s_ >= exit_ + exit_offsets[known]) add(x_, s_);
  }
  // The end of the path is always a root; after the other roots the search continues there.
  if (count_ == static_cast<int>(exit_offsets.size())) s_ = path_->length();
  s_ = std::min(s_ + path_step, path_->length());
}

void Roots::finish() {
  // Insertion sort, nearest first.
  for (int i = 1; i < count_; ++i)
    for (int j = i;
         j > 0 && (q_.col(j) - start_).squaredNorm() < (q_.col(j - 1) - start_).squaredNorm(); --j)
      q_.col(j).swap(q_.col(j - 1));
  done_ = true;
}

}  // namespace hamelin::hybrid
