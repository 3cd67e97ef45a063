// An arm moves through a shelf in closed loop, and leaves a log.
#include <fmt/core.h>

#include <hamelin/log/run_log.hpp>
#include <hamelin/simulation/run.hpp>

int main(int, char** argv) {  // 04_run FOLDER_OF_PLANNERS LOG
  using namespace hamelin;
  const scene::Scene scene = scene::read_scene("data/scenes/shelf.json");
  log::RunLog log(argv[2]);
  simulation::Watch watch;
  watch.log = &log;
  watch.every = 10;  // steps between lines
  const log::Result result = simulation::run(scene, {argv[1]}, watch);
  fmt::print("{} after {:.3f} s\n", log::to_string(result.outcome), result.time_s);
  fmt::print("nearest obstacle: {:.6f} m\n", *result.min_clearance_m);
  return log::exit_code(result.outcome);
}
