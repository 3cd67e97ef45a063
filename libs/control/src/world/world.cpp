#include "hamelin/control/world.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "loop/newest.hpp"
#include "world/posture_history.hpp"
#include "world/sensed_map.hpp"
#include "world/sensed_movers.hpp"

namespace hamelin::control {

namespace {

// Leaves nothing of a map but its voxels.
void hide(scene::MapSpec& map) {
  map.resolution_m = scene::read_map(map, {}).resolution;
  map.file.clear();
  map.known = true;
}

// Two seconds at 1 kHz.
constexpr std::size_t postures_kept = 2048;

void check_finite(std::string_view name, const geometry::SE3& pose) {
  if (!pose.p().allFinite() || !pose.R().allFinite())
    throw Error(
        ErrorCode::invalid,
        fmt::format("obstacle '{}': its pose is not finite, expected finite numbers", name));
}

// A placeholder for obstacles without a name would make two of them one.
void check_update(const scene::Obstacle& obstacle) {
  const std::string where = fmt::format("obstacle '{}'", obstacle.name);
  if (obstacle.name.empty())
    throw Error(ErrorCode::invalid, "obstacle: has no name, expected one to refer to it");
  check_finite(obstacle.name, obstacle.pose);
  if (!obstacle.known || obstacle.judge_only)
    throw Error(ErrorCode::invalid, fmt::format("{}: is hidden from the planner (known, "
                                                "judge_only), expected one that it is shown",
                                                where));
  scene::check(obstacle, where);
}

// Index of an obstacle; the number of obstacles if there is none.
std::size_t find_by_name(const std::vector<scene::Obstacle>& obstacles, std::string_view name) {
  return static_cast<std::size_t>(
      std::find_if(obstacles.begin(), obstacles.end(),
                   [&](const auto& obstacle) { return obstacle.name == name; }) -
      obstacles.begin());
}

std::size_t require_name(const std::vector<scene::Obstacle>& obstacles, std::string_view name) {
  const std::size_t found = find_by_name(obstacles, name);
  if (found < obstacles.size()) return found;
  const std::vector<std::string> names = names_of(obstacles);
  throw Error(ErrorCode::invalid,
              fmt::format("obstacle '{}': there is none of this name, expected one of the {} that "
                          "exist{}",
                          name, names.size(), did_you_mean(name, names)));
}

std::optional<double> observed_time(const scene::Obstacle& obstacle) {
  const auto* seen =
      obstacle.motion ? std::get_if<scene::ObservedMotion>(&*obstacle.motion) : nullptr;
  return seen != nullptr ? std::optional(seen->time_s) : std::nullopt;
}

// Without regard to the stream that it belongs to.
void check_observation(const scene::Obstacle& obstacle, const Observation& seen) {
  check_finite(obstacle.name, seen.pose);
  const auto refuse = [&](const std::string& what) {
    throw Error(ErrorCode::invalid, fmt::format("obstacle '{}': {}", obstacle.name, what));
  };
  const auto finite = [](const std::optional<Eigen::Vector3d>& v) { return !v || v->allFinite(); };
  if (!std::isfinite(seen.time_s) || !finite(seen.velocity_m_s) ||
      !finite(seen.acceleration_m_s2) || !finite(seen.angular_velocity_rad_s))
    refuse(
        "its time, velocity, acceleration or angular velocity is not finite, expected finite "
        "numbers");
  if (const auto last = observed_time(obstacle); last && seen.time_s <= *last)
    refuse(fmt::format("observed at {} s, expected a time after its last observation at {} s",
                       seen.time_s, *last));
  if (obstacle.prediction == scene::Prediction::path && obstacle.motion && !observed_time(obstacle))
    refuse("observed, but its path is known, expected another prediction or no motion");
}

// docs/theory.md (11.50)
void check_reach(const scene::Obstacle& obstacle, const MotionEstimator& stream, double noise_m,
                 const Observation& seen) {
  constexpr double deviations = 6.0;
  const double elapsed_s = seen.time_s - stream.time_s(),
               moved_m = (seen.pose.p() - stream.measured().p()).norm(),
               most_m = obstacle.speed_max_m_s * elapsed_s + deviations * std::sqrt(2.0) * noise_m;
  if (moved_m > most_m)
    throw Error(ErrorCode::invalid,
                fmt::format("obstacle '{}': moved {:.3g} m in {:.3g} s, expected at most {:.3g} m "
                            "at its speed_max of {:.3g} m/s, noise included",
                            obstacle.name, moved_m, elapsed_s, most_m, obstacle.speed_max_m_s));
}

// What is given is kept, and what is estimated is scaled so that the obstacle's stated speed bounds
// both together.
scene::ObservedMotion observed_motion(const scene::Obstacle& obstacle,
                                      const MotionEstimator& estimate, const Observation& seen) {
  scene::ObservedMotion motion{seen.time_s, seen.velocity_m_s.value_or(estimate.velocity()),
                               seen.acceleration_m_s2.value_or(estimate.acceleration()),
                               seen.angular_velocity_rad_s.value_or(estimate.angular_velocity())};
  if (obstacle.prediction == scene::Prediction::speed_bound) motion.acceleration_m_s2.setZero();
  if (obstacle.speed_max_m_s == 0.0) return motion;
  const double speeds[] = {motion.velocity_m_s.norm(),
                           motion.angular_velocity_rad_s.norm() * scene::bounding_radius(obstacle)};
  const double given = (seen.velocity_m_s ? speeds[0] : 0.0) +
                       (seen.angular_velocity_rad_s ? speeds[1] : 0.0),
               estimated = speeds[0] + speeds[1] - given;
  if (given + estimated <= obstacle.speed_max_m_s) return motion;
  const double share =
      estimated > 0.0 ? std::max(0.0, obstacle.speed_max_m_s - given) / estimated : 1.0;
  if (!seen.velocity_m_s) motion.velocity_m_s *= share;
  if (!seen.angular_velocity_rad_s) motion.angular_velocity_rad_s *= share;
  return motion;
}

}  // namespace

World::~World() = default;

World::View& World::take() noexcept {
  return newest_->take();
}

World::World(const scene::Scene& scene, const model::Model& model, const Options& options)
    : options_(options),
      scene_(scene),
      model_(model),
      movers_(std::make_unique<SensedMovers>()),
      postures_(std::make_unique<PostureHistory>(model.dof(), postures_kept)) {
  check(options_.observations);
  if (!(std::isfinite(options_.payload_reach_m) && options_.payload_reach_m >= 0.0))
    throw Error(ErrorCode::invalid,
                fmt::format("payload_reach_m: {} m, expected 0 or more", options_.payload_reach_m));
  options_.obstacles_max = std::max(options_.obstacles_max, scene.obstacles.size());
  contacts_max_ = scene::Environment::contacts_max(shapes_max(), options_.obstacles_max);
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
          std::move(ids), Changes::standing);
}

