#include "preparation.hpp"

#include <fmt/format.h>

#include <utility>

#include "hamelin/core/error.hpp"

namespace hamelin::simulation {

using Eigen::VectorXd;

void check_numbers(const scene::Scene& scene, const model::Model& model) {
  const auto sized = [&](const VectorXd& x, const std::string& place) {
    if (x.size() != model.dof())
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: {}: {} values given, expected {} (one per joint of '{}')",
                              scene.name, place, x.size(), model.dof(), model.robot().name));
  };
  if (scene.start_q.size() > 0) sized(scene.start_q, "/start/q");
  if (scene.start_v.size() > 0) sized(scene.start_v, "/start/v");
  for (std::size_t i = 0; i < scene.goals.size(); ++i)
    if (scene.goals[i].type == scene::GoalType::joint)
      sized(scene.goals[i].q,
            fmt::format("/goals/{}/q{}", i, scene.goals[i].path.size() > 0 ? "/0" : ""));
  if (scene.actuation.coulomb_friction_share > 0.0)
    for (const auto& link : model.robot().links)
      if (!link.joint.effort_max)
        throw Error(ErrorCode::invalid,
                    fmt::format("{}: /actuation/coulomb_friction_share: is a share of effort "
                                "limits, but joint '{}' of "
                                "'{}' has none",
                                scene.name, link.joint.name, model.robot().name));
  if (scene.goals.empty())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: /goals: is empty, expected at least one goal", scene.name));
}

planning::Plugin find_planner(const scene::Scene& scene,
                              const std::vector<std::filesystem::path>& directories) {
  if (!scene.planner)
    throw Error(
        ErrorCode::invalid,
        fmt::format("{}: /planner: is missing, expected the name of a planner", scene.name));
  return planning::find_plugin(scene.planner->name, directories);
}

}  // namespace hamelin::simulation
