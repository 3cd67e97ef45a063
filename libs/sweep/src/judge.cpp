#include "hamelin/sweep/judge.hpp"

#include <fmt/format.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <set>

#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "judge_geometry.hpp"

namespace hamelin::sweep {

namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

// With the nearest leaf all leaves are kept that are at most this much farther away. They contain
// the nearest leaf until the ball has moved half this distance.
constexpr double nearby_m = 0.04;

// Points on a capsule's axis; balls of its radius around them leave gaps of less than
// `capsule_gap_m` at its surface. docs/theory.md (13.18).
std::vector<Vector3d> ball_centers(const model::Segment& capsule) {
  const Vector3d axis = capsule.to_m - capsule.from_m;
  // a spacing s of the centres leaves a gap of r − √(r² − s²/4) < s²/4r, where r is the radius
  const auto parts = static_cast<int>(
      std::ceil(axis.norm() / std::sqrt(4.0 * capsule.radius_m * JudgedArm::capsule_gap_m)));
  std::vector<Vector3d> points{capsule.from_m};
  for (int i = 1; i <= parts; ++i)
    points.emplace_back(capsule.from_m + (static_cast<double>(i) / parts) * axis);
  return points;
}

// Signed distance from a product of intervals |x_i| <= h_i, negative inside. `excess` is |x_i| −
// h_i. docs/theory.md (13.21).
template <typename Vector>
double distance_from_block(const Vector& excess) {
  return excess.cwiseMax(0.0).norm() + std::min(excess.maxCoeff(), 0.0);
}

// The pose in the world. Written apart from that of the library, but for way-points.
geometry::SE3 pose_at(const scene::Frame& frame, double time_s) {
  geometry::SE3 own = frame.pose;
  if (frame.motion) {
    if (const auto* sine = std::get_if<scene::SineMotion>(&*frame.motion))
      own = {own.R(), own.p() + sine->amplitude_m *
                                    std::sin(2.0 * std::numbers::pi * time_s / sine->period_s)};
    else if (const auto* line = std::get_if<scene::LinearMotion>(&*frame.motion))
      own = {own.R(), own.p() + line->velocity_m_s * std::min(std::max(time_s - line->start_s, 0.0),
                                                              line->duration_s)};
    else
      own = scene::motion_at({frame.pose, frame.motion, nullptr}, time_s).pose;
  }
  return frame.parent ? pose_at(*frame.parent, time_s) * own : own;
}

double radius_around_center(const scene::Obstacle& obstacle) {
  switch (obstacle.shape) {
    case scene::Shape::sphere:
      return obstacle.radius_m;
    case scene::Shape::box:
      return 0.5 * obstacle.size_m.norm();
    case scene::Shape::cylinder:
      return std::hypot(obstacle.radius_m, 0.5 * obstacle.length_m);
    case scene::Shape::capsule:
      return obstacle.radius_m + 0.5 * obstacle.length_m;
    case scene::Shape::frame:
      break;
  }
  return -infinity;
}

}  // namespace

