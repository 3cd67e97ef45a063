#include "hamelin/scene/obstacles.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <unordered_map>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/scene/distance.hpp"
#include "hamelin/scene/self_collision.hpp"

namespace hamelin::scene {

namespace {

// In the obstacle's own frame, docs/theory.md (11.25).
SurfacePoint on_sphere(double radius, const Eigen::Vector3d& p) {
  const double rho = p.norm();
  const Eigen::Vector3d direction = rho > 0.0 ? Eigen::Vector3d(p / rho) : Eigen::Vector3d::UnitZ();
  return {rho - radius, radius * direction, direction};
}

SurfacePoint on_box(const Eigen::Vector3d& size, const Eigen::Vector3d& p) {
  const BoxHit hit = closest_on_box(p, {-0.5 * size, 0.5 * size});
  return {hit.distance, hit.point, hit.direction};
}

// docs/theory.md (11.26)
SurfacePoint on_cylinder(double radius, double length, const Eigen::Vector3d& p) {
  const double rho = std::hypot(p.x(), p.y());
  const Eigen::Vector3d radial =
      rho > 0.0 ? Eigen::Vector3d(p.x() / rho, p.y() / rho, 0.0) : Eigen::Vector3d::UnitX();
  const double half = 0.5 * length, side = rho - radius, end = std::abs(p.z()) - half;
  const Eigen::Vector3d axial = (p.z() < 0.0 ? -1.0 : 1.0) * Eigen::Vector3d::UnitZ();
  if (side > 0.0 && end > 0.0) {
    const double distance = std::hypot(side, end);
    return {distance, radius * radial + half * axial, (side * radial + end * axial) / distance};
  }
  if (side > end) return {side, radius * radial + p.z() * Eigen::Vector3d::UnitZ(), radial};
  return {end, rho * radial + half * axial, axial};
}

// A sphere around the nearest point of the axis; on the axis, the exit direction is perpendicular.
SurfacePoint on_capsule(double radius, double length, const Eigen::Vector3d& p) {
  const double half = 0.5 * length;
  const Eigen::Vector3d core(0.0, 0.0, std::clamp(p.z(), -half, half));
  SurfacePoint hit = on_sphere(radius, p - core);
  if (p == core) {
    hit.direction = Eigen::Vector3d::UnitX();
    hit.point = radius * hit.direction;
  }
  hit.point += core;
  return hit;
}

// Minimises the signed distance of a convex body along an axis: docs/theory.md (11.28), (11.29).
template <class PointDistance>
AxisPoint nearest_along(const PointDistance& nearest, double size, const Eigen::Vector3d& a,
                        const Eigen::Vector3d& b) {
  struct Sample {
    double t;
    SurfacePoint hit;
    double slope;
  };
  const Eigen::Vector3d axis = b - a;
  const auto at = [&](double t) {
    const SurfacePoint hit = nearest(a + t * axis);
    return Sample{t, hit, hit.direction.dot(axis)};
  };
  Sample low = at(0.0), high = at(1.0);
  const auto answer = [&](const Sample& best) { return AxisPoint{best.hit, a + best.t * axis}; };
  if (low.slope >= 0.0) return answer(low);
  if (high.slope <= 0.0) return answer(high);
  const double gap = 1e-13 * (1.0 + size + axis.norm());
  constexpr int rounds_max = 100;
  for (int round = 0; round < rounds_max; ++round) {
    const Sample& best = low.hit.distance < high.hit.distance ? low : high;
    const double interval = high.t - low.t;
    const double step = (low.hit.distance - high.hit.distance + high.slope * interval) /
                        (high.slope - low.slope);  // to where the tangents cross
    if (best.hit.distance - (low.hit.distance + low.slope * step) <= gap) return answer(best);
    // every third time halve the interval: tangents alone may converge slowly from one side
    const double t = low.t + (round % 3 == 2 ? 0.5 * interval
                                             : std::clamp(step, 0.01 * interval, 0.99 * interval));
    if (!(t > low.t && t < high.t)) return answer(best);
    const Sample middle = at(t);
    (middle.slope < 0.0 ? low : high) = middle;
  }
  return answer(low.hit.distance < high.hit.distance ? low : high);
}

// The axis point nearest to the centre, docs/theory.md (11.27). If it is the centre, the exit
// direction is perpendicular to the axis.
AxisPoint on_sphere(double radius, const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Vector3d axis = b - a;
  const double square = axis.squaredNorm();
  const double t = square > 0.0 ? std::clamp(-a.dot(axis) / square, 0.0, 1.0) : 0.0;
  const Eigen::Vector3d p = a + t * axis;
  SurfacePoint hit = on_sphere(radius, p);
  if (p.isZero(0.0) && square > 0.0) {
    hit.direction = axis.unitOrthogonal();
    hit.point = radius * hit.direction;
  }
  return {hit, p};
}

// The nearest points of two axes, docs/theory.md (11.35).
AxisPoint on_capsule(double radius, double length, const Eigen::Vector3d& a,
                     const Eigen::Vector3d& b) {
  const Eigen::Vector3d half_a = 0.5 * (b - a), middle = 0.5 * (a + b),
                        half_b = 0.5 * length * Eigen::Vector3d::UnitZ();
  const AxisPair pair = nearest_on_axes(middle, half_a, Eigen::Vector3d::Zero(), half_b);
  const Eigen::Vector3d at = middle + pair.on_a * half_a, core = pair.on_b * half_b;
  SurfacePoint hit = on_sphere(radius, at - core);
  if (at == core) {  // the axes cross
    const Eigen::Vector3d normal = half_a.cross(half_b);
    const double size = normal.norm();
    hit.direction = size > 0.0 ? Eigen::Vector3d(normal / size) : Eigen::Vector3d::UnitX();
    hit.point = radius * hit.direction;
  }
  hit.point += core;
  return {hit, at};
}

}  // namespace

std::string_view to_string(Shape shape) noexcept {
  switch (shape) {
    case Shape::sphere:
      return "sphere";
    case Shape::box:
      return "box";
    case Shape::cylinder:
      return "cylinder";
    case Shape::capsule:
      return "capsule";
    case Shape::frame:
      return "frame";
  }
  return "unknown";
}

std::string_view to_string(Prediction prediction) noexcept {
  switch (prediction) {
    case Prediction::path:
      return "path";
    case Prediction::constant_acceleration:
      return "constant-acceleration";
    case Prediction::constant_velocity:
      return "constant-velocity";
    case Prediction::speed_bound:
      return "speed-bound";
  }
  return "unknown";
}

std::filesystem::path waypoint_file(const Obstacle& obstacle) {
  const auto* motion = obstacle.motion ? std::get_if<WaypointMotion>(&*obstacle.motion) : nullptr;
  return motion != nullptr ? motion->path->file() : std::filesystem::path();
}

void attach(std::span<Obstacle> obstacles, const std::string& where) {
  // What is examined at a time, motion_at() among it, recurses so often.
  constexpr std::size_t depth_max = 32;
  std::unordered_multimap<std::string_view, std::size_t> by_name;
  for (std::size_t i = 0; i < obstacles.size(); ++i) by_name.emplace(obstacles[i].name, i);
  std::vector<std::shared_ptr<Frame>> frames(obstacles.size());
  std::vector<std::size_t> chain(obstacles.size(), 0);  // length of the chain from the world
  // Each frame after that of its parent.
  const std::function<std::shared_ptr<Frame>(std::size_t, std::size_t)> frame_of =
      [&](std::size_t i, std::size_t depth) {
        Obstacle& o = obstacles[i];
        const auto fail = [&](const char* what) {
          throw Error(ErrorCode::invalid,
                      fmt::format("{}/{}: obstacle '{}' is attached to '{}', {}", where, i, o.name,
                                  o.attached_to, what));
        };
        const auto check_length = [&](std::size_t length) {
          if (length > depth_max)
            fail("in a circle or in a chain of more than 32, expected a shorter chain");
        };
        if (frames[i]) return frames[i];
        check_length(depth);
        o.parent.reset();
        if (!o.attached_to.empty()) {
          const std::size_t count = by_name.count(o.attached_to);
          if (count == 0) fail("expected the name of an obstacle");
          if (count > 1) fail("expected a name that only one obstacle has");
          const std::size_t parent = by_name.find(o.attached_to)->second;
          o.parent = frame_of(parent, depth + 1);
          check_length(chain[i] = chain[parent] + 1);
        }
        frames[i] = std::make_shared<Frame>(static_cast<const Frame&>(o));
        return frames[i];
      };
  for (std::size_t i = 0; i < obstacles.size(); ++i) (void)frame_of(i, 0);
}

Placed placed_at(const Obstacle& obstacle, const Moment& moment) {
  if (moment.ahead_s <= 0.0) return {motion_at(obstacle, moment.now_s)};
  const double ahead = moment.ahead_s;
  switch (obstacle.prediction) {
    case Prediction::path:
      return {motion_at(obstacle, moment.now_s + ahead)};
    case Prediction::constant_acceleration:
      return {extrapolated(motion_at(obstacle, moment.now_s), ahead, true)};
    case Prediction::constant_velocity:
      return {extrapolated(motion_at(obstacle, moment.now_s), ahead, false)};
    case Prediction::speed_bound:
      return {motion_at(obstacle, moment.now_s), ahead * obstacle.speed_max_m_s};
  }
  return {};
}

// docs/theory.md (11.44)
double max_speed(const Obstacle& obstacle) {
  const MotionBounds bounds = motion_bounds(obstacle);
  return bounds.speed + (bounds.rate > 0.0 ? bounds.rate * bounding_radius(obstacle) : 0.0);
}

// docs/theory.md (11.45)
double max_speed(const Obstacle& obstacle, const Moment& moment) {
  switch (obstacle.prediction) {
    case Prediction::path:
      break;
    case Prediction::speed_bound:
      return obstacle.speed_max_m_s;
    case Prediction::constant_acceleration:
    case Prediction::constant_velocity: {
      const bool accelerates = obstacle.prediction == Prediction::constant_acceleration;
      const MotionState now = motion_at(obstacle, moment.now_s);
      return now.velocity.norm() +
             (accelerates ? acceleration_lasts_s * now.acceleration.norm() : 0.0) +
             now.angular_velocity.norm() * bounding_radius(obstacle);
    }
  }
  return max_speed(obstacle);
}

bool moves(const Obstacle& obstacle) {
  return max_speed(obstacle) > 0.0;
}

double bounding_radius(const Obstacle& obstacle) {
  switch (obstacle.shape) {
    case Shape::sphere:
      return obstacle.radius_m;
    case Shape::box:
      return 0.5 * obstacle.size_m.norm();
    case Shape::cylinder:
      return std::hypot(obstacle.radius_m, 0.5 * obstacle.length_m);
    case Shape::capsule:
      return obstacle.radius_m + 0.5 * obstacle.length_m;
    case Shape::frame:
      break;
  }
  return 0.0;
}

SurfacePoint closest_on(const Obstacle& obstacle, const geometry::SE3& pose,
                        const Eigen::Vector3d& p) {
  const Eigen::Matrix3d& R = pose.R();
  const Eigen::Vector3d local = R.transpose() * (p - pose.p());
  SurfacePoint hit;
  switch (obstacle.shape) {
    case Shape::sphere:
      hit = on_sphere(obstacle.radius_m, local);
      break;
    case Shape::box:
      hit = on_box(obstacle.size_m, local);
      break;
    case Shape::cylinder:
      hit = on_cylinder(obstacle.radius_m, obstacle.length_m, local);
      break;
    case Shape::capsule:
      hit = on_capsule(obstacle.radius_m, obstacle.length_m, local);
      break;
    case Shape::frame:
      break;
  }
  return {hit.distance, R * hit.point + pose.p(), R * hit.direction};
}

AxisPoint closest_on(const Obstacle& obstacle, const geometry::SE3& pose, const Eigen::Vector3d& a,
                     const Eigen::Vector3d& b) {
  const Eigen::Matrix3d& R = pose.R();
  const Eigen::Vector3d from = R.transpose() * (a - pose.p()), to = R.transpose() * (b - pose.p());
  AxisPoint hit;
  switch (obstacle.shape) {
    case Shape::sphere:
      hit = on_sphere(obstacle.radius_m, from, to);
      break;
    case Shape::box: {
      const SegmentHit on =
          closest_on_box(from, to, Box{-0.5 * obstacle.size_m, 0.5 * obstacle.size_m});
      hit = {{on.distance, on.point, on.direction}, on.axis_point};
      break;
    }
    case Shape::cylinder:
      hit = nearest_along(
          [&](const Eigen::Vector3d& p) {
            return on_cylinder(obstacle.radius_m, obstacle.length_m, p);
          },
          obstacle.radius_m + obstacle.length_m, from, to);
      break;
    case Shape::capsule:
      hit = on_capsule(obstacle.radius_m, obstacle.length_m, from, to);
      break;
    case Shape::frame:
      break;
  }
  return {{hit.distance, R * hit.point + pose.p(), R * hit.direction},
          R * hit.axis_point + pose.p()};
}

bool visible(const Obstacle& obstacle, double time_s, double clearance_m) {
  if (obstacle.judge_only || !exists(obstacle, time_s)) return false;
  return obstacle.known || (obstacle.visible_within_m && clearance_m <= *obstacle.visible_within_m);
}

void check(const Obstacle& obstacle, const std::string& where) {
  const auto positive = [&](const char* key, double value) {
    if (!(value > 0.0 && std::isfinite(value)))
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: {} of the {} is {}, expected a number above 0", where, key,
                              to_string(obstacle.shape), value));
  };
  const Shape shape = obstacle.shape;
  if (shape == Shape::box)
    for (int axis = 0; axis < 3; ++axis) positive("size_m", obstacle.size_m[axis]);
  else if (shape != Shape::frame)
    positive("radius_m", obstacle.radius_m);
  if (shape == Shape::cylinder || shape == Shape::capsule) positive("length_m", obstacle.length_m);
  if (obstacle.motion) check(*obstacle.motion, where);
  if (obstacle.prediction != Prediction::speed_bound) {
    if (obstacle.speed_max_m_s != 0.0) positive("speed_max", obstacle.speed_max_m_s);
    return;
  }
  positive("speed_max of the prediction", obstacle.speed_max_m_s);
  if (const double fastest = max_speed(obstacle); fastest > obstacle.speed_max_m_s * (1.0 + 1e-9))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: its motion reaches {:.3g} m/s, expected at most {:.3g} m/s, the "
                            "speed_max of its prediction",
                            where, fastest, obstacle.speed_max_m_s));
}

}  // namespace hamelin::scene
