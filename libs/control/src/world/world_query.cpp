#include "world/world_query.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "loop/to_c.hpp"

namespace hamelin::control {

using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// The largest path of any point of the arm on a piece of a motion, as a share of the influence:
// longer pieces would be bisected for each shape apart.
constexpr double piece_share = 0.5, piece_min_m = 0.01;
constexpr double motion_pieces_max = 4096.0;

}  // namespace

WorldQuery::WorldQuery(const model::Model& model, const World& world, const WorldView& view)
    : model_(model),
      world_(world),
      self_(view.self_field()),
      influence_(view.influence_m()),
      self_influence_(view.self_influence_m()),
      snapshot_(world.latest()),
      scratch_(snapshot_->environment, 0),
      certificate_(model, influence_, self_, self_influence_, world.obstacles_max()),
      ws_(model),
      arm_(model),
      from_(model),
      to_(model),
      contacts_(world.contacts_max()),
      self_contacts_(view.self_contacts_max()) {
  q_ = dq_ = rest_ = VectorXd::Zero(model.dof());
  for (Node* node : {&from_, &to_}) {
    node->q = q_;
    node->clearance.resize(model.shapes().size());
    if (self_ != nullptr) node->pairs.resize(self_->pairs().size());
  }
}

std::uint64_t WorldQuery::refresh(std::uint64_t allowance) {
  auto newest = world_.latest(allowance);
  scratch_ = scene::Environment::Scratch(newest->environment,
                                         std::max<std::size_t>(1, model_.shapes().size()));
  snapshot_ = std::move(newest);
  return snapshot_->number;
}

scene::Shapes WorldQuery::place(const double* q) {
  q_ = Eigen::Map<const VectorXd>(q, q_.size());
  dynamics::forward_kinematics(model_, ws_, q_);
  arm_.place(model_, ws_);
  return arm_.view();
}

double WorldQuery::clearance(const double* q, const scene::Moment& moment, double at_least_m) {
  const scene::Shapes arm = place(q);
  double smallest = influence_;
  for (std::size_t s = 0; s < arm.size() && smallest >= at_least_m; ++s)
    smallest = snapshot_->environment.clearance(arm.single(s), moment, smallest);
  if (self_ == nullptr) return smallest;
  for (std::size_t pair = 0; pair < self_->pairs().size() && smallest >= at_least_m; ++pair) {
    const double limit = std::min(smallest, self_influence_);
    if (const double distance = self_->distance(pair, arm, limit); distance < limit)
      smallest = distance;
  }
  return smallest;
}

std::size_t WorldQuery::contacts(const double* q, const scene::Moment& moment, double influence_m,
                                 const planning::ArrayOut<hamelin_contact>& out) {
  const auto into = std::span(contacts_).first(std::min(contacts_.size(), out.size()));
  const std::size_t found = snapshot_->environment.closest(
      place(q), std::min(influence_m, influence_), moment, scratch_, into);
  for (std::size_t i = 0; i < std::min(found, into.size()); ++i) {
    const int obstacle = into[i].obstacle;
    out.set(i, to_c(into[i], obstacle < 0
                                 ? obstacle
                                 : snapshot_->obstacle_ids[static_cast<std::size_t>(obstacle)]));
  }
  return found;
}

std::size_t WorldQuery::self_contacts(const double* q, double influence_m,
                                      const planning::ArrayOut<hamelin_self_contact>& out) {
  if (self_ == nullptr) return 0;
  const auto into = std::span(self_contacts_).first(std::min(self_contacts_.size(), out.size()));
  const std::size_t found = self_->closest(place(q), std::min(influence_m, self_influence_), into);
  for (std::size_t i = 0; i < std::min(found, into.size()); ++i) out.set(i, to_c(into[i]));
  return found;
}

