#include "sensor_feed.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/dynamics/frames.hpp"
#include "scene_places.hpp"

namespace hamelin::simulation {

namespace {

// Noise of other parts of a run comes from the seed itself.
constexpr std::uint64_t noise_stream = 0x5e2501;

// The index of a camera's frame; 0 without one.
int frame_of(const scene::SensorSpec& spec, const model::Model& model, const std::string& place) {
  return spec.mount == scene::Mount::frame ? named_frame(model, spec.frame, place) : 0;
}

}  // namespace

SensorFeed::SensorFeed(const scene::Scene& scene, const model::Model& model)
    : model_(model),
      noise_(scene.seed ^ noise_stream),
      sees_map_(std::none_of(scene.obstacles.begin(), scene.obstacles.end(),
                             [](const auto& o) { return o.judge_only; })) {
  for (const scene::SensorSpec& spec : scene.sensors)
    cameras_.push_back(
        {spec,
         frame_of(spec, model, fmt::format("{}: /sensors/{}/frame", scene.name, cameras_.size())),
         sensing::DepthRenderer(
             {spec.width, spec.height, spec.fov_rad, spec.range_m, spec.noise_m})});
}

void SensorFeed::see_solids(double time_s, control::WorldView& truth) {
  solids_.clear();
  for (const scene::Obstacle& obstacle : truth.environment().obstacles())
    if (obstacle.shape != scene::Shape::frame && scene::exists(obstacle, time_s))
      solids_.push_back({obstacle, scene::motion_at(obstacle, time_s).pose});
  sensing::add_solids(truth.arm(), solids_);
  sensing::add_solids(scene::BaseShapes(model_).view(), solids_);
}

control::PointFrame SensorFeed::look(Camera& camera, double time_s, control::WorldView& truth) {
  control::PointFrame frame;
  frame.sensor = camera.spec.pose;
  frame.mount = camera.spec.mount;
  frame.frame = camera.spec.frame;
  frame.source = static_cast<std::int32_t>(&camera - cameras_.data());
  frame.time_s = time_s;
  frame.range_m = camera.spec.range_m;
  geometry::SE3 pose = camera.spec.pose;
  if (camera.spec.mount == scene::Mount::tip)
    pose = dynamics::tip_pose(model_, truth.poses()) * pose;
  else if (camera.spec.mount == scene::Mount::base)
    pose = model_.base() * pose;
  else if (camera.spec.mount == scene::Mount::frame)
    pose = dynamics::frame_pose(model_, truth.poses(), camera.frame) * pose;
  frame.points = camera.renderer.render(pose, solids_, noise_);
  return frame;
}

std::vector<scene::VoxelBox> SensorFeed::first_seen(const scene::MapChange& change) {
  std::vector<scene::VoxelBox> out;
  for (const scene::VoxelBox& run : change.occupied)
    for (std::int32_t x = run.lo[0]; x < run.hi[0]; ++x) {
      if (!seen_.insert({run.lo[2], run.lo[1], x}).second) continue;
      const bool goes_on = x > run.lo[0] && !out.empty() && out.back().hi[0] == x &&
                           out.back().lo[1] == run.lo[1] && out.back().lo[2] == run.lo[2];
      if (goes_on)
        ++out.back().hi[0];
      else
        out.push_back({{x, run.lo[1], run.lo[2]}, {x + 1, run.lo[1] + 1, run.lo[2] + 1}});
    }
  return out;
}

void SensorFeed::advance(
    double time_s, control::WorldView& truth, control::Controller& controller,
    const std::function<void(const std::string&)>& refused,
    const std::function<void(const std::string&, const std::vector<scene::VoxelBox>&)>& seen) {
  for (; !pending_.empty() && pending_.front().due_s <= time_s + time_rounding_s;
       pending_.pop_front()) {
    const Pending& pending = pending_.front();
    ++figures_.frames;
    try {
      const control::FrameReport report = controller.world().insert_points(pending.frame);
      figures_.points += report.points;
      figures_.on_arm += report.on_arm;
      figures_.occupied += report.occupied;
      figures_.cleared += report.cleared;
      if (const auto fresh = first_seen(report.change); !fresh.empty()) seen(pending.camera, fresh);
    } catch (const Error& e) {
      ++figures_.refused;
      refused(pending.camera + ": " + e.what());
    }
  }
  if (!std::exchange(map_is_read_, true) && sees_map_)
    for (Camera& camera : cameras_) camera.renderer.set_map(truth.environment());
  for (Camera& camera : cameras_) {
    if (static_cast<double>(camera.frames) > (time_s + time_rounding_s) * camera.spec.rate_hz)
      continue;
    ++camera.frames;
    see_solids(time_s, truth);
    Pending fresh{time_s + camera.spec.delay_s, camera.spec.name, look(camera, time_s, truth)};
    const auto after = std::find_if(pending_.begin(), pending_.end(), [&](const Pending& other) {
      return other.due_s > fresh.due_s;
    });
    pending_.insert(after, std::move(fresh));
  }
}

}  // namespace hamelin::simulation
