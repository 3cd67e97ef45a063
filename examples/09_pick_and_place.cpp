// Takes a thing from a table and puts it down elsewhere, by grasps that are chosen.
#include <fmt/core.h>

#include <hamelin/io/json.hpp>
#include <hamelin/simulation/run.hpp>
#include <hamelin/task/task.hpp>

int main(int, char** argv) {  // 09_pick_and_place FOLDER_OF_PLANNERS
  using namespace hamelin;
  const Json document = read_json("data/tasks/table.json");
  const task::TaskPlan plan =
      task::plan_task(task::task_from_json(document, "data/tasks", "data/tasks/table.json"));
  if (!plan.found()) return 1;
  const log::Result result = simulation::run(plan.scene, {argv[1]}, {});
  fmt::print("{} after {:.3f} s, {} goals\n", log::to_string(result.outcome), result.time_s,
             plan.scene.goals.size());
  return log::exit_code(result.outcome);
}
