#include "stage.hpp"

#include <algorithm>
#include <cmath>

#include "hamelin/control/plan_paths.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/payload.hpp"

namespace hamelin::task {

using Eigen::Vector3d;
using geometry::SE3;

namespace {

// So many voxels below an object, and beside its lower end, it may touch them: what it stands on is
// known no better.
constexpr double touched_voxels = 1.5;
// By which shapes that cover an object may stick out of it [m].
constexpr double cover_m = 0.008;

// Half of the extent of a solid along the axes of the world.
Vector3d half_extent(const scene::Obstacle& solid, const Eigen::Matrix3d& R) {
  if (solid.shape == scene::Shape::box) return 0.5 * R.cwiseAbs() * solid.size_m;
  const Eigen::Array3d along = R.col(2).array().abs();
  const Eigen::Array3d axis = 0.5 * solid.length_m * along;
  if (solid.shape != scene::Shape::cylinder) return axis + solid.radius_m;
  return axis + solid.radius_m * (1.0 - along.square()).max(0.0).sqrt();
}

// The box of the axes of another frame that holds one of the world's.
scene::Box box_in(const SE3& frame, const scene::Box& box) {
  const Vector3d center = frame.inverse() * Vector3d(0.5 * (box.lo + box.hi));
  const Vector3d half = 0.5 * frame.R().transpose().cwiseAbs() * (box.hi - box.lo);
  return {center - half, center + half};
}

}  // namespace

control::World::Options Stage::options_for(const Task& task) {
  control::World::Options options;
  options.obstacles_max = std::max(options.obstacles_max, task.scene.obstacles.size());
  for (const Object& object : task.objects)
    for (const SE3& grasp : object.grasps) {
      const double reach = grasp.inverse().p().norm() + scene::bounding_radius(object.solid);
      options.payload_reach_m = std::max(options.payload_reach_m, reach + cover_m);
    }
  constexpr std::size_t shapes_max = 64;
  options.payload_shapes = shapes_max;
  return options;
}

Stage::Stage(const Task& task, std::function<void()> poll)
    : task_(task),
      poll_(std::move(poll)),
      bare_(control::load_model(task.scene)),
      ws_(bare_),
      world_(task.scene, bare_, options_for(task)),
      present_(task.objects.size(), true) {
  take_out_of_map();
}

// What the object stands on keeps its voxels, also if they reach into it somewhat. A voxel that
// only touches it may have been marked.
void Stage::take_out_of_map() {
  constexpr double kept_voxels = 0.5, touching_m = 1e-3;
  for (const Object& object : task_.objects) {
    if (!object.in_map) continue;
    const double kept = kept_voxels * world_.latest()->environment.summary().resolution_m;
    const Vector3d half =
        half_extent(object.solid, object.solid.pose.R()) + Vector3d::Constant(touching_m);
    const scene::Box box{object.solid.pose.p() - half + kept * Vector3d::UnitZ(),
                         object.solid.pose.p() + half};
    if (!freed_) freed_.emplace();
    freed_->free_m.push_back(box_in(task_.scene.map->pose, box));
  }
  if (freed_) world_.change_map(*freed_);
}

SE3 Stage::tip(const Eigen::VectorXd& q) {
  dynamics::forward_kinematics(bare_, ws_, q);
  return dynamics::tip_pose(bare_, ws_);
}

void Stage::arrange(const Situation& situation) {
  for (std::size_t i = 0; i < present_.size(); ++i) {
    scene::Obstacle solid = task_.objects[i].solid;
    const bool is_held = situation.held && situation.held->object == i;
    if (is_held && present_[i]) world_.remove_obstacle(solid.name);
    present_[i] = !is_held;
    if (is_held) continue;
    solid.pose = situation.poses[i];
    world_.set_obstacle(std::move(solid));
  }
}

std::optional<Stage::Way> Stage::search(const Situation& from, const scene::Goal& goal, int round) {
  arrange(from);
  scene::Scene scene = task_.scene;
  scene.start_q = from.q;
  scene.start_v.resize(0);
  scene.goals = {goal};
  scene.seed += static_cast<std::uint64_t>(round);
  const model::Model arm =
      from.held ? scene::carrying(bare_, {&from.held->payload, 1}, scene.model.self_collision,
                                  scene.safety.margin_m, from.held->q)
                : bare_;
  const control::PathPlan plan =
      control::plan_paths(scene, arm, world_, {.motions = true, .poll = poll_});
  const control::PlannedGoal& found = plan.goals.front();
  cause_ = found.path.found() ? found.motion_cause : found.path.cause;
  if (!found.path.found() || !found.motion) return std::nullopt;
  return Way{found.path.points, found.path.goal};
}

scene::Allowance Stage::around(std::size_t object, const std::vector<SE3>& poses,
                               const scene::Allowance& support) const {
  const scene::Obstacle& solid = task_.objects[object].solid;
  scene::Allowance out = support;
  out.obstacles.push_back(solid.name);
  if (!task_.scene.map) return out;
  const double near_m =
      cover_m + touched_voxels * world_.latest()->environment.summary().resolution_m;
  scene::Box box;
  for (const SE3& pose : poses) {
    const Vector3d half = half_extent(solid, pose.R());
    const Vector3d low = pose.p() - half - Vector3d::Constant(near_m);
    Vector3d high = pose.p() + half + Vector3d::Constant(near_m);
    high.z() = pose.p().z() - half.z() + near_m;
    const bool first = &pose == &poses.front();
    box = {first ? low : low.cwiseMin(box.lo), first ? high : high.cwiseMax(box.hi)};
  }
  out.boxes_m.push_back(box_in(task_.scene.map->pose, box));
  return out;
}

}  // namespace hamelin::task
