#include "world/sensed_movers.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "hamelin/core/error.hpp"

namespace hamelin::control {

using Update = sensing::MoverTracker::Update;

namespace {

// By so much a box is larger than what was seen of a body [m], so that it need not grow often.
constexpr double room_m = 0.04;
// From so many poses on the world knows the velocity of a body better than the tracker.
constexpr int poses_min = 4;

}  // namespace

std::string SensedMovers::name_of(std::int32_t source, std::int32_t id) {
  return fmt::format("mover {}.{}", source, id);
}

bool SensedMovers::follows(std::int32_t source, const std::string& obstacle) const {
  const auto sensor = sensors_.find(source);
  return sensor != sensors_.end() &&
         std::any_of(sensor->second.bodies.begin(), sensor->second.bodies.end(),
                     [&](const auto& body) { return name_of(source, body.first) == obstacle; });
}

Update SensedMovers::take(const PointFrame& frame, const geometry::SE3& sensor,
                          const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                          std::span<const std::uint8_t> loose) {
  const auto [entry, fresh] =
      sensors_.try_emplace(frame.source, Sensor{sensing::MoverTracker(), frame.time_s, {}});
  Sensor& state = entry->second;
  // the first frame has nothing to compare with, and frames may overtake each other
  if (!fresh && frame.time_s <= state.last_s) return {};
  state.last_s = frame.time_s;
  return state.tracker.update(frame.time_s, sensor, points, loose);
}

void SensedMovers::tell(const PointFrame& frame, const sensing::MoverTracker::Mover& mover,
                        Sensor& state, World& world) {
  Body& body = state.bodies.try_emplace(mover.id, Body{Eigen::Vector3d::Zero()}).first->second;
  const std::string name = name_of(frame.source, mover.id);
  if ((body.size_m - mover.size_m).minCoeff() < 0.0) {
    body = {mover.size_m.array() + room_m};
    scene::Obstacle box;
    box.name = name;
    box.shape = scene::Shape::box;
    box.pose = mover.pose;
    box.size_m = body.size_m;
    (void)world.set_obstacle(box);
  }
  Observation seen{frame.time_s, mover.pose};
  if (++body.poses <= poses_min) seen.velocity_m_s = mover.velocity_m_s;
  (void)world.observe_obstacle(name, seen);
}

std::uint64_t SensedMovers::tell(const PointFrame& frame, const Update& update, World& world) {
  Sensor& state = sensors_.at(frame.source);
  const auto remove = [&](std::int32_t id) {
    if (state.bodies.erase(id) == 0) return;
    try {
      (void)world.remove_obstacle(name_of(frame.source, id));
    } catch (const Error&) {  // somebody else has removed it
    }
  };
  for (const std::int32_t id : update.gone) remove(id);
  for (const auto& mover : update.movers) {
    try {
      tell(frame, mover, state, world);
    } catch (const Error&) {  // there is no room for it, or somebody else has removed it
      remove(mover.id);
      state.tracker.forget(mover.id);
    }
  }
  return world.latest()->number;
}

}  // namespace hamelin::control
