#include "scenery.hpp"

#include <fmt/format.h>

#include <limits>
#include <set>
#include <utility>

#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::mcap {

namespace {

// So far beyond the arm's reach the map is shown [m].
constexpr double beyond_reach_m = 0.5;

constexpr Color map_color{0.6, 0.65, 0.7}, obstacle_color{0.8, 0.25, 0.3},
    hidden_color{0.8, 0.25, 0.3, 0.4};  // obstacles that planners are never shown
constexpr Color reached_color{0.5, 0.5, 0.5, 0.4}, current_color{0.2, 0.75, 0.35, 0.6},
    later_color{0.2, 0.75, 0.35, 0.25};
constexpr double axes_m = 0.1;         // length of a goal's axes
constexpr double joint_goal_m = 0.02;  // radius of the ball at the tip in a joint goal

std::vector<std::string> unique_names(const std::vector<scene::Obstacle>& obstacles) {
  std::vector<std::string> names;
  std::set<std::string> used;
  for (std::size_t k = 0; k < obstacles.size(); ++k) {
    std::string name = obstacles[k].name;
    for (; !used.insert(name).second;) name += fmt::format(" #{}", k);
    names.push_back(std::move(name));
  }
  return names;
}

scene::Scene without_missing_map(scene::Scene scene, bool has_map) {
  if (!has_map) scene.map.reset();
  return scene;
}

void add_solid(Entity& entity, const scene::Obstacle& obstacle, const geometry::SE3& pose) {
  const Color& color = obstacle.judge_only ? hidden_color : obstacle_color;
  const Eigen::Vector3d half = 0.5 * obstacle.length_m * pose.R().col(2);
  switch (obstacle.shape) {
    case scene::Shape::sphere:
      return entity.add_sphere(pose.p(), obstacle.radius_m, color);
    case scene::Shape::box:
      return entity.add_box(pose, obstacle.size_m, color);
    case scene::Shape::cylinder:
      return entity.add_cylinder(pose, obstacle.radius_m, obstacle.length_m, color);
    case scene::Shape::capsule:
      return entity.add_capsule(pose.p() - half, pose.p() + half, obstacle.radius_m, color);
    case scene::Shape::frame:
      return;
  }
}

}  // namespace

Scenery::Scenery(const scene::Scene& scene, const model::Model& model, bool has_map)
    : scene_(scene),
      model_(model),
      has_map_(has_map),
      environment_(
          scene::make_environment(without_missing_map(scene, has_map), model, beyond_reach_m)),
      names_(unique_names(environment_.obstacles())) {}

void Scenery::add_static_transforms(std::uint64_t time_ns, Json& transforms) const {
  transforms.push_back(frame_transform(time_ns, world_frame, base_frame, model_.base()));
  if (has_map_)
    transforms.push_back(frame_transform(time_ns, world_frame, map_frame, environment_.map_pose()));
}

void Scenery::add_transforms(std::uint64_t time_ns, double time_s, Json& transforms) const {
  for (std::size_t k = 0; k < names_.size(); ++k)
    if (environment_.moves(k))
      transforms.push_back(
          frame_transform(time_ns, world_frame, obstacle_frame(names_[k]),
                          scene::motion_at(environment_.obstacles()[k], time_s).pose));
}

void Scenery::change_map() {
  while (next_event_ < scene_.events.size() && !scene_.events[next_event_].map) ++next_event_;
  if (!has_map_ || next_event_ == scene_.events.size()) return;
  environment_ = environment_.with_change(*scene_.events[next_event_++].map);
  map_changed_ = true;
}

void Scenery::take_up(const std::string& load) {
  for (const scene::Event& event : scene_.events)
    for (std::size_t k = 0; k < names_.size(); ++k) {
      scene::Obstacle obstacle = environment_.obstacles()[k];
      if (!event.attach || event.attach->name != load || obstacle.name != event.obstacle) continue;
      obstacle.appears_s = std::numeric_limits<double>::infinity();
      environment_ = environment_.with_obstacle(k, std::move(obstacle));
    }
}

std::optional<Json> Scenery::map(std::uint64_t time_ns, double time_s) {
  if (!has_map_) return std::nullopt;
  map_changed_ = !environment_.advance(time_s).empty() || map_changed_;
  if (!map_changed_) return std::nullopt;
  map_changed_ = false;
  Entity entity(time_ns, map_frame, map_frame);
  environment_.map_field().boxes().for_each_alive([&](const scene::Box& box) {
    entity.add_box({Eigen::Matrix3d::Identity(), 0.5 * (box.lo + box.hi)}, box.hi - box.lo,
                   map_color);
  });
  return scene_update(time_ns, {entity});
}

Entity Scenery::obstacle_entity(std::uint64_t time_ns, std::size_t k) const {
  const scene::Obstacle& obstacle = environment_.obstacles()[k];
  const bool moves = environment_.moves(k);
  Entity entity(time_ns, moves ? obstacle_frame(names_[k]) : world_frame, names_[k]);
  add_solid(entity, obstacle, moves ? geometry::SE3{} : scene::motion_at(obstacle, 0.0).pose);
  return entity;
}

std::optional<Json> Scenery::obstacles(std::uint64_t time_ns, double time_s) {
  std::vector<bool> existing;
  std::vector<Entity> entities;
  for (std::size_t k = 0; k < names_.size(); ++k) {
    const scene::Obstacle& obstacle = environment_.obstacles()[k];
    existing.push_back(scene::exists(obstacle, time_s));
    if (existing.back() && obstacle.shape != scene::Shape::frame)
      entities.push_back(obstacle_entity(time_ns, k));
  }
  if (existing == existing_) return std::nullopt;
  existing_ = std::move(existing);
  return scene_update(time_ns, entities);
}

std::optional<Entity> Scenery::goal_entity(std::uint64_t time_ns, std::size_t k,
                                           std::size_t index) const {
  const scene::Goal& goal = scene::options_of(scene_.goals[k]).front();
  const Color color = k < index ? reached_color : k == index ? current_color : later_color;
  const bool follows = goal.type == scene::GoalType::follow;
  Entity entity(time_ns, follows ? target_frame : world_frame, fmt::format("goal/{}", k));
  geometry::SE3 pose = follows ? geometry::SE3{} : goal.pose;
  double radius = goal.tolerance_m;
  if (goal.type == scene::GoalType::joint) {
    if (goal.q.size() != model_.dof()) return std::nullopt;
    dynamics::Workspace ws(model_);
    dynamics::forward_kinematics(model_, ws, goal.q);
    pose = dynamics::tip_pose(model_, ws);
    radius = joint_goal_m;
  }
  entity.add_sphere(pose.p(), radius, color);
  if (goal.type != scene::GoalType::position) entity.add_axes(pose, axes_m);
  return entity;
}

std::optional<Json> Scenery::goals(std::uint64_t time_ns, std::size_t index) {
  if (scene_.goals.empty() || goal_index_ == index) return std::nullopt;
  goal_index_ = index;
  std::vector<Entity> entities;
  for (std::size_t k = 0; k < scene_.goals.size(); ++k)
    if (const auto entity = goal_entity(time_ns, k, index)) entities.push_back(*entity);
  return scene_update(time_ns, entities);
}

}  // namespace hamelin::mcap
