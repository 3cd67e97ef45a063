#include "shield/mover_check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// Time between the postures at which retreats() compares distances [s], and what they may lose by
// rounding [m].
constexpr double retreat_step_s = 0.0125, retreat_rounding_m = 1e-9;

}  // namespace

MoverCheck::MoverCheck(const model::Model& model, const scene::Levers& levers)
    : model_(model),
      levers_(levers),
      lever_(VectorXd::Zero(model.dof())),
      dq_(VectorXd::Zero(model.dof())),
      nodes_(intervals + 1),
      between_(depth_max),
      places_(std::make_unique_for_overwrite<Place[]>(2 * (nodes_.size() + between_.size()) *
                                                      movers_max)),
      arm_(model),
      distances_(model.shapes().size() * movers_max) {
  movers_.reserve(movers_max);
  Place* next = places_.get();
  for (auto* nodes : {&nodes_, &between_})
    for (Node& node : *nodes) {
      node.q = node.v = node.known_q = VectorXd::Zero(model.dof());
      node.places = std::exchange(next, next + movers_max);
      node.known_places = std::exchange(next, next + movers_max);
    }
  threat_.q = VectorXd::Zero(model.dof());
}

void MoverCheck::forget() noexcept {
  for (Node& node : nodes_) node.known = -1.0;
}

void MoverCheck::set(Node& node, const World& world, const FailSafe& motion, double from_s,
                     double ahead_s) {
  node.ahead_s = ahead_s;
  motion.at(from_s + ahead_s, node.q, node.v);
  const scene::Moment moment(world.now_s, world.lead_s + ahead_s);
  for (std::size_t m = 0; m < world.movers.size(); ++m) {
    const auto k = static_cast<std::size_t>(world.movers[m]);
    const scene::Placed at = scene::placed_at(world.environment.obstacles()[k], moment);
    node.places[m] = {at.pose.R(), at.pose.p(), at.velocity, at.nearer_m};
  }
}

// docs/theory.md (14.26)
double MoverCheck::bound(const Node& node, const World& world) const {
  if (node.known < 0.0) return -far_m;
  double moved = 0.0;
  for (std::size_t m = 0; m < world.movers.size(); ++m) {
    const Place &now = node.places[m], &then = node.known_places[m];
    const double turned = (now.R - then.R).norm();
    moved = std::max(moved, (now.p - then.p).norm() + turned * balls_[m] +
                                std::max(0.0, now.nearer_m - then.nearer_m));
  }
  double travelled = 0.0;
  for (Index j = 0; j < lever_.size(); ++j)
    travelled += lever_[j] * std::abs(node.q[j] - node.known_q[j]);
  return node.known - travelled - moved;
}

void MoverCheck::evaluate(Node& node, const World& world, dynamics::Workspace& ws) {
  ++evaluations_;
  dynamics::forward_kinematics(model_, ws, node.q);
  arm_.place(model_, ws);
  node.distance = far_m;
  for (const int k : world.movers)
    node.distance =
        world.environment.clearance_to(static_cast<std::size_t>(k), arm_.view(),
                                       {world.now_s, world.lead_s + node.ahead_s}, node.distance);
  node.exact = true;
  node.known = node.distance;
  node.known_q = node.q;
  std::copy_n(node.places, world.movers.size(), node.known_places);
  if (node.distance >= worst_) return;
  worst_ = node.distance;
  threat_.ahead_s = node.ahead_s;
  threat_.q = node.q;
}

// docs/theory.md (14.27)
double MoverCheck::between(const Node& a, const Node& b, const World& world) const {
  const double time = b.ahead_s - a.ahead_s;
  double way = 0.0, bend = 0.0, mover = 0.0;
  for (Index j = 0; j < lever_.size(); ++j) {
    way += lever_[j] * std::abs(b.q[j] - a.q[j]);
    bend += lever_[j] * std::abs(b.v[j] - a.v[j]);
  }
  for (std::size_t m = 0; m < world.movers.size(); ++m) {
    const Place &from = a.places[m], &to = b.places[m];
    mover = std::max(mover, 0.5 * ((to.p - from.p).norm() + (to.R - from.R).norm() * balls_[m] +
                                   std::abs(to.nearer_m - from.nearer_m)) +
                                0.25 * time * (to.velocity - from.velocity).norm());
  }
  return 0.5 * (a.distance + b.distance - way) - 0.25 * time * bend - mover;
}

