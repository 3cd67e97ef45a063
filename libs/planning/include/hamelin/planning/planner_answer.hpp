#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "hamelin/core/error.hpp"
#include "hamelin/planning/plugin_abi.h"
#include "hamelin/planning/views.hpp"

/// What a planner returns at each tick.
namespace hamelin::planning {

/// The answer of one tick, in the channels that plugin_abi.h describes. All of them are zero at
/// first; channels that are not set have no effect.
class Command {
 public:
  Command(hamelin_command& raw, std::size_t dof)
      : raw_(&raw), dof_(static_cast<Eigen::Index>(dof)) {}

  /// Channel `potential`: value [J] and gradient [Nm or N] of a control potential at q.
  void set_potential(double value_J) { raw_->potential_J = value_J; }
  [[nodiscard]] VectorMap potential_gradient() { return {raw_->potential_gradient, dof_}; }
  /// Channel `damping`: non-negative coefficients [Nm s/rad or N s/m].
  [[nodiscard]] VectorMap damping() { return {raw_->damping, dof_}; }
  /// Channel `gyroscopic`: adds the force w × (velocity of the point), docs/theory.md (2.22).
  /// @param point_link in the link's COM frame [m] @param w_world in world axes [N s/m]
  /// @throws Error plugin if the capacity is used up; the host provides at least one term per
  ///   contact
  void add_gyroscopic(int link, const Eigen::Vector3d& point_link, const Eigen::Vector3d& w_world) {
    if (raw_->gyroscopic_count == raw_->gyroscopic_capacity)
      throw Error(ErrorCode::plugin, "more gyroscopic terms than the host's capacity");
    auto& term = gyroscopic(raw_->gyroscopic_count++);
    term.link = link;
    VectorMap(term.point_link_m, 3) = point_link;
    VectorMap(term.w_world, 3) = w_world;
  }
  /// The number of gyroscopic terms added so far, and each of them.
  [[nodiscard]] std::size_t gyroscopic_count() const { return raw_->gyroscopic_count; }
  [[nodiscard]] hamelin_gyroscopic_term& gyroscopic(std::size_t i) {
    return *reinterpret_cast<hamelin_gyroscopic_term*>(
        reinterpret_cast<std::byte*>(raw_->gyroscopic) + i * raw_->gyroscopic_stride);
  }
  /// Channel `held torque`: constant over the step [Nm or N].
  [[nodiscard]] VectorMap held_torque() { return {raw_->held_torque, dof_}; }
  /// Channel `node velocity`: the velocity right after this node. A call switches the channel on.
  [[nodiscard]] VectorMap node_velocity() {
    raw_->has_node_velocity = 1;
    return {raw_->node_velocity, dof_};
  }
  /// Sets the work of the planner's own safety filter at this node [J], for the log:
  /// docs/theory.md (10.16), (10.17).
  void set_accounts(double filter_work_J, double recovery_work_J) {
    raw_->filter_work_J = filter_work_J;
    raw_->recovery_work_J = recovery_work_J;
  }
  /// Sets the number of a series at this tick. @param series what Host::declare_series returned
  void set_series(std::int32_t series, double value) {
    if (series >= 0 && static_cast<std::size_t>(series) < raw_->series_count)
      raw_->series[series] = value;
  }
  /// Disables the scene's stall rule, for planners that detect their stalls themselves.
  void disable_stall_rule() { raw_->state = HAMELIN_PLANNER_DETECTS_STALLS; }
  /// Ends the run because the planner cannot continue. The cause is one line, truncated if too
  /// long.
  void give_up(std::string_view cause) {
    raw_->state = HAMELIN_PLANNER_GAVE_UP;
    const std::size_t size = std::min(cause.size(), sizeof raw_->cause - 1);
    std::copy_n(cause.data(), size, raw_->cause);
    raw_->cause[size] = '\0';
  }
  [[nodiscard]] hamelin_command& raw() { return *raw_; }

 private:
  hamelin_command* raw_;
  Eigen::Index dof_;
};

}  // namespace hamelin::planning
