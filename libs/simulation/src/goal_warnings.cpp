// What a judge says of goals at which the arm would touch something.
#include <fmt/format.h>

#include <array>

#include "hamelin/scene/self_collision.hpp"
#include "judge.hpp"

namespace hamelin::simulation {

std::vector<std::string> Judge::describe_goals_in_contact() {
  std::vector<std::string> out;
  if (!view_->has_obstacles() && !view_->has_self()) return out;
  const std::array<double, 1> point{0.0};
  const auto& environment = view_->environment();
  for (std::size_t i = 0; i < scene_.goals.size(); ++i) {
    const auto& goal = scene_.goals[i];
    if (goal.type == scene::GoalType::follow) break;  // it moves
    if (goal.type == scene::GoalType::any_of || scene::is_region(goal)) continue;
    const bool of_joints = goal.type == scene::GoalType::joint;
    if (own_) own_->allow(goal.may_touch);
    const scene::Shapes placed =
        of_joints ? view_->place(goal.q) : scene::Shapes{{&goal.pose.p(), 1}, point};
    scene::Contact deepest;
    if (view_->deepest_at_start(placed, deepest))
      out.push_back(fmt::format(
          "goal {}: {}; the exit direction is {}", i + 1,
          of_joints ? environment.describe(deepest, model_)
                    : fmt::format("its tip is {:.2g} mm inside {}", -1e3 * deepest.distance,
                                  environment.describe(deepest.obstacle)),
          scene::describe_exit_direction(deepest)));
    scene::SelfContact worst;
    if (of_joints && view_->deepest_self(placed, worst))
      out.push_back(
          fmt::format("goal {}: the arm touches itself: {} are {:.2g} mm inside each other", i + 1,
                      view_->self_field()->describe(worst.pair), -1e3 * worst.distance));
  }
  if (own_) own_->allow(may_touch_);
  return out;
}

}  // namespace hamelin::simulation
