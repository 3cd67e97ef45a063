#include "shield/path_proof.hpp"

#include <algorithm>

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

constexpr Index intervals_max = 4096;
// The shares of a margin that are asked for, one after the other.
constexpr double less = 0.5, least_share = 0.2;

}  // namespace

PathProof::PathProof(const model::Model& model, const scene::Levers& levers,
                     const scene::SelfField* self)
    : levers_(levers), edges_(model, self), kept_(VectorXd::Ones(intervals_max)) {
  for (auto* x : {&q0_, &q1_, &bend_}) x->setZero(model.dof());
}

void PathProof::set(const CertifiedPath* path) {
  path_ = path != nullptr && path->clearance_m.size() <= intervals_max ? path : nullptr;
  first_ = 0;
  end_ = path_ != nullptr ? path_->clearance_m.size() : 0;
  again_ = blocked_ = false;
  kept_.setOnes();
}

void PathProof::see(const scene::Environment& environment, double time_s) {
  edges_.set_environment(environment, time_s, false);
}

void PathProof::forget(const scene::Environment& environment, double time_s, Index first) {
  see(environment, time_s);
  first_ = end_ = first;
  again_ = path_ != nullptr;
  blocked_ = false;
  share_ = 1.0;
}

// docs/theory.md (14.35): an interval is proved by its chord, with what the curve strays from it.
bool PathProof::prove() {
  path_->motion.chord(end_, q0_, q1_, bend_);
  const double stray = levers_.reach(bend_);
  edges_.set_self_most(share_ * path_->self_m[end_] + stray);
  return edges_.motion_clear(q0_, q1_, share_ * path_->clearance_m[end_] + stray);
}

void PathProof::advance(long checks) {
  const long until = edges_.checks() + checks;
  while (again_ && !blocked_ && end_ < path_->clearance_m.size() && edges_.checks() < until) {
    if (prove()) {
      kept_[end_++] = share_;
      share_ = 1.0;
    } else {
      blocked_ = (share_ *= less) < least_share;
    }
  }
}

double PathProof::clearance_m(Index first, Index last) const {
  double least = path_->clearance_m[first] * kept_[first];
  for (Index k = first + 1; k <= last; ++k)
    least = std::min(least, path_->clearance_m[k] * kept_[k]);
  return least;
}

double PathProof::self_m(Index first, Index last) const {
  double least = path_->self_m[first] * kept_[first];
  for (Index k = first + 1; k <= last; ++k) least = std::min(least, path_->self_m[k] * kept_[k]);
  return least;
}

}  // namespace hamelin::control
