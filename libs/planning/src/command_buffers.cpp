#include "command_buffers.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace hamelin::planning {

namespace {

bool finite(const Eigen::VectorXd& x) {
  return x.allFinite();
}
bool finite(const double (&x)[3]) {
  return std::isfinite(x[0]) && std::isfinite(x[1]) && std::isfinite(x[2]);
}

}  // namespace

CommandBuffers::CommandBuffers(std::size_t dof, std::size_t gyroscopic_capacity, std::size_t series)
    : gyroscopic_(gyroscopic_capacity), series_(series) {
  for (auto* x : {&potential_gradient_, &damping_, &held_torque_, &node_velocity_})
    x->resize(static_cast<Eigen::Index>(dof));
  clear();
}

void CommandBuffers::clear() noexcept {
  for (auto* x : {&potential_gradient_, &damping_, &held_torque_, &node_velocity_}) x->setZero();
  std::fill(series_.begin(), series_.end(), std::numeric_limits<double>::quiet_NaN());
  raw_ = {};
  raw_.struct_size = sizeof raw_;
  raw_.potential_gradient = potential_gradient_.data();
  raw_.damping = damping_.data();
  raw_.gyroscopic = gyroscopic_.data();
  raw_.gyroscopic_capacity = gyroscopic_.size();
  raw_.gyroscopic_stride = sizeof(hamelin_gyroscopic_term);
  raw_.held_torque = held_torque_.data();
  raw_.node_velocity = node_velocity_.data();
  raw_.series = series_.data();
  raw_.series_count = series_.size();
}

const char* defect(const CommandBuffers& out, std::size_t dof, std::size_t gyroscopic_capacity) {
  const hamelin_command& raw = out.raw();
  if (raw.state < HAMELIN_PLANNER_RUNNING || raw.state > HAMELIN_PLANNER_DETECTS_STALLS)
    return "unknown planner state";
  if (std::find(std::begin(raw.cause), std::end(raw.cause), '\0') == std::end(raw.cause))
    return "cause is not nul-terminated";
  if (!std::isfinite(raw.potential_J) || !finite(out.potential_gradient()))
    return "potential is not finite";
  if (!finite(out.damping())) return "damping is not finite";
  if (out.damping().minCoeff() < 0.0) return "damping is negative";
  if (!finite(out.held_torque())) return "held torque is not finite";
  if (raw.has_node_velocity != 0 && !finite(out.node_velocity()))
    return "node velocity is not finite";
  if (raw.gyroscopic_count > gyroscopic_capacity)
    return "more gyroscopic terms than the host's capacity";
  for (const auto& term : out.gyroscopic()) {
    if (term.link < 0 || static_cast<std::size_t>(term.link) >= dof)
      return "gyroscopic term on a link that does not exist";
    if (!finite(term.point_link_m) || !finite(term.w_world)) return "gyroscopic term is not finite";
  }
  if (!std::isfinite(raw.filter_work_J) || !std::isfinite(raw.recovery_work_J))
    return "energy account is not finite";
  return nullptr;
}

}  // namespace hamelin::planning