JudgedArm::JudgedArm(const scene::Scene& scene) : base_(isometry(scene.base)) {
  const model::Robot robot = description::read_robot(
      scene.robot.file, {scene.robot.tip, scene.robot.spheres, scene.robot.srdf});
  std::vector<std::string> parts;  // of each ball
  std::map<std::string, int> counts;
  const auto add = [&](const std::string& part, int link, const Vector3d& center, double radius) {
    balls_.push_back({fmt::format("{}/{}", part, counts[part]++), link, center, radius});
    parts.push_back(part);
  };
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    const auto& link = robot.links[i];
    joints_.push_back({link.parent, link.joint.screw.head<3>(), link.joint.screw.tail<3>()});
    for (const auto& sphere : link.spheres)
      add(sphere.part.empty() ? link.name : sphere.part, static_cast<int>(i),
          isometry(link.com) * sphere.center_m, sphere.radius_m);
    for (const auto& segment : link.segments)
      if (segment.is_capsule())
        for (const Vector3d& point : ball_centers(segment))
          add(segment.part.empty() ? link.name : segment.part, static_cast<int>(i),
              isometry(link.com) * point, segment.radius_m);
  }
  const std::size_t moving = balls_.size();
  for (const auto& sphere : robot.base_spheres)
    add(sphere.part, -1, sphere.center_m, sphere.radius_m);
  for (const auto& capsule : robot.base_segments)
    for (const Vector3d& point : ball_centers(capsule))
      add(capsule.part, -1, point, capsule.radius_m);
  base_balls_.assign(balls_.begin() + static_cast<std::ptrdiff_t>(moving), balls_.end());
  if (!scene.model.self_collision) {
    balls_.resize(moving);
    return;
  }
  std::set<std::pair<std::string, std::string>> disabled;
  for (const auto& [a, b] : robot.self_collision_disabled) disabled.insert(std::minmax(a, b));
  const auto parent = [&](int link) {
    return link < 0 ? -1 : robot.links[static_cast<std::size_t>(link)].parent;
  };
  for (std::size_t a = 0; a < balls_.size(); ++a)
    for (std::size_t b = a + 1; b < balls_.size(); ++b) {
      const int i = balls_[a].link, j = balls_[b].link;
      const bool neighbours = parent(i) == j || parent(j) == i;
      if (i == j || (disabled.empty() && neighbours) ||
          disabled.contains(std::minmax(parts[a], parts[b])))
        continue;
      self_pairs_.emplace_back(a, b);
    }
}

// docs/theory.md (13.19), (13.20)
void JudgedArm::place(const Eigen::VectorXd& q, std::vector<Vector3d>& centers) const {
  std::vector<Isometry3d> moved(joints_.size());
  for (std::size_t i = 0; i < joints_.size(); ++i) {
    const Screw& joint = joints_[i];
    const double angle = q[static_cast<Eigen::Index>(i)];
    Isometry3d step = Isometry3d::Identity();
    if (joint.axis.isZero()) {
      step.translation() = angle * joint.moment;
    } else {
      // ω × v is a point of the axis, and ω · v is the pitch of the screw
      const Vector3d on_axis = joint.axis.cross(joint.moment);
      step.linear() = Eigen::AngleAxisd(angle, joint.axis).toRotationMatrix();
      step.translation() =
          on_axis - step.linear() * on_axis + angle * joint.axis.dot(joint.moment) * joint.axis;
    }
    const Isometry3d before =
        joint.parent < 0 ? base_ : moved[static_cast<std::size_t>(joint.parent)];
    moved[i] = before * step;
  }
  centers.resize(balls_.size());
  for (std::size_t k = 0; k < balls_.size(); ++k)
    centers[k] = (balls_[k].link < 0 ? base_ : moved[static_cast<std::size_t>(balls_[k].link)]) *
                 balls_[k].center;
}

double distance_from(const scene::Obstacle& obstacle, const geometry::SE3& pose,
                     const Vector3d& p) {
  const Vector3d local = pose.R().transpose() * (p - pose.p());
  switch (obstacle.shape) {
    case scene::Shape::sphere:
      return local.norm() - obstacle.radius_m;
    case scene::Shape::box:
      return distance_from_block(Vector3d(local.cwiseAbs() - 0.5 * obstacle.size_m));
    case scene::Shape::cylinder:
      return distance_from_block(Eigen::Vector2d(local.head<2>().norm() - obstacle.radius_m,
                                                 std::abs(local.z()) - 0.5 * obstacle.length_m));
    case scene::Shape::capsule:
      return Vector3d(local.x(), local.y(),
                      std::max(std::abs(local.z()) - 0.5 * obstacle.length_m, 0.0))
                 .norm() -
             obstacle.radius_m;
    case scene::Shape::frame:
      break;
  }
  return infinity;
}

Json to_json(const Verdict& v) {
  const auto closest = [](const std::optional<Closest>& c) {
    return c ? Json{{"clearance_m", c->clearance_m},
                    {"time_s", c->time_s},
                    {"sphere", c->ball},
                    {"other", c->other}}
             : Json(nullptr);
  };
  return {{"contact", v.contact()},
          {"obstacles", closest(v.obstacles)},
          {"self", closest(v.self)},
          {"configurations", v.configurations}};
}

