#include "hamelin/control/world.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"

namespace hamelin::control {

namespace {

// A placeholder for obstacles without a name would make two of them one.
void check_update(const scene::Obstacle& obstacle) {
  const std::string where = fmt::format("obstacle '{}'", obstacle.name);
  if (obstacle.name.empty())
    throw Error(ErrorCode::invalid, "obstacle: has no name, expected one to refer to it");
  if (!obstacle.pose.p().allFinite() || !obstacle.pose.R().allFinite())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: its pose is not finite, expected finite numbers", where));
  if (!obstacle.known || obstacle.judge_only)
    throw Error(ErrorCode::invalid, fmt::format("{}: is hidden from the planner (known, "
                                                "judge_only), expected one that it is shown",
                                                where));
  scene::check(obstacle, where);
}

}  // namespace

World::World(const scene::Scene& scene, const model::Model& model, const Options& options)
    : options_(options), scene_(scene), model_(model) {
  options_.obstacles_max = std::max(options_.obstacles_max, scene.obstacles.size());
  contacts_max_ = scene::Environment::contacts_max(model.shapes().size(), options_.obstacles_max);
  std::vector<scene::Obstacle> obstacles;
  std::vector<std::int32_t> ids;
  for (const auto& obstacle : scene.obstacles) {
    const std::int32_t id = next_id_++;
    if (!obstacle.known || obstacle.judge_only) {
      reserved_.emplace_back(obstacle.name, id);
      continue;
    }
    obstacles.push_back(obstacle);
    ids.push_back(id);
  }
  scene_.obstacles.clear();
  publish(make_environment(scene.map, scene.start_q).with_obstacles(std::move(obstacles)),
          std::move(ids));
}

scene::Environment World::make_environment(const std::optional<scene::MapSpec>& map,
                                           const Eigen::VectorXd& q) const {
  scene::Scene scene = scene_;
  scene.map = map;
  if (scene.map) scene.map->changes.clear();
  scene.start_q = q;
  return scene::make_environment(scene, model_, options_.influence_m);
}

std::uint64_t World::publish(scene::Environment environment, std::vector<std::int32_t> ids) {
  if (options_.prepare) environment.prepare();
  const std::uint64_t number = latest_ ? latest_->number + 1 : 0;
  auto snapshot = std::make_shared<const WorldSnapshot>(
      WorldSnapshot{number, std::move(environment), std::move(ids)});
  auto view = std::make_unique<View>(
      View{snapshot, scene::Environment::Scratch(snapshot->environment, model_.shapes().size())});
  {
    const std::lock_guard lock(latest_mutex_);
    latest_.swap(snapshot);
  }
  if (newest_)
    newest_->publish(std::move(view));
  else
    newest_.emplace(std::move(view));
  return number;
}

std::size_t World::find(std::string_view name) const {
  const auto& obstacles = latest_->environment.obstacles();
  return static_cast<std::size_t>(
      std::find_if(obstacles.begin(), obstacles.end(),
                   [&](const auto& obstacle) { return obstacle.name == name; }) -
      obstacles.begin());
}

std::size_t World::require(std::string_view name) const {
  const std::size_t found = find(name);
  const auto& obstacles = latest_->environment.obstacles();
  if (found < obstacles.size()) return found;
  std::vector<std::string> names;
  names.reserve(obstacles.size());
  for (const auto& obstacle : obstacles) names.push_back(obstacle.name);
  throw Error(ErrorCode::invalid,
              fmt::format("obstacle '{}': there is none of this name, expected one of the {} that "
                          "exist{}",
                          name, names.size(), did_you_mean(name, names)));
}

std::uint64_t World::set_obstacle(scene::Obstacle obstacle) {
  check_update(obstacle);
  const std::lock_guard lock(mutex_);
  if (model_.shapes().empty())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: /robot: '{}' has no collision spheres or capsules, expected some "
                            "because there are obstacles",
                            scene_.name, model_.robot().name));
  auto obstacles = latest_->environment.obstacles();
  auto ids = latest_->obstacle_ids;
  if (const std::size_t found = find(obstacle.name); found < obstacles.size()) {
    obstacles[found] = std::move(obstacle);
  } else {
    if (obstacles.size() == options_.obstacles_max)
      throw Error(ErrorCode::invalid, fmt::format("obstacle '{}': there are {} already, expected "
                                                  "fewer (obstacles_max)",
                                                  obstacle.name, obstacles.size()));
    const auto reserved = std::find_if(reserved_.begin(), reserved_.end(), [&](const auto& entry) {
      return entry.first == obstacle.name;
    });
    ids.push_back(reserved != reserved_.end() ? reserved->second : next_id_++);
    if (reserved != reserved_.end()) reserved_.erase(reserved);
    obstacles.push_back(std::move(obstacle));
  }
  return publish(latest_->environment.with_obstacles(std::move(obstacles)), std::move(ids));
}

std::uint64_t World::move_obstacle(std::string_view name, const geometry::SE3& pose,
                                   const Eigen::Vector3d& velocity_m_s, double time_s) {
  const std::lock_guard lock(mutex_);
  const std::size_t found = require(name);
  auto obstacles = latest_->environment.obstacles();
  obstacles[found].pose = pose;
  obstacles[found].motion = scene::ObservedMotion{time_s, velocity_m_s};
  if (!velocity_m_s.allFinite() || !std::isfinite(time_s))
    throw Error(ErrorCode::invalid,
                fmt::format("obstacle '{}': its velocity or its time is not finite, expected "
                            "finite numbers",
                            name));
  check_update(obstacles[found]);
  return publish(latest_->environment.with_obstacles(std::move(obstacles)), latest_->obstacle_ids);
}

std::uint64_t World::remove_obstacle(std::string_view name) {
  const std::lock_guard lock(mutex_);
  const auto found = static_cast<std::ptrdiff_t>(require(name));
  auto obstacles = latest_->environment.obstacles();
  auto ids = latest_->obstacle_ids;
  obstacles.erase(obstacles.begin() + found);
  ids.erase(ids.begin() + found);
  return publish(latest_->environment.with_obstacles(std::move(obstacles)), std::move(ids));
}

std::uint64_t World::set_map(const std::optional<scene::MapSpec>& map, const Eigen::VectorXd& q) {
  // Reading a map may take long: other updates need not wait for it.
  const scene::Environment environment = make_environment(map, q.size() > 0 ? q : scene_.start_q);
  const std::lock_guard lock(mutex_);
  return publish(environment.with_obstacles(latest_->environment.obstacles()),
                 latest_->obstacle_ids);
}

std::uint64_t World::change_map(const scene::MapChangeSpec& change) {
  const std::lock_guard lock(mutex_);
  return publish(latest_->environment.with_change(change), latest_->obstacle_ids);
}

std::shared_ptr<const WorldSnapshot> World::latest() const {
  const std::lock_guard lock(latest_mutex_);
  return latest_;
}

}  // namespace hamelin::control
