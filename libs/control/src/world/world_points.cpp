// What depth sensors see becomes part of the map.
#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include "hamelin/control/world.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/frames.hpp"
#include "hamelin/sensing/self_filter.hpp"
#include "world/posture_history.hpp"
#include "world/sensed_map.hpp"
#include "world/sensed_movers.hpp"

namespace hamelin::control {

using Eigen::Matrix3Xf;

namespace {

// Frames may be seen after the last tick by as much [s].
constexpr double ahead_max_s = 0.010;
// Between two postures that a frame's time leaves possible an arm moves little [s].
constexpr double posture_step_s = 0.005;
// More loads than an arm takes and leaves while frames are on their way.
constexpr std::size_t loads_kept = 16;

[[noreturn]] void refuse(const std::string& what) {
  throw Error(ErrorCode::invalid, "points: " + what);
}

void transform(const geometry::SE3& pose, Matrix3Xf& points) {
  const Eigen::Matrix3f R = pose.R().cast<float>();
  const Eigen::Vector3f p = pose.p().cast<float>();
  points = ((R * points).colwise() + p).eval();
}

int frame_index(const PointFrame& seen, const model::Model& model) {
  try {
    return model.frame(seen.frame);
  } catch (const Error& e) {
    refuse(std::string("the sensor's mount: ") + e.what());
  }
}

// Pose in the world of what carries the sensor, after dynamics::forward_kinematics.
geometry::SE3 mount_of(const PointFrame& seen, const model::Model& model,
                       const dynamics::Workspace& ws) {
  switch (seen.mount) {
    case scene::Mount::world:
      return {};
    case scene::Mount::base:
      return model.base();
    case scene::Mount::tip:
      return dynamics::tip_pose(model, ws);
    case scene::Mount::frame:
      return dynamics::frame_pose(model, ws, frame_index(seen, model));
  }
  refuse("the sensor's mount is unknown, expected the world, the base, the tip or a frame");
}

// Moves points that are not on the arm, in none of its postures, to the front: docs/theory.md
// (20.3).
Eigen::Index remove_arms(const model::Model& model, const std::vector<Eigen::VectorXd>& postures,
                         double margin_m, dynamics::Workspace& ws, Matrix3Xf& points) {
  Eigen::Index kept = points.cols();
  const auto remove = [&](const scene::Shapes& shapes) {
    kept = sensing::remove_arm(shapes, margin_m, points.leftCols(kept));
  };
  scene::PlacedShapes arm(model);
  for (const Eigen::VectorXd& q : postures) {
    dynamics::forward_kinematics(model, ws, q);
    arm.place(model, ws);
    remove(arm.view());
  }
  remove(scene::BaseShapes(model).view());
  return kept;
}

// Moves points that are not on a known obstacle, at their time, to the front.
Eigen::Index remove_obstacles(const scene::Environment& environment, double time_s, double margin_m,
                              const std::function<bool(const scene::Obstacle&)>& is_known,
                              Eigen::Ref<Matrix3Xf> points) {
  Eigen::Index kept = points.cols();
  for (const scene::Obstacle& obstacle : environment.obstacles()) {
    if (obstacle.shape == scene::Shape::frame || !scene::exists(obstacle, time_s) ||
        !is_known(obstacle))
      continue;
    const geometry::SE3 pose = scene::placed_at(obstacle, time_s).pose;
    const double reach = scene::bounding_radius(obstacle) + margin_m;
    const auto on = [&](const Eigen::Vector3d& p) {
      return (p - pose.p()).squaredNorm() <= reach * reach &&
             scene::closest_on(obstacle, pose, p).distance <= margin_m;
    };
    Eigen::Index rest = 0;
    for (Eigen::Index i = 0; i < kept; ++i)
      if (!on(points.col(i).cast<double>())) points.col(rest++) = points.col(i);
    kept = rest;
  }
  return kept;
}

void remove_taken(const std::vector<std::uint8_t>& taken, Matrix3Xf& points) {
  Eigen::Index rest = 0;
  for (std::size_t i = 0; i < taken.size(); ++i)
    if (taken[i] == 0) points.col(rest++) = points.col(static_cast<Eigen::Index>(i));
  if (!taken.empty()) points.conservativeResize(3, rest);
}

}  // namespace

struct World::SeenArm {
  std::shared_ptr<const model::Model> model;
  std::vector<Eigen::VectorXd> postures;  ///< the first is that of the time itself
};

struct World::SeenPoints {
  geometry::SE3 sensor;  ///< its pose in the world
  Matrix3Xf points;      ///< in the world, without those on what is known
  FrameReport report;
};

void World::note_posture(double time_s, const Eigen::VectorXd& q, std::uint64_t load) noexcept {
  postures_->record(time_s, q, load);
}

void World::note_load(std::uint64_t load, model::Model model) {
  const std::lock_guard lock(loads_mutex_);
  loads_.insert_or_assign(load, std::make_shared<const model::Model>(std::move(model)));
  while (loads_.size() > loads_kept) loads_.erase(loads_.begin());
}

World::SeenArm World::arm_seen_by(const PointFrame& frame, const scene::PointsSpec& spec) const {
  // the world outlives the frame
  const auto unloaded = [&] {
    return std::shared_ptr<const model::Model>(std::shared_ptr<void>(), &model_);
  };
  const auto newest = postures_->newest();
  // before the first tick the arm is at the start
  if (!newest) {
    const bool given = scene_.start_q.size() > 0;
    return {unloaded(),
            {given ? scene_.start_q : Eigen::VectorXd(Eigen::VectorXd::Zero(model_.dof()))}};
  }
  const double age_s = newest->time_s - frame.time_s;
  if (age_s < -ahead_max_s)
    refuse(fmt::format("seen at {} s, expected at most {} s after the last tick at {} s",
                       frame.time_s, ahead_max_s, newest->time_s));
  const auto at_time = age_s <= spec.age_max_s ? postures_->at(frame.time_s) : std::nullopt;
  if (!at_time)
    refuse(
        fmt::format("seen at {} s, {:.3g} s before the last tick, expected at most {} s, and "
                    "that the arm's posture then is known",
                    frame.time_s, age_s, spec.age_max_s));
  SeenArm seen;
  {
    const std::lock_guard lock(loads_mutex_);
    const auto load = loads_.find(at_time->load);
    if (load != loads_.end())
      seen.model = load->second;
    else if (at_time->load == 0)
      seen.model = unloaded();
    else
      refuse(fmt::format("seen at {} s, expected a later time: what the arm carried then is gone",
                         frame.time_s));
  }
  seen.postures.push_back(at_time->q);
  const int steps = static_cast<int>(std::ceil(spec.time_error_s / posture_step_s));
  for (int k = 1; k <= steps; ++k)
    for (const double way_s : {-spec.time_error_s, spec.time_error_s})
      if (const auto other = postures_->at(frame.time_s + way_s * k / steps))
        seen.postures.push_back(other->q);
  return seen;
}

World::SeenPoints World::seen_points(const PointFrame& frame,
                                     const scene::Environment& environment) const {
  const scene::PointsSpec& spec = environment.map_spec()->points;
  const SeenArm seen = arm_seen_by(frame, spec);
  const model::Model& model = *seen.model;
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, seen.postures.front());
  SeenPoints out{mount_of(frame, model, ws) * frame.sensor, frame.points, {}};
  transform(out.sensor, out.points);
  const auto keep = [&](Eigen::Index kept) {
    const Eigen::Index removed = out.points.cols() - kept;
    out.points.conservativeResize(3, kept);
    return static_cast<std::size_t>(removed);
  };
  out.report.on_arm = keep(remove_arms(model, seen.postures, spec.margin_m, ws, out.points));
  const auto is_known = [&](const scene::Obstacle& obstacle) {
    return !movers_->follows(frame.source, obstacle.name);
  };
  out.report.on_obstacles =
      keep(remove_obstacles(environment, frame.time_s, spec.margin_m, is_known, out.points));
  return out;
}

