#include "world_updates.hpp"

#include <algorithm>
#include <limits>

#include "hamelin/core/error.hpp"
#include "shield/shield.hpp"

namespace hamelin::test {

using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr std::size_t names = 8;
constexpr int samples_of_stop = 12, samples_before = 4;
// The map occupies whole voxels.
constexpr double voxel_m = 0.05;

Vector3d random_place(Rng& rng) {
  return {rng.uniform(-0.8, 0.9), rng.uniform(-0.8, 0.8), rng.uniform(0.0, 1.1)};
}

geometry::SE3 random_pose(Rng& rng) {
  const Eigen::Vector4d wxyz(rng.normal(), rng.normal(), rng.normal(), rng.normal());
  return {geometry::rotation_from_wxyz(wxyz.normalized()), random_place(rng)};
}

scene::Obstacle random_obstacle(Rng& rng, std::string name) {
  scene::Obstacle obstacle;
  obstacle.name = std::move(name);
  obstacle.shape = static_cast<scene::Shape>(rng.below(4));
  obstacle.radius_m = rng.uniform(0.01, 0.1);
  obstacle.length_m = rng.uniform(0.05, 0.4);
  obstacle.size_m = {rng.uniform(0.02, 0.3), rng.uniform(0.02, 0.3), rng.uniform(0.02, 0.3)};
  obstacle.pose = random_pose(rng);
  return obstacle;
}

double distance(const scene::Obstacle& obstacle, const scene::Shapes& arm) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < arm.size(); ++i) {
    const double axis =
        arm.is_capsule(i)
            ? scene::closest_on(obstacle, obstacle.pose, arm.from(i), arm.to(i)).distance
            : scene::closest_on(obstacle, obstacle.pose, arm.centers[i]).distance;
    least = std::min(least, axis - arm.radii[i]);
  }
  return least;
}

}  // namespace

WorldUpdates::WorldUpdates(control::Controller& controller, const VectorXd& arm_q, bool has_map,
                           std::uint64_t seed)
    : controller_(controller), arm_q_(arm_q), has_map_(has_map), rng_(seed) {}

std::vector<VectorXd> WorldUpdates::configurations() const {
  std::vector<VectorXd> out{arm_q_};
  const control::Shield* const shield = controller_.shield();
  if (shield == nullptr) return out;
  const control::FailSafe& motion = shield->stop().motion();
  const double now = shield->stop().time_s(), end = std::max(now, motion.duration_s());
  VectorXd q(arm_q_.size()), v(arm_q_.size());
  motion.at(now, q, v);
  for (int i = 1; i <= samples_before; ++i)
    out.emplace_back(arm_q_ + static_cast<double>(i) / samples_before * (q - arm_q_));
  for (int i = 1; i <= samples_of_stop; ++i) {
    motion.at(now + (end - now) * i / samples_of_stop, q, v);
    out.push_back(q);
  }
  return out;
}

bool WorldUpdates::is_fair(const scene::Obstacle& obstacle) {
  const model::Model& model = controller_.model();
  dynamics::Workspace ws(model);
  scene::PlacedShapes arm(model);
  for (const VectorXd& q : configurations()) {
    dynamics::forward_kinematics(model, ws, q);
    arm.place(model, ws);
    if (distance(obstacle, arm.view()) < fair_m) return false;
  }
  return true;
}

std::string WorldUpdates::random_name() {
  return "thing " + std::to_string(rng_.below(names));
}

bool WorldUpdates::update(double time_s) {
  switch (rng_.below(8)) {
    case 0:
    case 1:
    case 2:
      return set_obstacle();
    case 3:
    case 4:
      return move_obstacle(time_s);
    case 5:
      return remove_obstacle();
    case 6:
      return change_map();
    default:
      return update_wrongly(time_s);
  }
}

bool WorldUpdates::set_obstacle() {
  // near the arm more often than chance would have it
  for (int i = 0; i < 8; ++i) {
    scene::Obstacle obstacle = random_obstacle(rng_, random_name());
    if (!is_fair(obstacle)) continue;
    controller_.world().set_obstacle(obstacle);
    std::erase_if(present_, [&](const auto& other) { return other.name == obstacle.name; });
    present_.push_back(std::move(obstacle));
    return true;
  }
  return false;
}

bool WorldUpdates::move_obstacle(double time_s) {
  if (present_.empty()) return false;
  scene::Obstacle& obstacle = present_[rng_.below(present_.size())];
  const bool moves = rng_.below(2) == 0;
  scene::Obstacle there = obstacle;
  there.pose = random_pose(rng_);
  if (!moves && !is_fair(there)) return false;
  const Vector3d velocity = moves ? Vector3d(random_place(rng_)) : Vector3d::Zero();
  controller_.world().move_obstacle(obstacle.name, there.pose, velocity, time_s);
  obstacle.pose = there.pose;
  return true;
}

bool WorldUpdates::remove_obstacle() {
  if (present_.empty()) return false;
  const auto gone = present_.begin() + static_cast<std::ptrdiff_t>(rng_.below(present_.size()));
  controller_.world().remove_obstacle(gone->name);
  present_.erase(gone);
  return true;
}

bool WorldUpdates::change_map() {
  if (!has_map_) return false;
  scene::MapChangeSpec change;
  const Vector3d low = random_place(rng_), edges = Vector3d::Constant(rng_.uniform(0.02, 0.2));
  if (rng_.below(3) == 0) {
    change.free_m.push_back({low, low + edges});
  } else {
    scene::Obstacle box;
    box.shape = scene::Shape::box;
    box.size_m = edges + Vector3d::Constant(2.0 * voxel_m);
    box.pose = controller_.world().latest()->environment.map_pose() *
               geometry::SE3{Eigen::Matrix3d::Identity(), low + 0.5 * edges};
    if (!is_fair(box)) return false;
    change.occupied_m.push_back({low, low + edges});
  }
  controller_.world().change_map(change);
  return true;
}

// What must be refused.
bool WorldUpdates::update_wrongly(double time_s) {
  try {
    scene::Obstacle nowhere = random_obstacle(rng_, random_name());
    nowhere.pose = {Eigen::Matrix3d::Identity(),
                    Vector3d::Constant(std::numeric_limits<double>::quiet_NaN())};
    if (rng_.below(2) == 0)
      controller_.world().set_obstacle(nowhere);
    else
      controller_.world().move_obstacle("nothing", {}, Vector3d::Zero(), time_s);
  } catch (const Error&) {
    ++refused_;
    return false;
  }
  return true;
}

}  // namespace hamelin::test
