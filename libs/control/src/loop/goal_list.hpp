#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "hamelin/control/live_reference.hpp"
#include "hamelin/control/live_target.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/scene.hpp"
#include "shield/certified_path.hpp"

namespace hamelin::control {

/// A list of goals as the control loop and as its planner see it. Immutable once published.
struct GoalList {
  /// Of each goal what its trajectory is proved as; null: it has none, or there is no proof.
  using Motions = std::vector<std::shared_ptr<const CertifiedPath>>;
  /// @param goals at least one; allowances, motions: one per goal
  /// @param load for which the motions are proved
  GoalList(std::uint64_t number, std::vector<scene::Goal> goals,
           std::vector<std::uint64_t> allowances, Motions motions, std::uint64_t load);
  GoalList(const GoalList&) = delete;
  GoalList& operator=(const GoalList&) = delete;

  std::uint64_t number;  ///< 0 for the goals of the scene; counts the lists that replaced them
  std::shared_ptr<const std::vector<scene::Goal>> shared;
  const std::vector<scene::Goal>& goals;  ///< the same
  std::vector<std::uint64_t> allowances;  ///< what each goal may touch, see World::allow()
  Motions motions;
  std::uint64_t load;                     ///< Answer::load for which the motions are proved
  std::vector<hamelin_goal> for_planner;  ///< the same; pointers refer to `goals`
};

/// A goal as planners see it; of several options the first stands for all. Its pointers refer to
/// `goal`.
[[nodiscard]] hamelin_goal to_c(const scene::Goal& goal);

/// Sets what changes from tick to tick in a follow goal.
void set_target(const TargetState& target, hamelin_goal& goal) noexcept;
/// Sets what changes from tick to tick in a goal with a trajectory. Its pointers refer to
/// `reference`.
void set_reference(const ReferenceState& reference, hamelin_goal& goal) noexcept;

/// Checks goals that are to replace those of a scene.
/// @param path_points_max the largest number of way-points of a path
/// @param planner that must accept goals which follow a target or have a trajectory
/// @throws Error invalid, "goal 1: what is wrong, what was expected"
void check_goals(const std::vector<scene::Goal>& goals, const scene::Scene& scene,
                 const model::Model& model, std::size_t path_points_max,
                 const planning::Plugin& planner);

/// Why a goal cannot be reached with a scene's guide and this planner, although it needs a path;
/// empty: it can.
[[nodiscard]] std::string path_defect(const scene::Goal& goal, const scene::Scene& scene,
                                      const planning::Plugin& planner);

/// What is wrong with the joints of a trajectory for this arm; empty if nothing is.
[[nodiscard]] std::string joints_defect(const scene::JointTrajectory& trajectory,
                                        const model::Model& model);

/// What each goal may touch.
[[nodiscard]] std::vector<scene::Allowance> allowances_of(const std::vector<scene::Goal>& goals);

/// The largest number of way-points of the paths of these goals; 0 without paths.
[[nodiscard]] std::size_t longest_path(const std::vector<scene::Goal>& goals);

}  // namespace hamelin::control
