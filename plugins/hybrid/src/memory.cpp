#include "memory.hpp"

#include <algorithm>

namespace hamelin::hybrid {

namespace {

constexpr double memory_global_share = 0.2;  // share of candidates from all of joint space

}  // namespace

EscapeMemory::EscapeMemory(const planning::Setup& setup, const JointBox& box, int max_escapes)
    : box_(box),
      seed_(setup.seed()),
      rng_(seed_),
      via_(Eigen::VectorXd::Zero(setup.dof())),
      draw_(setup.dof()),
      drawn_(setup.dof(), candidates),
      scores_(candidates),
      visited_(setup.dof(), 2 * max_escapes + 2) {}

void EscapeMemory::remember(const Eigen::VectorXd& q) {
  visited_.col(visited_count_ % visited_.cols()) = q;
  ++visited_count_;
}

void EscapeMemory::draw_all(const Eigen::VectorXd& q) {
  ++count_;
  remember(q);
  const double radius = std::min(2.5, 0.4 + 0.2 * count_);
  const auto known = std::min<Eigen::Index>(visited_count_, visited_.cols());
  for (Eigen::Index c = 0; c < candidates; ++c) {
    if (rng_.uniform() < memory_global_share)
      box_.draw(rng_, draw_);
    else
      box_.draw_near(rng_, q, radius * rng_.uniform(0.5, 1.0), draw_);
    drawn_.col(c) = draw_;
    double nearest = 1.5;
    for (Eigen::Index k = 0; k < known; ++k)
      nearest = std::min(nearest, (visited_.col(k) - drawn_.col(c)).norm());
    scores_[c] = nearest;
  }
}

}  // namespace hamelin::hybrid
