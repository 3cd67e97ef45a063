#pragma once
#include <filesystem>
#include <vector>

#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/scene.hpp"

/// Checks and choices before a planner is created.
namespace hamelin::simulation {

/// Checks that start, goals and limits fit the robot. @throws Error invalid, naming the place in
/// the scene
void check_numbers(const scene::Scene& scene, const model::Model& model);

/// The planner that the scene names. @throws Error invalid or plugin
[[nodiscard]] planning::Plugin find_planner(const scene::Scene& scene,
                                            const std::vector<std::filesystem::path>& directories);

}  // namespace hamelin::simulation
