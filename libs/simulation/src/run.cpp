#include "closed_loop.hpp"

namespace hamelin::simulation {

log::Result run(const scene::Scene& scene, const std::vector<std::filesystem::path>& plugin_directories,
                const Watch& watch) {
  return ClosedLoop(scene, plugin_directories).run(watch);
}

}  // namespace hamelin::simulation