Judge::Judge(const scene::Scene& scene)
    : arm_(scene),
      obstacles_(scene.obstacles),
      min_clearance_(infinity),
      min_self_clearance_(infinity) {
  for (std::size_t i = 0; i < scene.goals.size(); ++i)
    if (!scene.goals[i].may_touch.empty())
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: /goals/{}/may_touch: is given, expected none: any contact in a "
                              "log counts",
                              scene.name, i));
  for (const auto& obstacle : obstacles_) bounding_radii_.push_back(radius_around_center(obstacle));
  poses_.resize(obstacles_.size());
  const bool exact =
      std::any_of(obstacles_.begin(), obstacles_.end(), [](const auto& o) { return o.judge_only; });
  if (scene.map && !scene.map->file.empty() && (!exact || !scene.map->changes.empty()))
    map_ = JudgedMap(scene, arm_);
  if (exact) map_.clear();
  nearby_.resize(arm_.balls().size());
}

// docs/theory.md (13.22)
void Judge::add_node(double time_s, const Eigen::VectorXd& q) {
  if (!q.allFinite()) return;  // the run ends as diverged
  int parts = 1;
  if (last_q_.size() > 0)
    parts = std::max(
        1, static_cast<int>(std::ceil((q - last_q_).lpNorm<Eigen::Infinity>() / step_rad)));
  for (int i = 1; i < parts; ++i) {
    const double share = static_cast<double>(i) / parts;
    check(last_time_s_ + share * (time_s - last_time_s_), last_q_ + share * (q - last_q_));
  }
  check(time_s, q);
  last_time_s_ = time_s;
  last_q_ = q;
}

void Judge::check(double time_s, const Eigen::VectorXd& q) {
  ++verdict_.configurations;
  arm_.place(q, centers_);
  if (map_.advance(time_s))
    for (NearbyLeaves& nearby : nearby_) nearby.valid = false;
  const auto& balls = arm_.balls();
  const auto update = [&](double clearance, std::size_t ball, const std::string& other) {
    if (!(clearance < min_clearance_)) return;
    min_clearance_ = clearance;
    verdict_.obstacles = {clearance, time_s, balls[ball].name, other};
  };
  for (std::size_t i = 0; i < obstacles_.size(); ++i) poses_[i] = pose_at(obstacles_[i], time_s);
  for (std::size_t k = 0; k < balls.size(); ++k) {
    if (balls[k].link < 0) continue;  // the base does not move
    for (std::size_t i = 0; i < obstacles_.size(); ++i) {
      const auto& obstacle = obstacles_[i];
      if (time_s < obstacle.appears_s) continue;
      const double lower_bound =
          (centers_[k] - poses_[i].p()).norm() - bounding_radii_[i] - balls[k].radius;
      if (lower_bound < min_clearance_)
        update(distance_from(obstacle, poses_[i], centers_[k]) - balls[k].radius, k, obstacle.name);
    }
    if (!map_.leaves().empty()) update(map_distance(k, min_clearance_) - balls[k].radius, k, "map");
  }
  for (const auto& [a, b] : arm_.self_pairs()) {
    const double clearance = (centers_[a] - centers_[b]).norm() - balls[a].radius - balls[b].radius;
    if (!(clearance < min_self_clearance_)) continue;
    min_self_clearance_ = clearance;
    verdict_.self = {clearance, time_s, balls[a].name, balls[b].name};
  }
}

// A distance changes by no more than the ball moves. The stored distance therefore bounds the
// present one from below, which is sufficient if the bound is at least `enough`, and it decides
// whether the stored leaves still contain the nearest one. docs/theory.md (13.23).
double Judge::map_distance(std::size_t ball, double enough) {
  NearbyLeaves& nearby = nearby_[ball];
  const Vector3d& p = centers_[ball];
  const double moved = (p - nearby.position).norm();
  if (nearby.valid) {
    if (nearby.distance - moved - arm_.balls()[ball].radius >= enough)
      return nearby.distance - moved;
    if (2.0 * moved <= nearby_m) return distance_from_boxes(nearby.leaves, map_.to_map_frame(p));
  }
  nearby.position = p;
  nearby.distance = map_.distance(p);
  nearby.leaves = map_.leaves_within(p, nearby.distance + nearby_m);
  nearby.valid = true;
  return nearby.distance;
}

