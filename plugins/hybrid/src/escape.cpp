#include "escape.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace hamelin::hybrid {

Escape::Escape(const planning::Setup& setup, const Eigen::VectorXd& weights, int max_escapes)
    : rng_(setup.seed()),
      lower_(setup.dof()),
      upper_(setup.dof()),
      weights_(weights),
      via_(Eigen::VectorXd::Zero(setup.dof())),
      drawn_(setup.dof(), candidates),
      scores_(candidates),
      crumb_(setup.dof(), 2 * max_escapes + 2) {
  const auto lower = setup.q_lower(), upper = setup.q_upper();
  for (int i = 0; i < setup.dof(); ++i) {
    // joints without limits are searched over a turn
    lower_[i] = lower && std::isfinite((*lower)[i]) ? (*lower)[i] : -std::numbers::pi;
    upper_[i] = upper && std::isfinite((*upper)[i]) ? (*upper)[i] : std::numbers::pi;
  }
}

void Escape::draw(const Eigen::VectorXd& q, double radius, Eigen::Ref<Eigen::VectorXd> out) {
  if (rng_.uniform() < 0.2) {
    for (Eigen::Index i = 0; i < out.size(); ++i) out[i] = rng_.uniform(lower_[i], upper_[i]);
    return;
  }
  for (Eigen::Index i = 0; i < out.size(); ++i) out[i] = rng_.normal() * weights_[i];
  out *= radius * rng_.uniform(0.5, 1.0) / std::max(1e-9, out.norm());
  out = (q + out).cwiseMax(lower_).cwiseMin(upper_);
}

void Escape::remember(const Eigen::VectorXd& q) {
  crumb_.col(crumbs_ % crumb_.cols()) = q;
  ++crumbs_;
}

void Escape::draw_all(const Eigen::VectorXd& q, const double* goal) {
  ++count_;
  remember(q);
  const double radius = std::min(2.5, 0.4 + 0.2 * count_);
  const auto known = std::min<Eigen::Index>(crumbs_, crumb_.cols());
  for (Eigen::Index c = 0; c < candidates; ++c) {
    draw(q, radius, drawn_.col(c));
    double nearest = 1.5;
    for (Eigen::Index k = 0; k < known; ++k) nearest = std::min(nearest, (crumb_.col(k) - drawn_.col(c)).norm());
    const double off = goal == nullptr ? 0.0 : (planning::ConstVectorMap(goal, q.size()) - drawn_.col(c)).norm();
    scores_[c] = nearest - 0.5 * off;
  }
}

}  // namespace hamelin::hybrid
