// The random obstacles of N. Covic, B. Lacevic, D. Osmankovic, T. Uzunovic, "Real-time
// sampling-based safe motion planning for robotic manipulators in dynamic environments", 2025,
// doi:10.48550/arXiv.2501.00507. docs/benchmark.md says what differs.
#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "movers.hpp"

namespace hamelin::bench {

using Eigen::Vector3d;

namespace {

constexpr double workspace_radius_m = 1.5, workspace_height_m = 0.267;  // ball and its centre
constexpr double joint_speed_max = 3.1416;  // of the first joint [rad/s]
constexpr double base_radius_m = 0.12;
constexpr double start_clearance_m = 0.3, goal_clearance_m = 0.05;
constexpr double step_s = 0.02;                  // of the motion between two turns
constexpr double grain_s = 0.03, turn_s = 0.06;  // between way-points; half the time of a turn
constexpr double leg_min_s = 2.0 * (turn_s + grain_s) + step_s;
constexpr int directions_max = 200;

/// Where the centre of a cube may be: in a ball, above the ground, and away from the arm's base by
/// what the first joint needs to escape.
class Workspace {
 public:
  Workspace(double side_m, double speed_m_s)
      : free_radius_m_(
            std::max(speed_m_s / joint_speed_max, base_radius_m + side_m * std::numbers::sqrt3)) {}
  [[nodiscard]] bool contains(const Vector3d& p) const {
    const double from_center = (p - Vector3d(0.0, 0.0, workspace_height_m)).norm();
    const bool beside_base = p.head<2>().norm() < free_radius_m_ && p.z() < workspace_height_m;
    return from_center <= workspace_radius_m && p.z() >= 0.0 && !beside_base &&
           from_center >= free_radius_m_;
  }

 private:
  double free_radius_m_;
};

/// A part of the way at constant velocity.
struct Leg {
  double start_s = 0.0;
  Vector3d start, velocity;
};

/// Legs until a time; where the next step would leave the workspace, a new direction is drawn.
/// Empty if there is none.
std::vector<Leg> draw_legs(Rng& rng, const Workspace& workspace, const Vector3d& start,
                           double speed, double until_s) {
  std::vector<Leg> legs;
  Vector3d p = start;
  double now = 0.0;
  const auto suffices = [&](int steps) {
    return steps * step_s >= leg_min_s || now + steps * step_s >= until_s;
  };
  while (now < until_s) {
    int steps = 0;
    Vector3d velocity = Vector3d::Zero();
    for (int i = 0; i < directions_max && !suffices(steps); ++i) {
      velocity = speed * random_direction(rng);
      steps = 0;
      while (now + steps * step_s < until_s &&
             workspace.contains(p + (steps + 1) * step_s * velocity))
        ++steps;
    }
    if (!suffices(steps)) return {};
    legs.push_back({now, p, velocity});
    now += steps * step_s;
    p += steps * step_s * velocity;
  }
  return legs;
}

/// The place on the legs, with turns of constant acceleration instead of corners.
Vector3d place(const std::vector<Leg>& legs, double time_s) {
  std::size_t i = legs.size() - 1;
  while (i > 0 && legs[i].start_s > time_s + turn_s) --i;
  const Leg& leg = legs[i];
  const double since = time_s - leg.start_s;
  if (i == 0 || since >= turn_s) return leg.start + since * leg.velocity;
  const Vector3d before = legs[i - 1].velocity;
  const double turned = (since + turn_s) / (2.0 * turn_s);
  return leg.start - turn_s * before +
         2.0 * turn_s * (turned * before + 0.5 * turned * turned * (leg.velocity - before));
}

/// Way-points are dense at turns. A path begins and ends at rest, so it begins before the run, and
/// ends after it, with some more in which it speeds up and slows down.
std::vector<scene::Waypoint> waypoints(const std::vector<Leg>& legs, double until_s) {
  std::vector<scene::Waypoint> points;
  const auto add = [&](double time_s, const Vector3d& p) {
    scene::Waypoint w;
    w.time_s = std::round(1e3 * time_s) / 1e3;
    w.position_m = rounded_m(p);
    points.push_back(w);
  };
  constexpr int ramp = 4;  // way-points from rest to the speed
  const Vector3d first = legs.front().velocity, last = legs.back().velocity;
  // At −(k + 1) grains, the way that is missing to the line is that of a constant acceleration.
  const auto lag = [&](int k) { return 0.5 * grain_s * k * k / ramp; };
  for (int k = ramp; k >= 0; --k)
    add(-(k + 1) * grain_s, place(legs, -(k + 1) * grain_s) + lag(k) * first);
  for (std::size_t i = 1; i < legs.size(); ++i)
    for (int k = -3; k <= 3; ++k)
      add(legs[i].start_s + k * grain_s, place(legs, legs[i].start_s + k * grain_s));
  const double end_s = std::max(until_s, legs.back().start_s + 4.0 * grain_s);
  for (int k = 0; k <= ramp; ++k)
    add(end_s + k * grain_s, place(legs, end_s + k * grain_s) - lag(k) * last);
  return points;
}

std::optional<std::vector<scene::Obstacle>> draw_cube(Rng& rng, const ArmWay& way,
                                                      const MoverRequest& request) {
  const double side = rounded_m(rng.uniform(0.01, 0.1)),
               speed = rng.uniform(0.0, request.speed_max_m_s),
               radius = rng.uniform(0.0, workspace_radius_m),
               azimuth = rng.uniform(0.0, 2.0 * std::numbers::pi),
               polar = rng.uniform(0.0, std::numbers::pi);
  const Vector3d start = rounded_m({radius * std::cos(azimuth) * std::sin(polar),
                                    radius * std::sin(azimuth) * std::sin(polar),
                                    workspace_height_m + radius * std::cos(polar)});
  const Workspace workspace(side, speed);
  if (!workspace.contains(start)) return std::nullopt;
  const auto legs = draw_legs(rng, workspace, start, speed, request.duration_s);
  if (legs.empty()) return std::nullopt;
  scene::Obstacle cube;
  cube.shape = scene::Shape::box;
  cube.size_m = Vector3d::Constant(side);
  // While a cube turns, its acceleration says nothing about what follows.
  cube.prediction = scene::Prediction::constant_velocity;
  const auto path = std::make_shared<const scene::WaypointPath>(
      waypoints(legs, request.duration_s),
      scene::WaypointPath::Options{false, 2.0 * request.duration_s}, "a cube's path");
  if (path->speed_max() > request.speed_max_m_s) return std::nullopt;
  cube.motion = scene::WaypointMotion{path};
  if (way.start_clearance_m(cube, 0.0) < start_clearance_m ||
      way.goal_clearance_m(cube, 0.0) < goal_clearance_m)
    return std::nullopt;
  return std::vector{cube};
}

}  // namespace

std::vector<scene::Obstacle> make_cubes(Rng& rng, const ArmWay& way, const MoverRequest& request) {
  std::vector<scene::Obstacle> cubes;
  while (cubes.size() < request.count) {
    auto cube = draw_accepted("cubes", [&] { return draw_cube(rng, way, request); }).front();
    cube.name = fmt::format("cube {}", cubes.size() + 1);
    cubes.push_back(std::move(cube));
  }
  return cubes;
}

}  // namespace hamelin::bench
