#include "updates.hpp"

#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"

namespace hamelin::test {

using Eigen::Vector3d;

namespace {

constexpr std::size_t names = 12;  // of obstacles that are not streamed
constexpr double streamed_speed_max_m_s = 0.5;
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// A place that the arm can reach, or nearly so.
Vector3d random_place(Rng& rng) {
  return {rng.uniform(-0.9, 0.9), rng.uniform(-0.9, 0.9), rng.uniform(0.0, 1.1)};
}

geometry::SE3 random_pose(Rng& rng) {
  Eigen::Vector4d wxyz(rng.normal(), rng.normal(), rng.normal(), rng.normal());
  return {geometry::rotation_from_wxyz(wxyz.normalized()), random_place(rng)};
}

std::string streamed_name(std::size_t i) {
  return "hand " + std::to_string(i);
}

// Where a streamed obstacle is, slower than its bound.
geometry::SE3 streamed_pose(std::size_t i, double time_s) {
  const double phase = static_cast<double>(i) + time_s;
  return {Eigen::Matrix3d::Identity(),
          {0.5 + 0.1 * std::sin(3.0 * phase), 0.4 * std::cos(phase), 0.6}};
}

void pause(Rng& rng, double longest_s) {
  std::this_thread::sleep_for(std::chrono::duration<double>(rng.uniform(0.0, longest_s)));
}

}  // namespace

scene::Obstacle random_obstacle(Rng& rng, std::string name) {
  scene::Obstacle obstacle;
  obstacle.name = std::move(name);
  obstacle.shape = static_cast<scene::Shape>(rng.below(4));
  obstacle.radius_m = rng.uniform(0.03, 0.1);
  obstacle.length_m = rng.uniform(0.05, 0.4);
  obstacle.size_m = {rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.3), rng.uniform(0.05, 0.3)};
  obstacle.pose = random_pose(rng);
  return obstacle;
}

Eigen::VectorXd random_joints(Rng& rng, const model::Robot& robot) {
  Eigen::VectorXd q(robot.dof());
  for (Eigen::Index i = 0; i < q.size(); ++i) {
    const auto& joint = robot.links[static_cast<std::size_t>(i)].joint;
    q[i] = rng.uniform(joint.lower.value_or(-3.0), joint.upper.value_or(3.0));
  }
  return q;
}

Updates::Updates(control::Controller& controller, const scene::Scene& scene,
                 const std::atomic<double>& now_s, Param param, std::uint64_t seed, Record record,
                 std::size_t streams)
    : controller_(controller),
      scene_(scene),
      robot_(control::load_model(scene).robot()),
      now_s_(now_s),
      param_(std::move(param)),
      record_(std::move(record)),
      streams_(streams) {
  for (std::size_t i = 0; i < streams_; ++i) {
    Rng rng(seed + i);
    scene::Obstacle obstacle = random_obstacle(rng, streamed_name(i));
    obstacle.pose = streamed_pose(i, 0.0);
    obstacle.speed_max_m_s = streamed_speed_max_m_s;
    if (i == 1) obstacle.prediction = scene::Prediction::speed_bound;
    change_world(true, counts_.obstacles, [&] { controller_.world().set_obstacle(obstacle); });
  }
  obstacles_ = std::thread([this, seed] { change_obstacles(2 * seed); });
  if (streams_ > 0) observations_ = std::thread([this, seed] { observe_obstacles(seed); });
  rest_ = std::thread([this, seed] { change_rest(2 * seed + 1); });
}

void Updates::stop() {
  stop_ = true;
  if (obstacles_.joinable()) obstacles_.join();
  if (observations_.joinable()) observations_.join();
  if (rest_.joinable()) rest_.join();
}

template <class F>
bool Updates::attempt(bool good, std::atomic<long>& count, F&& change) {
  bool accepted = true;
  try {
    change();
  } catch (const Error&) {
    accepted = false;
  }
  ++(accepted ? count : counts_.refused);
  if (accepted != good) ++counts_.wrong;
  return accepted;
}

template <class F>
void Updates::change_world(bool good, std::atomic<long>& count, F&& change) {
  if (attempt(good, count, std::forward<F>(change)) && record_.world)
    record_.world(controller_.world().latest());
}

