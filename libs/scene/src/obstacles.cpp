#include "hamelin/scene/obstacles.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "hamelin/core/error.hpp"
#include "hamelin/scene/distance.hpp"

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

}  // namespace

std::string_view to_string(Shape shape) noexcept {
  switch (shape) {
    case Shape::sphere:
      return "sphere";
    case Shape::box:
      return "box";
    case Shape::cylinder:
      return "cylinder";
  }
  return "unknown";
}

// docs/theory.md (11.30), (11.31)
Eigen::Vector3d position_at(const Obstacle& obstacle, double time_s) {
  if (!obstacle.motion) return obstacle.pose.p();
  if (const auto* sine = std::get_if<SineMotion>(&*obstacle.motion))
    return obstacle.pose.p() +
           std::sin(2.0 * std::numbers::pi * time_s / sine->period_s) * sine->amplitude_m;
  const auto& line = std::get<LinearMotion>(*obstacle.motion);
  return obstacle.pose.p() +
         std::clamp(time_s - line.start_s, 0.0, line.duration_s) * line.velocity_m_s;
}

Eigen::Vector3d velocity_at(const Obstacle& obstacle, double time_s) {
  if (!obstacle.motion) return Eigen::Vector3d::Zero();
  if (const auto* sine = std::get_if<SineMotion>(&*obstacle.motion)) {
    const double omega = 2.0 * std::numbers::pi / sine->period_s;
    return omega * std::cos(omega * time_s) * sine->amplitude_m;
  }
  const auto& line = std::get<LinearMotion>(*obstacle.motion);
  const bool moves = time_s >= line.start_s && time_s - line.start_s < line.duration_s;
  return moves ? line.velocity_m_s : Eigen::Vector3d::Zero();
}

double max_speed(const Obstacle& obstacle) {
  if (!obstacle.motion) return 0.0;
  if (const auto* sine = std::get_if<SineMotion>(&*obstacle.motion))
    return 2.0 * std::numbers::pi * sine->amplitude_m.norm() / sine->period_s;
  return std::get<LinearMotion>(*obstacle.motion).velocity_m_s.norm();
}

double bounding_radius(const Obstacle& obstacle) {
  switch (obstacle.shape) {
    case Shape::sphere:
      return obstacle.radius_m;
    case Shape::box:
      return 0.5 * obstacle.size_m.norm();
    case Shape::cylinder:
      return std::hypot(obstacle.radius_m, 0.5 * obstacle.length_m);
  }
  return 0.0;
}

SurfacePoint closest_on(const Obstacle& obstacle, const Eigen::Vector3d& center,
                        const Eigen::Vector3d& p) {
  const Eigen::Matrix3d& R = obstacle.pose.R();
  const Eigen::Vector3d local = R.transpose() * (p - center);
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
  }
  return {hit.distance, R * hit.point + center, R * hit.direction};
}

AxisPoint closest_on(const Obstacle& obstacle, const Eigen::Vector3d& center,
                     const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  const Eigen::Matrix3d& R = obstacle.pose.R();
  const Eigen::Vector3d from = R.transpose() * (a - center), to = R.transpose() * (b - center);
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
  }
  return {{hit.distance, R * hit.point + center, R * hit.direction}, R * hit.axis_point + center};
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
  if (obstacle.shape != Shape::box) positive("radius_m", obstacle.radius_m);
  if (obstacle.shape == Shape::cylinder) positive("length_m", obstacle.length_m);
  if (obstacle.shape == Shape::box)
    for (int axis = 0; axis < 3; ++axis) positive("size_m", obstacle.size_m[axis]);
  if (!obstacle.motion) return;
  if (const auto* sine = std::get_if<SineMotion>(&*obstacle.motion);
      sine != nullptr && !(sine->period_s > 0.0))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: period_s of the motion is {}, expected a number above 0", where,
                            sine->period_s));
  if (const auto* line = std::get_if<LinearMotion>(&*obstacle.motion);
      line != nullptr && !(line->duration_s > 0.0))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: duration_s of the motion is {}, expected a number above 0", where,
                            line->duration_s));
}

}  // namespace hamelin::scene