scene::Environment World::make_environment(const std::optional<scene::MapSpec>& map,
                                           const Eigen::VectorXd& q) const {
  scene::Scene scene = scene_;
  scene.map = map;
  if (scene.map) scene.map->changes.clear();
  if (scene.map && !scene.map->known) hide(*scene.map);
  scene.start_q = q;
  scene::Environment made =
      scene::make_environment(scene, model_, options_.influence_m + options_.payload_reach_m);
  if (options_.prepare) made.prepare();
  return made;
}

std::size_t World::shapes_max() const noexcept {
  return model_.shapes().size() + options_.payload_shapes;
}

World::View World::view_of_latest() const {
  std::shared_ptr<const WorldSnapshot> snapshot = latest();
  return view_of(std::move(snapshot));
}

World::View World::view_of(std::shared_ptr<const WorldSnapshot> snapshot) const {
  scene::Environment::Scratch scratch(snapshot->environment, shapes_max());
  View view{std::move(snapshot), std::move(scratch), {}};
  for (const auto& allowed : view.snapshot->allowed) view.allowed.push_back(view_of(allowed));
  return view;
}

std::uint64_t World::publish(scene::Environment environment, std::vector<std::int32_t> ids,
                             Changes changes) {
  const std::uint64_t number = latest_ ? ++last_number_ : 0;
  auto fresh = std::make_shared<WorldSnapshot>();
  fresh->number = number;
  fresh->environment = std::move(environment);
  fresh->obstacle_ids = std::move(ids);
  fresh->standing = changes == Changes::standing || !latest_ ? number : latest_->standing;
  for (const Allowed& entry : allowed_)
    fresh->allowed.push_back(snapshot_with(entry, *fresh, changes));
  std::shared_ptr<const WorldSnapshot> snapshot = std::move(fresh);
  auto view = std::make_unique<View>(view_of(snapshot));
  {
    const std::lock_guard lock(latest_mutex_);
    latest_.swap(snapshot);
  }
  if (newest_)
    newest_->publish(std::move(view));
  else
    newest_ = std::make_unique<Newest<View>>(std::move(view));
  return number;
}

std::uint64_t World::set_obstacle(scene::Obstacle obstacle) {
  check_update(obstacle);
  const std::lock_guard lock(mutex_);
  if (model_.shapes().empty())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: /robot: '{}' has no collision spheres or capsules, expected some "
                            "because there are obstacles; hamelin robot fit makes them",
                            scene_.name, model_.robot().name));
  auto obstacles = latest_->environment.obstacles();
  auto ids = latest_->obstacle_ids;
  std::optional<std::int32_t> replaced;
  Changes changes = obstacle.motion ? Changes::moving : Changes::standing;
  if (const std::size_t found = find_by_name(obstacles, obstacle.name); found < obstacles.size()) {
    if (!obstacles[found].motion) changes = Changes::standing;
    obstacles[found] = std::move(obstacle);
    replaced = ids[found];
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
  const std::uint64_t number =
      publish(latest_->environment.with_obstacles(std::move(obstacles)), std::move(ids), changes);
  if (replaced) streams_.erase(*replaced);
  return number;
}

