#include "closed_loop.hpp"
#include "hamelin/simulation/integrator_options.hpp"
#include "scene_values.hpp"

namespace hamelin::simulation {

log::Result run(const scene::Scene& scene,
                const std::vector<std::filesystem::path>& plugin_directories, const Watch& watch,
                const PlantFactory& plant_factory) {
  ClosedLoop loop(scene, plugin_directories, plant_factory);
  loop.check_start();
  return loop.run(watch);
}

Json full_config(const scene::Scene& scene,
                 const std::vector<std::filesystem::path>& plugin_directories) {
  (void)integrator_options(scene.integrator.params, scene.name + ": /integrator/params");
  Json config = resolved_config(scene);
  if (scene.planner)
    config["planner"]["params"] = planning::check_params(
        planning::find_plugin(scene.planner->name, plugin_directories), scene.planner->params);
  return config;
}

}  // namespace hamelin::simulation