void Updates::change_obstacles(std::uint64_t seed) {
  Rng rng(seed);
  std::set<std::string> present;
  control::World& world = controller_.world();
  while (!stop_) {
    const std::string name = "thing " + std::to_string(rng.below(names));
    const bool there = present.contains(name);
    const std::uint64_t choice = rng.below(16);
    if (choice < 8) {
      const bool room = there || present.size() + streams_ < world.obstacles_max();
      change_world(room, counts_.obstacles,
                   [&] { world.set_obstacle(random_obstacle(rng, name)); });
      if (room) present.insert(name);
    } else if (choice < 12) {
      const Vector3d velocity = 0.2 * random_place(rng);
      change_world(there, counts_.obstacles,
                   [&] { world.move_obstacle(name, random_pose(rng), velocity, now_s_); });
    } else if (choice < 15) {
      change_world(there, counts_.obstacles, [&] { world.remove_obstacle(name); });
      present.erase(name);
    } else {
      change_world(false, counts_.obstacles, [&] {
        world.move_obstacle(name, {Eigen::Matrix3d::Identity(), {nan, 0.0, 0.0}}, Vector3d::Zero(),
                            now_s_);
      });
    }
    pause(rng, 1e-4);
  }
}

void Updates::observe_obstacles(std::uint64_t seed) {
  Rng rng(seed);
  std::vector<double> last_s(streams_, -1.0);
  while (!stop_) {
    const std::size_t i = rng.below(streams_);
    if (rng.below(4) == 0 && last_s[i] >= 0.0) {
      observe_wrongly(rng, streamed_name(i), last_s[i]);
    } else if (const double time_s = now_s_ - 0.02; time_s > last_s[i]) {  // it arrives late
      control::Observation seen{time_s, streamed_pose(i, time_s)};
      if (i == 0 && rng.below(2) == 0) seen.velocity_m_s = Vector3d(0.0, 0.1, 0.0);
      change_world(true, counts_.observations,
                   [&] { controller_.world().observe_obstacle(streamed_name(i), seen); });
      last_s[i] = time_s;
    }
    pause(rng, 1e-4);
  }
}

// Times that repeat or fall, a pose that is not finite, a jump, or an unknown name.
void Updates::observe_wrongly(Rng& rng, const std::string& name, double last_s) {
  control::Observation seen{last_s + 1e-3, {Eigen::Matrix3d::Identity(), {0.5, 0.0, 0.6}}};
  const std::uint64_t choice = rng.below(5);
  if (choice == 0) seen.time_s = last_s;
  if (choice == 1) seen.time_s = last_s - rng.uniform();
  if (choice == 2) seen.pose = {Eigen::Matrix3d::Identity(), {0.0, nan, 0.0}};
  if (choice == 3) seen.pose = {Eigen::Matrix3d::Identity(), {5.0, 0.0, 0.0}};
  change_world(false, counts_.observations, [&] {
    controller_.world().observe_obstacle(choice == 4 ? "nobody's hand" : name, seen);
  });
}

void Updates::change_rest(std::uint64_t seed) {
  Rng rng(seed);
  while (!stop_) {
    set_goals(rng);
    pause(rng, 1e-3);
    set_params(rng);
    pause(rng, 1e-3);
    change_map(rng);
    pause(rng, 1e-3);
  }
}

void Updates::set_goals(Rng& rng) {
  const bool good = rng.below(8) != 0;
  std::vector<scene::Goal> goals{scene::joint_goal(random_joints(rng, robot_))};
  if (rng.below(2) == 0) {  // some are reached at once, so that the next one becomes current
    goals.front().tolerance_rad = 10.0;
    goals.front().speed_max = 10.0;
  }
  if (rng.below(2) == 0) goals.push_back(scene::position_goal(random_place(rng)));
  if (!good) goals.back() = scene::position_goal({0.0, nan, 0.0});
  attempt(good, counts_.goals, [&] {
    const std::uint64_t number = controller_.set_goals(goals);
    if (record_.goals) record_.goals(number, goals);
  });
}

void Updates::set_params(Rng& rng) {
  const bool good = rng.below(8) != 0;
  const Json params{{param_.name, good ? rng.uniform(param_.low, param_.high) : -1.0}};
  if (good && record_.before_params) record_.before_params(params);
  attempt(good, counts_.params, [&] { controller_.set_planner_params(params); });
}

void Updates::change_map(Rng& rng) {
  control::World& world = controller_.world();
  const std::uint64_t choice = rng.below(64);
  if (choice < 8) {
    scene::MapChangeSpec change;
    const Vector3d low = random_place(rng), edges = Vector3d::Constant(rng.uniform(0.02, 0.2));
    (rng.below(2) == 0 ? change.occupied_m : change.free_m).push_back({low, low + edges});
    change_world(true, counts_.maps, [&] { world.change_map(change); });
  } else if (choice == 8) {
    scene::MapSpec map = *scene_.map;
    const std::array files{"clutter.bt", "shelf.bt"};
    map.file = map.file.parent_path() / files[rng.below(2)];
    change_world(true, counts_.maps, [&] { world.set_map(map); });
  } else if (choice == 9) {
    scene::MapSpec map = *scene_.map;
    map.file = map.file.parent_path() / "clutter.primitives.json";  // not a map
    change_world(false, counts_.maps, [&] { world.set_map(map); });
  }
}

}  // namespace hamelin::test
