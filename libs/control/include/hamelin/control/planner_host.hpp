#pragma once
#include <Eigen/Core>
#include <functional>
#include <string_view>
#include <vector>

#include "hamelin/control/world_view.hpp"
#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::control {

/// Keeps a planner, shows it the world and takes its answers. One thread; a tick allocates nothing.
class PlannerHost final : private planning::HostServices {
 public:
  /// Receives the planner's lines: level HAMELIN_LOG_INFO or HAMELIN_LOG_WARNING. Called inside the constructor too.
  using LineSink = std::function<void(std::int32_t level, std::string_view line)>;

  /// @param setup the arm that the planner believes in, goals and limits
  /// @param world what it is shown; must outlive this
  /// @throws Error plugin with the planner's own text if it refuses to start
  PlannerHost(const planning::Plugin& plugin, planning::SetupData setup, const Json& params, WorldView& world,
              LineSink sink);

  /// Asks the planner, at the configuration that the world was last looked at.
  /// @param k, time_s of the tick
  /// @param q, v as measured; dof numbers each
  /// @return false if it failed: see error()
  [[nodiscard]] bool tick(long k, double time_s, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                          std::size_t goal_index);
  /// Its last answer.
  [[nodiscard]] const planning::CommandBuffers& command() const noexcept { return command_; }
  /// Why the last tick failed.
  [[nodiscard]] std::string_view error() const noexcept { return planner_.error(); }
  [[nodiscard]] bool gave_up() const noexcept { return command_.raw().state == HAMELIN_PLANNER_GAVE_UP; }
  /// Whether it notices stalls by itself, so that the scene's rule does not apply.
  [[nodiscard]] bool has_own_stall_rule() const noexcept {
    return command_.raw().state == HAMELIN_PLANNER_OWN_STALL_RULE;
  }
  [[nodiscard]] const planning::Plugin& plugin() const noexcept { return planner_.plugin(); }

 private:
  // planning::HostServices
  void log(std::int32_t level, std::string_view line) override;
  std::size_t closest_points(std::span<const double> q, double influence_m, std::span<hamelin_contact> out) override;
  std::size_t closest_self(std::span<const double> q, double influence_m, std::span<hamelin_self_contact> out) override;

  WorldView& world_;
  LineSink sink_;
  Eigen::VectorXd q_asked_;
  std::vector<scene::Contact> asked_;
  std::vector<scene::SelfContact> self_asked_;
  std::vector<hamelin_contact> contacts_;
  std::vector<hamelin_self_contact> self_contacts_;
  planning::CommandBuffers command_;
  planning::LoadedPlanner planner_;  ///< last: it is made from the rest
};

}  // namespace hamelin::control
