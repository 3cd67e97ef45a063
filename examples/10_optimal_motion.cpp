// The motion of least effort to the goals of a scene, by discrete mechanics.
#include <fmt/core.h>

#include <hamelin/optimal/scene_motion.hpp>

int main() {
  using namespace hamelin;
  const scene::Scene scene = scene::read_scene("data/scenes/pillar.json");
  const optimal::SceneMotion motion = optimal::optimize_scene(scene, {});
  if (!motion.valid()) return 1;
  for (const optimal::GoalMotion& goal : motion.goals)
    fmt::print("{:.3f} s, cost {:.4f}, proved to keep {:.4f} m\n", goal.found.motion.duration_s(),
               goal.found.solution.cost, goal.found.proof.margin_m);
}
