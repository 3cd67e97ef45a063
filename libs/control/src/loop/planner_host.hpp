#pragma once
#include <Eigen/Core>
#include <atomic>
#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "guide/guidance.hpp"
#include "hamelin/control/answer.hpp"
#include "hamelin/control/line_buffer.hpp"
#include "hamelin/control/world.hpp"
#include "hamelin/control/world_view.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "loop/drive.hpp"
#include "loop/kept_rows.hpp"

namespace hamelin::control {

/// Owns a planner, passes it the state of the world and receives its answers. One thread; a tick
/// does not allocate. The planner may query the world on threads of its own.
class PlannerHost final : private planning::HostServices {
 public:
  /// @param setup nominal arm of the planner, goals and limits
  /// @param nominal the planner's model of the arm; must outlive this, as `world` and `view`
  /// @param view the surroundings that it is shown, a view of `world`
  /// @param sink receives its log lines, also while this is made
  /// @param now_s time of the last tick
  /// @throws Error plugin with the planner's own message if it refuses to start
  PlannerHost(const planning::Plugin& plugin, planning::SetupData setup, const Json& params,
              const model::Model& nominal, const World& world, WorldView& view, LineSink sink,
              double now_s);

  /// Calls the planner with the contacts of the world's last look().
  /// @param k, time_s index and time of the tick
  /// @param q, v as measured; dof numbers each @param torques of the drive
  /// @return false if the planner failed: see error()
  /// @param guidance that it may ask for paths; null: none
  [[nodiscard]] bool tick(long k, double time_s, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                          const PlannerGoal& goal, const Torques& torques, Guidance* guidance);
  /// Tells the planner that the next tick is a new start.
  void reset(const Eigen::VectorXd& q, const Eigen::VectorXd& v) noexcept { planner_.reset(q, v); }
  /// Makes the planner again. @throws Error as the constructor
  void restart(planning::SetupData setup, const Json& params);
  /// See LoadedPlanner.
  [[nodiscard]] planning::PreparedParams prepare_params(const Json& checked) const {
    return planner_.prepare_params(checked);
  }
  void apply_params(const planning::PreparedParams& params) noexcept {
    planner_.apply_params(params);
  }
  [[nodiscard]] const std::vector<planning::Series>& series() const noexcept {
    return planner_.series();
  }
  [[nodiscard]] const Drawing& drawing() const noexcept { return drawing_; }
  /// Its last answer.
  [[nodiscard]] const planning::CommandBuffers& command() const noexcept { return command_; }
  /// Why the last tick failed.
  [[nodiscard]] std::string_view error() const noexcept { return planner_.error(); }
  [[nodiscard]] bool gave_up() const noexcept {
    return command_.raw().state == HAMELIN_PLANNER_GAVE_UP;
  }
  /// Whether it detects its stalls itself, so that the scene's rule does not apply.
  [[nodiscard]] bool detects_stalls() const noexcept {
    return command_.raw().state == HAMELIN_PLANNER_DETECTS_STALLS;
  }
  [[nodiscard]] const planning::Plugin& plugin() const noexcept { return planner_.plugin(); }

 private:
  // planning::HostServices
  void log(std::int32_t level, std::string_view line) override;
  std::size_t closest_points(std::span<const double> q, double influence_m,
                             planning::ArrayOut<hamelin_contact> out) override;
  std::size_t closest_ahead(std::span<const double> q, double time_ahead_s, std::int32_t kinds,
                            double influence_m, planning::ArrayOut<hamelin_contact> out) override;
  std::size_t closest_self(std::span<const double> q, double influence_m,
                           planning::ArrayOut<hamelin_self_contact> out) override;
  std::size_t obstacles(planning::ArrayOut<hamelin_obstacle_state> out) override;
  std::size_t obstacles_ahead(double time_ahead_s, std::int32_t kinds,
                              planning::ArrayOut<hamelin_obstacle_state> out) override;
  void draw_path(std::span<const double> points_world_m) override;
  bool request_path() override { return guidance_ != nullptr && guidance_->request(); }
  std::unique_ptr<planning::QueryServices> open_query() override;

  const model::Model& nominal_;
  const World& world_;
  WorldView& view_;
  LineSink sink_;
  Eigen::VectorXd query_q_;
  std::vector<scene::Contact> query_contacts_;
  std::vector<scene::SelfContact> query_self_contacts_;
  std::vector<hamelin_contact> contacts_;
  std::vector<hamelin_self_contact> self_contacts_;
  KeptRows kept_;
  std::atomic<double> time_s_;    ///< of the last tick
  Guidance* guidance_ = nullptr;  ///< during a tick
  Drawing drawing_;
  bool draws_ = false;               ///< whether it drew a line in this tick
  std::uint64_t world_number_ = 0;   ///< that the planner knows
  planning::LoadedPlanner planner_;  ///< its constructor uses the members before it
  planning::CommandBuffers command_;
};

}  // namespace hamelin::control