std::uint64_t World::move_obstacle(std::string_view name, const geometry::SE3& pose,
                                   const Eigen::Vector3d& velocity_m_s, double time_s) {
  const std::lock_guard lock(mutex_);
  auto obstacles = latest_->environment.obstacles();
  const std::size_t found = require_name(obstacles, name);
  const Changes changes = obstacles[found].motion ? Changes::moving : Changes::standing;
  obstacles[found].pose = pose;
  obstacles[found].motion = scene::ObservedMotion{time_s, velocity_m_s};
  if (!velocity_m_s.allFinite() || !std::isfinite(time_s))
    throw Error(ErrorCode::invalid,
                fmt::format("obstacle '{}': its velocity or its time is not finite, expected "
                            "finite numbers",
                            name));
  check_update(obstacles[found]);
  const std::uint64_t number = publish(latest_->environment.with_obstacles(std::move(obstacles)),
                                       latest_->obstacle_ids, changes);
  streams_.erase(latest_->obstacle_ids[found]);
  return number;
}

MotionEstimator World::followed(const scene::Obstacle& obstacle, std::int32_t id,
                                const Observation& observation) const {
  const auto stream = streams_.find(id);
  const ObservationOptions& options = options_.observations;
  if (stream == streams_.end() || observation.time_s - stream->second.time_s() > options.timeout_s)
    return {options, observation.time_s, observation.pose};
  if (obstacle.speed_max_m_s > 0.0)
    check_reach(obstacle, stream->second, options.noise_m, observation);
  MotionEstimator next = stream->second;
  next.update(observation.time_s, observation.pose);
  return next;
}

std::uint64_t World::observe_obstacle(std::string_view name, const Observation& observation) {
  const std::lock_guard lock(mutex_);
  auto obstacles = latest_->environment.obstacles();
  const std::size_t found = require_name(obstacles, name);
  const std::int32_t id = latest_->obstacle_ids[found];
  scene::Obstacle& obstacle = obstacles[found];
  const Changes changes = obstacle.motion ? Changes::moving : Changes::standing;
  check_observation(obstacle, observation);
  const MotionEstimator stream = followed(obstacle, id, observation);
  obstacle.pose = observation.pose;
  obstacle.motion = observed_motion(obstacle, stream, observation);
  check_update(obstacle);
  const std::uint64_t number = publish(latest_->environment.with_obstacles(std::move(obstacles)),
                                       latest_->obstacle_ids, changes);
  streams_.insert_or_assign(id, stream);
  return number;
}

std::optional<double> World::last_observed(std::string_view name) const {
  const auto snapshot = latest();
  const auto& obstacles = snapshot->environment.obstacles();
  return observed_time(obstacles[require_name(obstacles, name)]);
}

std::uint64_t World::remove_obstacle(std::string_view name) {
  const std::lock_guard lock(mutex_);
  auto obstacles = latest_->environment.obstacles();
  const auto found = static_cast<std::ptrdiff_t>(require_name(obstacles, name));
  auto ids = latest_->obstacle_ids;
  const std::int32_t id = ids[static_cast<std::size_t>(found)];
  const Changes changes =
      obstacles[static_cast<std::size_t>(found)].motion ? Changes::moving : Changes::standing;
  obstacles.erase(obstacles.begin() + found);
  ids.erase(ids.begin() + found);
  const std::uint64_t number =
      publish(latest_->environment.with_obstacles(std::move(obstacles)), std::move(ids), changes);
  streams_.erase(id);
  return number;
}

std::uint64_t World::set_map(const std::optional<scene::MapSpec>& map, const Eigen::VectorXd& q) {
  // Reading a map may take long: other updates need not wait for it.
  const scene::Environment environment = make_environment(map, q.size() > 0 ? q : scene_.start_q);
  const std::lock_guard map_lock(map_mutex_);
  sensed_.reset();
  return publish_map(environment);
}

std::uint64_t World::change_map(const scene::MapChangeSpec& change) {
  const std::lock_guard map_lock(map_mutex_);
  const scene::Environment environment = latest()->environment.with_change(change);
  sensed_.reset();
  return publish_map(environment);
}

// What sensors see changes with each frame: a query inside computes what it needs of it.
bool World::prepares_maps() const {
  return options_.prepare && !sensed_;
}

std::uint64_t World::publish_map(const scene::Environment& environment) {
  if (prepares_maps()) environment.prepare();
  std::vector<Allowed> allowed = allowed_in(environment);
  const std::lock_guard lock(mutex_);
  allowed_ = std::move(allowed);
  return publish(environment.with_obstacles(latest_->environment.obstacles()),
                 latest_->obstacle_ids, Changes::standing);
}

std::shared_ptr<const WorldSnapshot> World::latest(std::uint64_t allowance) const {
  const std::lock_guard lock(latest_mutex_);
  if (allowance != 0)
    for (const auto& snapshot : latest_->allowed)
      if (snapshot->allowance == allowance) return snapshot;
  return latest_;
}

void World::require_obstacles(const scene::Allowance& allowance) const {
  const auto snapshot = latest();
  for (const std::string& name : allowance.obstacles)
    (void)require_name(snapshot->environment.obstacles(), name);
}

}  // namespace hamelin::control
