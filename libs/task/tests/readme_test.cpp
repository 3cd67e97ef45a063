#include <catch2/catch.hpp>
#include <filesystem>

#include "hamelin/core/error.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/task/task.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;

TEST_CASE("the README's example plans a task", "[task][unit]") {
  const std::filesystem::path source = HAMELIN_SOURCE_DIR;
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(source);
  const Json document = read_json("data/tasks/shelf.json");
  // clang-format off
  // [example]
const task::Task given = task::task_from_json(document, "data/tasks", "shelf.json");
const task::TaskPlan plan = task::plan_task(given);
if (!plan.found()) throw Error(ErrorCode::invalid, plan.cause);
const scene::Scene& scene = plan.scene;  // for simulation::run()
  // [example]
  // clang-format on
  std::filesystem::current_path(before);
  CHECK(plan.steps.size() == 3);
  CHECK(scene.goals.size() == 8);
  test::check_readme_example("libs/task");
}
