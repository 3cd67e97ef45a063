#include "loop/loaded_arm.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

namespace hamelin::control {

LoadedArm::LoadedArm(const scene::Scene& scene, model::Model nominal, const Json& params,
                     const ArmSetup& arm)
    : model(std::move(nominal)),
      view(scene, model, arm.world),
      shield(make_shield(scene, arm)),
      planner(arm.plugin, make_setup(scene, arm), params, model, arm.world, view, arm.log,
              arm.now_s),
      guide(make_guide(scene, params, arm)),
      start_q_(scene.start_q) {
  DriveOptions of_drive = arm.drive;
  of_drive.gyroscopic_terms_max = view.contacts_max();
  drive = make_drive(scene, model, of_drive, shield ? shield->limit_reserve() : LimitReserve{});
  if (!shield) make_stop(scene, arm);
  if (arm.plugin.follows_trajectories())
    trajectories_ = std::make_unique<TrajectoryCertifier>(
        scene, model, view.self_field(),
        MotionBounds{shield ? shield->limit_reserve() : LimitReserve{}, params,
                     arm.drive.changes(scene)});
}

std::vector<std::shared_ptr<const CertifiedPath>> LoadedArm::certify(
    const std::vector<scene::Goal>& goals, const std::vector<std::uint64_t>& allowances,
    const ArmSetup& arm) const {
  std::vector<std::shared_ptr<const CertifiedPath>> out(goals.size());
  for (std::size_t i = 0; i < goals.size(); ++i) {
    if (!goals[i].trajectory || !trajectories_) continue;
    auto result = trajectories_->certify(*goals[i].trajectory, *arm.world.latest(allowances[i]));
    const bool proved = result.motion != nullptr;
    out[i] = std::move(result.motion);
    if (!arm.log || result.cause.empty()) continue;
    arm.log(
        HAMELIN_LOG_INFO,
        fmt::format("goal {}: the trajectory is {}: {}", i + 1,
                    proved ? "followed more slowly" : "followed without a proof", result.cause));
  }
  return out;
}

void LoadedArm::make_stop(const scene::Scene& scene, const ArmSetup& arm) {
  ChangeBounds changes = arm.drive.changes(scene);
  changes.acceleration_max = arm.drive.acceleration_max;
  finder_.emplace(scene, model, arm.drive.period_s, changes);
  unverified_stop_.emplace(scene, model, arm.drive.period_s, changes, *finder_, nullptr);
}

bool LoadedArm::restart(scene::Scene scene, const Json& params, const ArmSetup& arm) {
  scene.start_q = start_q_;
  shield = make_shield(scene, arm);
  guide = make_guide(scene, params, arm);
  drive->forget();
  if (arm.plugin.can_reset()) return false;
  planner.restart(make_setup(scene, arm), params);
  return true;
}

std::unique_ptr<Shield> LoadedArm::make_shield(const scene::Scene& scene,
                                               const ArmSetup& arm) const {
  if (scene::safety_type(scene) != scene::SafetyType::shield) return nullptr;
  return std::make_unique<Shield>(scene, model, view.self_field(), arm.drive.period_s,
                                  arm.drive.changes(scene));
}

bool searches_paths(const scene::Scene& scene, const planning::Plugin& plugin) noexcept {
  return scene.guide.type == scene::GuideType::rrt_connect ||
         (scene.guide.type == scene::GuideType::on_request && plugin.asks_for_paths());
}

std::unique_ptr<GuideSearch> LoadedArm::make_guide(const scene::Scene& scene, const Json& params,
                                                   const ArmSetup& arm) {
  if (!searches_paths(scene, arm.plugin)) return nullptr;
  const LimitReserve reserve = shield ? shield->limit_reserve() : LimitReserve{};
  const search::Settings settings = guide_settings(scene, model, view, reserve, params);
  std::unique_ptr<PathTiming> timing;
  if (arm.plugin.follows_trajectories())
    timing = std::make_unique<PathTiming>(scene, model, view.self_field(),
                                          MotionBounds{reserve, params, arm.drive.changes(scene)},
                                          settings);
  return std::make_unique<GuideSearch>(
      model, arm.world, view,
      std::make_unique<MotionSearch>(model, settings, std::move(timing),
                                     MotionSearch::other_checks(scene.guide)),
      static_cast<Eigen::Index>(arm.path_points_max), arm.guide_thread);
}

planning::SetupData LoadedArm::make_setup(const scene::Scene& scene, const ArmSetup& arm) {
  if (arm.now_s > 0.0) view.look(scene.start_q, arm.now_s);  // the planner may ask at once
  planning::SetupData setup = planner_setup(scene, model, view, arm.drive.period_s,
                                            shield ? shield->limit_reserve() : LimitReserve{});
  setup.path_points_max = arm.path_points_max;
  return setup;
}

}  // namespace hamelin::control