bool WorldQuery::measure(Node& node) {
  dynamics::forward_kinematics(model_, ws_, node.q);
  node.arm.place(model_, ws_);
  const scene::Shapes arm = node.arm.view();
  bool clear = true;
  for (std::size_t s = 0; s < arm.size() && clear; ++s) {
    node.clearance[s] = snapshot_->environment.clearance(arm.single(s), node.moment, influence_);
    clear = node.clearance[s] > 0.0;
  }
  for (std::size_t pair = 0; pair < node.pairs.size() && clear; ++pair) {
    node.pairs[pair] = self_->distance(pair, arm, self_influence_);
    clear = node.pairs[pair] > 0.0;
  }
  return clear;
}

Certificate::Node WorldQuery::end_of(const Node& node) const {
  // The motion keeps to the line: with equal velocities at both ends nothing deviates from it.
  return {node.q,
          rest_,
          node.moment,
          node.arm.view(),
          snapshot_->environment.has_obstacles() ? std::span<const double>(node.clearance)
                                                 : std::span<const double>(),
          node.pairs};
}

bool WorldQuery::motion_clear(const double* q0, const double* q1, double now_s, double t0_s,
                              double t1_s, double& margin_m) {
  from_.q = Eigen::Map<const VectorXd>(q0, q_.size());
  q_ = Eigen::Map<const VectorXd>(q1, q_.size());
  dq_ = q_ - from_.q;
  from_.moment = {now_s, t0_s};
  to_.q = q_;
  to_.moment = {now_s, t1_s};
  if (!measure(to_) || !measure(from_)) return false;  // most motions that fail end in contact
  const double piece_m = std::max(piece_min_m, piece_share * influence_);
  const double pieces =
      std::clamp(std::ceil(certificate_.longest_path(dq_) / piece_m), 1.0, motion_pieces_max);
  margin_m = influence_;
  for (double i = 1.0; i <= pieces; ++i) {
    const double left = 1.0 - i / pieces;
    to_.q = q_ - left * dq_;
    to_.moment.ahead_s = t1_s - left * (t1_s - t0_s);
    if (!measure(to_)) return false;
    const auto verdict =
        certificate_.check(ws_, snapshot_->environment, end_of(from_), end_of(to_));
    if (!verdict.certified) return false;
    margin_m = std::min(margin_m, verdict.margin_m);
    std::swap(from_, to_);
  }
  return true;
}

double WorldQuery::distance(const Vector3d& point, const scene::Moment& moment, double limit_m,
                            Vector3d& gradient) {
  const std::array<double, 1> radius{0.0};
  scene::Contact nearest;
  gradient.setZero();
  if (snapshot_->environment.closest({{&point, 1}, radius}, limit_m, moment, scratch_,
                                     {&nearest, 1}) == 0)
    return limit_m;
  gradient = nearest.direction;
  return nearest.distance;
}

std::size_t WorldQuery::boxes(const Vector3d& low, const Vector3d& high,
                              const planning::ArrayOut<hamelin_box>& out) {
  const scene::Environment& environment = snapshot_->environment;
  const geometry::SE3& map = environment.map_pose();
  const Vector3d center = map.inverse() * Vector3d(0.5 * (low + high)),
                 half = map.R().transpose().cwiseAbs() * Vector3d(0.5 * (high - low));
  const scene::Box region{center - half, center + half};
  const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(map.R());
  std::size_t count = 0;
  const auto list = [&](const scene::MapField& field, std::int32_t obstacle) {
    if (field.empty()) return;
    field.boxes().overlapping(region, boxes_);
    for (const std::int32_t index : boxes_) {
      const scene::Box& box = field.boxes().boxes()[static_cast<std::size_t>(index)];
      hamelin_box found{};
      found.obstacle = obstacle;
      Vector3d::Map(found.center_world_m) = map * Vector3d(0.5 * (box.lo + box.hi));
      Vector3d::Map(found.half_size_m) = 0.5 * (box.hi - box.lo);
      std::copy_n(wxyz.data(), 4, found.quaternion_wxyz);
      if (count < out.size()) out.set(count, found);
      ++count;
    }
  };
  list(environment.map_field(), HAMELIN_OBSTACLE_MAP);
  if (environment.summary().unknown == scene::UnknownPolicy::block)
    list(environment.unknown_field(), HAMELIN_OBSTACLE_UNKNOWN);
  return count;
}

}  // namespace hamelin::control