namespace {

/// The smallest distance of a configuration from obstacles, map and itself [m], and where it
/// occurs.
struct Nearest {
  double distance = infinity;
  std::string place;
};

Nearest nearest_at(const scene::Scene& scene, const JudgedArm& arm, const JudgedMap& map,
                   const Eigen::VectorXd& q) {
  std::vector<Vector3d> centers;
  arm.place(q, centers);
  Nearest nearest;
  const auto& balls = arm.balls();
  const auto add = [&](double distance, const std::string& place) {
    if (distance < nearest.distance) nearest = {distance, place};
  };
  for (std::size_t k = 0; k < balls.size() && balls[k].link >= 0; ++k) {
    add(map.distance(centers[k]) - balls[k].radius, balls[k].name + " in the map");
    for (const auto& obstacle : scene.obstacles)
      if (!obstacle.judge_only && obstacle.appears_s <= 0.0)
        add(distance_from(obstacle, pose_at(obstacle, 0.0), centers[k]) - balls[k].radius,
            fmt::format("{} in '{}'", balls[k].name, obstacle.name));
  }
  for (const auto& [a, b] : arm.self_pairs())
    add((centers[a] - centers[b]).norm() - balls[a].radius - balls[b].radius,
        fmt::format("{} in {}", balls[a].name, balls[b].name));
  return nearest;
}

/// The map at time 0, and after each change within the scene's duration.
std::vector<JudgedMap> maps_over_time(const scene::Scene& scene, const JudgedArm& arm) {
  std::vector<JudgedMap> maps;
  maps.push_back(scene.map ? JudgedMap(scene, arm) : JudgedMap());
  maps.back().advance(0.0);
  if (!scene.map) return maps;
  for (const auto& change : scene.map->changes) {
    if (change.time_s > scene.duration_s) break;
    JudgedMap next = maps.back();
    if (next.advance(change.time_s)) maps.push_back(std::move(next));
  }
  return maps;
}

}  // namespace

Feasibility feasibility(const scene::Scene& scene, const std::vector<Eigen::VectorXd>& goals_q) {
  const JudgedArm arm(scene);
  const auto maps = maps_over_time(scene, arm);
  const auto dof = static_cast<Eigen::Index>(arm.dof());
  const auto check = [&](const std::string& name, const Eigen::VectorXd& q,
                         std::size_t map_count) -> Feasibility {
    if (q.size() != dof)
      throw Error(ErrorCode::invalid, fmt::format("{}: {}: {} values given, expected {}",
                                                  scene.name, name, q.size(), arm.dof()));
    Nearest best{-infinity, ""};
    for (std::size_t i = 0; i < map_count && best.distance <= 0.0; ++i)
      if (Nearest here = nearest_at(scene, arm, maps[i], q); here.distance > best.distance)
        best = std::move(here);
    if (best.distance > 0.0) return {};
    return {false, fmt::format("{}: {}, {:.4f} m deep", name, best.place, -best.distance)};
  };
  Feasibility found =
      check("start", scene.start_q.size() > 0 ? scene.start_q : Eigen::VectorXd::Zero(dof), 1);
  for (std::size_t i = 0; i < scene.goals.size() && found.feasible; ++i)
    if (scene.goals[i].type == scene::GoalType::joint)
      found = check(scene.goals.size() > 1 ? fmt::format("goal {}", i) : "goal", scene.goals[i].q,
                    maps.size());
  for (std::size_t i = 0; i < goals_q.size() && found.feasible; ++i)
    found = check("goal", goals_q[i], maps.size());
  return found;
}

}  // namespace hamelin::sweep
