#pragma once
#include <Eigen/Core>
#include <functional>
#include <string_view>
#include <vector>

#include "hamelin/control/world_view.hpp"
#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::control {

/// Owns a planner, passes it the state of the world and receives its answers. One thread; a tick
/// does not allocate.
class PlannerHost final : private planning::HostServices {
 public:
  /// Receives the planner's log lines: level HAMELIN_LOG_INFO or HAMELIN_LOG_WARNING. May be called
  /// by the constructor.
  using LineSink = std::function<void(std::int32_t level, std::string_view line)>;

  /// @param setup nominal arm of the planner, goals and limits
  /// @param world the surroundings that it is shown; must outlive this
  /// @throws Error plugin with the planner's own message if it refuses to start
  PlannerHost(const planning::Plugin& plugin, planning::SetupData setup, const Json& params,
              WorldView& world, LineSink sink);

  /// Calls the planner with the contacts of the world's last look().
  /// @param k, time_s index and time of the tick
  /// @param q, v as measured; dof numbers each
  /// @return false if the planner failed: see error()
  [[nodiscard]] bool tick(long k, double time_s, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                          std::size_t goal_index);
  /// Its last answer.
  [[nodiscard]] const planning::CommandBuffers& command() const noexcept { return command_; }
  /// Why the last tick failed.
  [[nodiscard]] std::string_view error() const noexcept { return planner_.error(); }
  [[nodiscard]] bool gave_up() const noexcept {
    return command_.raw().state == HAMELIN_PLANNER_GAVE_UP;
  }
  /// Whether it has its own stall rule, so that the scene's rule does not apply.
  [[nodiscard]] bool has_own_stall_rule() const noexcept {
    return command_.raw().state == HAMELIN_PLANNER_OWN_STALL_RULE;
  }
  [[nodiscard]] const planning::Plugin& plugin() const noexcept { return planner_.plugin(); }

 private:
  // planning::HostServices
  void log(std::int32_t level, std::string_view line) override;
  std::size_t closest_points(std::span<const double> q, double influence_m,
                             std::span<hamelin_contact> out) override;
  std::size_t closest_self(std::span<const double> q, double influence_m,
                           std::span<hamelin_self_contact> out) override;

  WorldView& world_;
  LineSink sink_;
  Eigen::VectorXd query_q_;
  std::vector<scene::Contact> query_contacts_;
  std::vector<scene::SelfContact> query_self_contacts_;
  std::vector<hamelin_contact> contacts_;
  std::vector<hamelin_self_contact> self_contacts_;
  planning::CommandBuffers command_;
  planning::LoadedPlanner planner_;  ///< last member: its constructor uses the others
};

}  // namespace hamelin::control