double MoverCheck::examine(const Node& a, const Node& b, int depth, dynamics::Workspace& ws,
                           const World& world, const FailSafe& motion, double from_s,
                           double margin_m) {
  const double whole = between(a, b, world);
  if (whole > margin_m || depth == depth_max || std::min(a.distance, b.distance) <= margin_m)
    return whole;
  Node& middle = between_[static_cast<std::size_t>(depth)];
  set(middle, world, motion, from_s, 0.5 * (a.ahead_s + b.ahead_s));
  evaluate(middle, world, ws);
  const double first = examine(a, middle, depth + 1, ws, world, motion, from_s, margin_m);
  if (first <= margin_m) return first;
  return std::min(first, examine(middle, b, depth + 1, ws, world, motion, from_s, margin_m));
}

MoverCheck::Proof MoverCheck::check(dynamics::Workspace& ws, const World& world,
                                    const FailSafe& motion, double from_s, double for_s,
                                    double margin_m) {
  if (!std::equal(movers_.begin(), movers_.end(), world.movers.begin(), world.movers.end())) {
    movers_.assign(world.movers.begin(), world.movers.end());
    forget();
    for (std::size_t m = 0; m < movers_.size(); ++m)
      balls_[m] = scene::bounding_radius(
          world.environment.obstacles()[static_cast<std::size_t>(movers_[m])]);
  }
  for (Index j = 0; j < lever_.size(); ++j) lever_[j] = levers_.shapes().col(j).maxCoeff();
  worst_ = std::numeric_limits<double>::infinity();
  Proof proof{far_m, 0.0};
  for (int k = 0; k <= intervals; ++k) {
    Node& node = nodes_[static_cast<std::size_t>(k)];
    set(node, world, motion, from_s, std::min(for_s, horizon_s * k / intervals));
    node.distance = bound(node, world);
    node.exact = false;
    if (node.distance <= margin_m) evaluate(node, world, ws);
    proof.least_m = std::min(proof.least_m, node.distance);
    if (proof.least_m <= margin_m) break;
    if (k == 0) continue;
    Node& last = nodes_[static_cast<std::size_t>(k - 1)];
    for (Node* const end : {&last, &node})
      if (!end->exact && between(last, node, world) <= margin_m) evaluate(*end, world, ws);
    proof.least_m =
        std::min(proof.least_m, examine(last, node, 0, ws, world, motion, from_s, margin_m));
    if (proof.least_m <= margin_m) break;
    proof.clear_s = node.ahead_s;
    if (node.ahead_s >= for_s) break;
  }
  return proof;
}

bool MoverCheck::retreats(dynamics::Workspace& ws, const World& world, const FailSafe& motion,
                          double from_s, double for_s, double margin_m) {
  Node& node = between_[0];
  const auto steps = std::max(1L, std::lround(std::ceil(for_s / retreat_step_s)));
  const std::size_t shapes = model_.shapes().size();
  for (long i = 0; i <= steps; ++i) {
    set(node, world, motion, from_s, for_s * static_cast<double>(i) / static_cast<double>(steps));
    dynamics::forward_kinematics(model_, ws, node.q);
    arm_.place(model_, ws);
    for (std::size_t m = 0; m < world.movers.size(); ++m)
      for (std::size_t s = 0; s < shapes; ++s) {
        const auto k = static_cast<std::size_t>(world.movers[m]);
        const double distance =
            world.environment.clearance_to(k, arm_.view().single(s), world.now_s, far_m);
        double& before = distances_[m * shapes + s];
        const bool comes_nearer = i > 0 && distance < before - retreat_rounding_m;
        if (comes_nearer && distance <= node.places[m].nearer_m + margin_m) return false;
        before = distance;
      }
  }
  return true;
}

void MoverCheck::find_threat(dynamics::Workspace& ws, const World& world) {
  dynamics::forward_kinematics(model_, ws, threat_.q);
  arm_.place(model_, ws);
  const scene::Shapes arm = arm_.view();
  double least = std::numeric_limits<double>::infinity();
  threat_.obstacle = threat_.shape = -1;
  for (const int k : world.movers) {
    const scene::Obstacle& obstacle = world.environment.obstacles()[static_cast<std::size_t>(k)];
    const scene::Placed at =
        scene::placed_at(obstacle, {world.now_s, world.lead_s + threat_.ahead_s});
    for (std::size_t s = 0; s < arm.size(); ++s) {
      scene::AxisPoint hit;
      if (arm.is_capsule(s))
        hit = scene::closest_on(obstacle, at.pose, arm.from(s), arm.to(s));
      else
        hit = {scene::closest_on(obstacle, at.pose, arm.centers[s]), arm.centers[s]};
      const double distance = hit.distance - at.nearer_m - arm.radii[s];
      if (distance >= least) continue;
      least = distance;
      threat_.obstacle = k;
      threat_.shape = static_cast<int>(s);
      threat_.point = hit.axis_point;
      threat_.direction = hit.direction;
    }
  }
}

}  // namespace hamelin::control
