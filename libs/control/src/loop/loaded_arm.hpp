#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <memory>
#include <optional>
#include <span>

#include "guide/guide_search.hpp"
#include "guide/trajectory_certifier.hpp"
#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/world.hpp"
#include "hamelin/control/world_view.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/payload.hpp"
#include "hamelin/scene/scene.hpp"
#include "loop/drive.hpp"
#include "loop/planner_host.hpp"
#include "shield/shield.hpp"

namespace hamelin::control {

/// What a LoadedArm is made from, the same for all loads.
struct ArmSetup {
  const planning::Plugin& plugin;
  World& world;
  LineSink log;
  std::size_t path_points_max;
  DriveOptions drive;
  double now_s;       ///< time of the last tick; 0 before the first
  bool guide_thread;  ///< whether a guide searches on a thread of its own
};

/// Whether paths are searched for a planner.
[[nodiscard]] bool searches_paths(const scene::Scene& scene,
                                  const planning::Plugin& plugin) noexcept;

/// The arm as a controller knows it with what it carries, and all that depends on its masses and
/// shapes: its view of the world, its shield, its planner, and how channels become a torque. Where
/// something is attached or detached, another object takes its place: made on any thread, and
/// taken over by that of the tick.
struct LoadedArm {
  /// @param scene start and goals are those that the planner is to begin with
  /// @param nominal the controller's model of the arm, with what it carries
  /// @param params of the planner, checked and with defaults
  /// @throws Error plugin or invalid if the planner refuses to start
  LoadedArm(const scene::Scene& scene, model::Model nominal, const Json& params,
            const ArmSetup& arm);
  LoadedArm(const LoadedArm&) = delete;
  LoadedArm& operator=(const LoadedArm&) = delete;

  /// Forgets what the arm has done: what it has is made again, but a planner that can be told of a
  /// new start. @return whether the planner was made again
  [[nodiscard]] bool restart(scene::Scene scene, const Json& params, const ArmSetup& arm);

  const model::Model model;
  WorldView view;
  std::unique_ptr<Shield> shield;  ///< null if there is none
  PlannerHost planner;
  std::unique_ptr<Drive> drive;
  std::unique_ptr<GuideSearch> guide;  ///< null if the scene asks for none

  /// Proves the trajectories of goals in the newest world. For writers, one at a time.
  /// @param allowances what each goal may touch, see World::allow()
  /// @return for each goal its motion; null without a trajectory or a proof
  [[nodiscard]] std::vector<std::shared_ptr<const CertifiedPath>> certify(
      const std::vector<scene::Goal>& goals, const std::vector<std::uint64_t>& allowances,
      const ArmSetup& arm) const;

  /// The stop that acts where no answer does.
  [[nodiscard]] Stop& stop() noexcept { return shield ? shield->stop() : *unverified_stop_; }

 private:
  void make_stop(const scene::Scene& scene, const ArmSetup& arm);
  [[nodiscard]] planning::SetupData make_setup(const scene::Scene& scene, const ArmSetup& arm);
  [[nodiscard]] std::unique_ptr<Shield> make_shield(const scene::Scene& scene,
                                                    const ArmSetup& arm) const;
  [[nodiscard]] std::unique_ptr<GuideSearch> make_guide(const scene::Scene& scene,
                                                        const Json& params, const ArmSetup& arm);

  std::unique_ptr<TrajectoryCertifier> trajectories_;  ///< null if the planner follows none
  std::optional<StopFinder> finder_;                   ///< without a shield, as the next
  std::optional<Stop> unverified_stop_;
  Eigen::VectorXd start_q_;  ///< for which it was made
};

}  // namespace hamelin::control
