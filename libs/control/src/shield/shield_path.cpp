// A shield's stops along a certified path: docs/theory.md (14.30)–(14.35).
#include <algorithm>
#include <cmath>

#include "shield/shield.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// The largest acceleration with which a deviation may fade [rad/s² or m/s²].
constexpr double fade_acceleration_max = 20.0;
// The same as the straight stop's shortest, in periods.
constexpr double stop_periods = 4.0;
// Of a path, slower ones say nothing of an arm's ρ [rad/s or m/s].
constexpr double least_speed = 0.2;

}  // namespace

void Shield::set_path(const CertifiedPath* path, const Surroundings& world) {
  path_proof_.set(path);
  path_cursor_ = {};
  path_place_ = {};
  path_proof_.see(world.environment, world.time_s);
  if (path != nullptr && path->standing != world.standing)
    path_proof_.forget(world.environment, world.time_s, 0);
}

PathStop::Place Shield::project(const Node& node, const PathStop::Place& near) {
  const PathStop::Place at = path_proof_.path()->motion.project(node.q, node.v, near, path_cursor_,
                                                                path_q_, path_v_, path_a_);
  e_ = node.q - path_q_;
  e_rate_ = node.v - at.rate * path_v_;
  return at;
}

// Of the arm's acceleration, what is along the path counts as braking of ρ if it does not drive it.
double Shield::braking_at(const PathStop::Place& place, const Step& step) {
  if (path_proof_.path()->braking_ramp == 0.0) return 0.0;
  e_acceleration_ = step.acceleration - place.rate * place.rate * path_a_;
  const double square = path_v_.squaredNorm();
  if (!(square > least_speed * least_speed)) return 0.0;
  const double braking = std::max(0.0, -e_acceleration_.dot(path_v_) / square);
  e_acceleration_ += braking * path_v_;
  return braking;
}

// docs/theory.md (14.34): no distance is computed, as the path was proved and the arm is near it.
bool Shield::verify_path(const Step& step) {
  const PathStop::Place from = project(step.from, path_place_);
  way_ = e_.cwiseAbs();
  const double bend = 0.125 * period_s_ * period_s_ * path_a_.lpNorm<Eigen::Infinity>();
  const Index first = path_cursor_.node;
  const PathStop::Place to =
      project(step.to, {from.time_s + period_s_ * from.rate, path_place_.rate});
  const double braking = braking_at(to, step);
  tried_.set_path_stop(*path_proof_.path(), to, {e_, e_rate_, e_acceleration_}, braking,
                       {path_effort_, to.rate / (stop_periods * period_s_)});
  const PathStop& stop = tried_.path_stop();
  refusal_ = {StopCause::torque, {}, -1};
  if (stop.fade_acceleration().maxCoeff() > fade_acceleration_max) return false;
  if (!path_proof_.covers(first, stop.last())) return false;
  straying_.bound(stop);
  // the step itself, between its ends
  way_ = way_.cwiseMax(stop.widest()) - stop.widest() +
         0.25 * period_s_ * (step.to.v - step.departure).cwiseAbs();
  way_.array() += bend;
  straying_.add_tracking(way_);
  return within_tube(straying_.bounds(), first, stop.last());
}

bool Shield::within_tube(const Straying::Bounds& stray, Index first, Index last) {
  const CertifiedPath& path = *path_proof_.path();
  if (!stray.tracking.allFinite()) return false;
  if (path.room.size() > 0)
    for (Index k = first; k <= last; ++k)
      for (Index j = 0; j < stray.tracking.size(); ++j)
        if (stray.tracking[j] + stray.errors[j] > path.room(j, k)) {
          refusal_ = {StopCause::joint_limit, {}, static_cast<int>(j)};
          return false;
        }
  double most = 0.0;
  for (Index s = 0; s < levers_.shapes().rows(); ++s)
    most = std::max(most, levers_.shapes().row(s).dot(stray.tracking) +
                              (stray.shapes.size() > 0 ? stray.shapes[s] : 0.0));
  if (most + margin_m_ < path_proof_.clearance_m(first, last) &&
      (self_ == nullptr ||
       stop_line_.largest_pair_stray({stray.tracking, stray.shapes, stray.errors, margin_m_}) <
           path_proof_.self_m(first, last)))
    return true;
  refusal_ = {StopCause::map, {0, scene::Contact::map, -1, 0.0}, -1};
  return false;
}

}  // namespace hamelin::control
