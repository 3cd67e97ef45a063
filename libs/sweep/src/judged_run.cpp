#include "hamelin/sweep/judged_run.hpp"

namespace hamelin::sweep {

JudgedRun run_under_judge(const scene::Scene& scene,
                          const std::vector<std::filesystem::path>& plugin_directories,
                          const simulation::Watch& watch,
                          const simulation::PlantFactory& plant_factory) {
  Judge judge(scene);
  simulation::Watch watched = watch;
  watched.at_node = [&](double time_s, const Eigen::VectorXd& q) {
    judge.add_node(time_s, q);
    if (watch.at_node) watch.at_node(time_s, q);
  };
  JudgedRun run{simulation::run(scene, plugin_directories, watched, plant_factory), {}};
  run.verdict = judge.verdict();
  return run;
}

std::string to_line(const JudgedRun& run) {
  const Json document{{"result", log::to_json(run.result)}, {"judge", to_json(run.verdict)}};
  return document.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace hamelin::sweep