FrameReport World::insert_points(const PointFrame& frame) {
  check(frame);
  const std::lock_guard map_lock(map_mutex_);
  const scene::Environment environment = latest()->environment;
  const auto& map = environment.map_spec();
  if (!map)
    refuse(
        "there is no map, expected one, if only {\"resolution_m\": 0.01}, where nothing is known");
  SeenPoints seen = seen_points(frame, environment);
  FrameReport& report = seen.report;
  if (!sensed_) sensed_ = std::make_unique<SensedMap>(environment);
  const geometry::SE3 map_from_world = environment.map_pose().inverse();
  const Eigen::Vector3d origin = map_from_world * seen.sensor.p();
  if (sensed_->occupied(origin))
    refuse(
        fmt::format("seen from ({:.4g}, {:.4g}, {:.4g}) m in the map, which is occupied, "
                    "expected a sensor in free or unknown space",
                    origin.x(), origin.y(), origin.z()));
  Matrix3Xf points = seen.points;
  transform(map_from_world, points);
  sensing::MoverTracker::Update moving;
  if (map->points.movers) {
    moving = movers_->take(frame, seen.sensor, seen.points, sensed_->loose(points, frame.time_s));
    remove_taken(moving.taken, points);
  }
  report.movers = moving.movers.size();
  report.points = static_cast<std::size_t>(points.cols());
  report.snapshot = latest()->number;
  report.change = sensed_->insert(points, origin, frame.range_m, frame.time_s);
  report.occupied = scene::voxels_in(report.change.occupied);
  report.cleared = scene::voxels_in(report.change.free);
  if (report.occupied + report.cleared > 0)
    report.snapshot = publish_map(environment.with_change(report.change));
  if (!moving.movers.empty() || !moving.gone.empty())
    report.snapshot = movers_->tell(frame, moving, *this);
  return report;
}

}  // namespace hamelin::control
