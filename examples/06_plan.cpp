// Searches proved paths and motions to the goals of a scene.
#include <fmt/core.h>

#include <algorithm>
#include <hamelin/control/plan_paths.hpp>

int main() {
  using namespace hamelin;
  const scene::Scene scene = scene::read_scene("data/scenes/shelf.json");
  const control::PathPlan plan = control::plan_paths(scene, {.motions = true});
  for (const control::PlannedGoal& goal : plan.goals) {
    if (!goal.motion) return 1;
    fmt::print("{} way-points, {} checks: {:.3f} s, proved to keep {:.4f} m\n",
               goal.path.points.cols(), goal.path.checks, goal.motion->motion.duration_s(),
               goal.motion->clearance_m);
  }
}
