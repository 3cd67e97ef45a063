#include "loop/torque_limits.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace hamelin::control {

using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// A sum of torques may exceed a limit by rounding.
constexpr double rounding_share = 1e-9;

}  // namespace

void copy_gyroscopic_terms(const planning::CommandBuffers& command,
                           std::vector<dynamics::GyroscopicTerm>& out) {
  out.clear();
  for (const auto& term : command.gyroscopic())
    out.push_back({term.link, Vector3d::Map(term.point_link_m), Vector3d::Map(term.w_world)});
}

TorqueLimits::TorqueLimits(const model::Model& model, VectorXd effort_max,
                           std::optional<double> rate_max)
    : model_(model), effort_max_(std::move(effort_max)), rate_max_(rate_max) {
  gyroscopic_ = requested_ = rate_ = impulse_ = VectorXd::Zero(model.dof());
}

bool TorqueLimits::limit(dynamics::Workspace& ws, const VectorXd& q, const VectorXd& v,
                         integration::Channels& channels) {
  gyroscopic_.setZero();
  if (effort_max_.size() == 0) return false;
  auto& held = channels.held_torque;
  requested_ = held;
  held = held.cwiseMin(effort_max_).cwiseMax(-effort_max_);
  double scale = 1.0;
  if (!channels.gyroscopic.empty()) {
    dynamics::gyroscopic_torque(model_, ws, q, v, channels.gyroscopic, gyroscopic_);
    for (Eigen::Index i = 0; i < held.size(); ++i) {
      const double room = effort_max_[i] - (gyroscopic_[i] > 0.0 ? held[i] : -held[i]);
      if (std::abs(gyroscopic_[i]) > room)
        scale = std::min(scale, std::max(0.0, room) / std::abs(gyroscopic_[i]));
    }
    if (scale < 1.0)
      for (auto& term : channels.gyroscopic) term.w_world *= scale;
    gyroscopic_ *= scale;
  }
  return scale < 1.0 || held != requested_;
}

double TorqueLimits::share_of_velocity_change(dynamics::Workspace& ws, const VectorXd& q,
                                              const VectorXd& change, double h,
                                              const VectorXd& held_torque) {
  if (effort_max_.size() == 0) return 1.0;
  rate_ = change / h;
  dynamics::momentum(model_, ws, q, rate_, impulse_);
  double share = 1.0;
  for (Eigen::Index i = 0; i < effort_max_.size(); ++i) {
    const double rest = held_torque[i] + gyroscopic_[i];
    if (!(std::abs(impulse_[i] + rest) > effort_max_[i] * (1.0 + rounding_share))) continue;
    const double room = effort_max_[i] - (impulse_[i] > 0.0 ? rest : -rest);
    share = std::min(share, std::max(0.0, room) / std::abs(impulse_[i]));
  }
  return share;
}

bool TorqueLimits::limit(VectorXd& torque, const VectorXd& last, double period_s) {
  requested_ = torque;
  if (effort_max_.size() > 0) torque = torque.cwiseMin(effort_max_).cwiseMax(-effort_max_);
  if (rate_max_) {
    const double change = *rate_max_ * period_s;
    torque = torque.cwiseMin((last.array() + change).matrix())
                 .cwiseMax((last.array() - change).matrix());
  }
  return torque != requested_;
}

ChannelSum::ChannelSum(const model::Model& model, std::size_t gyroscopic_terms) : model_(model) {
  terms_.reserve(gyroscopic_terms);
  change_ = part_ = VectorXd::Zero(model.dof());
}

void ChannelSum::sum(dynamics::Workspace& ws, const planning::CommandBuffers& command,
                     const VectorXd& q, const VectorXd& v, const VectorXd& q_measured,
                     double period_s, double mass_scale, VectorXd& torque) {
  torque = command.held_torque() - command.damping().cwiseProduct(v) - command.potential_gradient();
  copy_gyroscopic_terms(command, terms_);
  if (!terms_.empty()) {
    dynamics::gyroscopic_torque(model_, ws, q, v, terms_, part_);
    torque += part_;
  }
  if (command.raw().has_node_velocity == 0) return;
  change_ = (command.node_velocity() - v) / period_s;
  dynamics::momentum(model_, ws, q_measured, change_, part_);
  torque += mass_scale * part_;
}

}  // namespace hamelin::control
