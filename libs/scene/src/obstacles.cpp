#include "hamelin/scene/obstacles.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "hamelin/core/error.hpp"
#include "hamelin/scene/distance.hpp"

namespace hamelin::scene {

namespace {

// In the obstacle's own frame.
SurfacePoint on_sphere(double radius, const Eigen::Vector3d& p) {
  const double rho = p.norm();
  const Eigen::Vector3d direction = rho > 0.0 ? Eigen::Vector3d(p / rho) : Eigen::Vector3d::UnitZ();
  return {rho - radius, radius * direction, direction};
}

SurfacePoint on_box(const Eigen::Vector3d& size, const Eigen::Vector3d& p) {
  const BoxHit hit = closest_on_box(p, {-0.5 * size, 0.5 * size});
  return {hit.distance, hit.point, hit.direction};
}

SurfacePoint on_cylinder(double radius, double length, const Eigen::Vector3d& p) {
  const double rho = std::hypot(p.x(), p.y());
  const Eigen::Vector3d radial = rho > 0.0 ? Eigen::Vector3d(p.x() / rho, p.y() / rho, 0.0) : Eigen::Vector3d::UnitX();
  const double half = 0.5 * length, side = rho - radius, end = std::abs(p.z()) - half;
  const Eigen::Vector3d axial = (p.z() < 0.0 ? -1.0 : 1.0) * Eigen::Vector3d::UnitZ();
  if (side > 0.0 && end > 0.0) {
    const double distance = std::hypot(side, end);
    return {distance, radius * radial + half * axial, (side * radial + end * axial) / distance};
  }
  if (side > end) return {side, radius * radial + p.z() * Eigen::Vector3d::UnitZ(), radial};
  return {end, rho * radial + half * axial, axial};
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

Eigen::Vector3d position_at(const Obstacle& obstacle, double time_s) {
  if (!obstacle.motion) return obstacle.pose.p();
  return obstacle.pose.p() +
         std::sin(2.0 * std::numbers::pi * time_s / obstacle.motion->period_s) * obstacle.motion->amplitude_m;
}

Eigen::Vector3d velocity_at(const Obstacle& obstacle, double time_s) {
  if (!obstacle.motion) return Eigen::Vector3d::Zero();
  const double omega = 2.0 * std::numbers::pi / obstacle.motion->period_s;
  return omega * std::cos(omega * time_s) * obstacle.motion->amplitude_m;
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

SurfacePoint closest_on(const Obstacle& obstacle, const Eigen::Vector3d& center, const Eigen::Vector3d& p) {
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

bool visible(const Obstacle& obstacle, double time_s, double clearance_m) {
  if (obstacle.judge_only || !exists(obstacle, time_s)) return false;
  return obstacle.known || (obstacle.visible_within_m && clearance_m <= *obstacle.visible_within_m);
}

void check(const Obstacle& obstacle, const std::string& where) {
  const auto positive = [&](const char* key, double value) {
    if (!(value > 0.0 && std::isfinite(value)))
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: a {} needs {} above 0, not {}", where, to_string(obstacle.shape), key, value));
  };
  if (obstacle.shape != Shape::box) positive("radius_m", obstacle.radius_m);
  if (obstacle.shape == Shape::cylinder) positive("length_m", obstacle.length_m);
  if (obstacle.shape == Shape::box)
    for (int axis = 0; axis < 3; ++axis) positive("size_m", obstacle.size_m[axis]);
  if (obstacle.motion && !(obstacle.motion->period_s > 0.0))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: motion needs period_s above 0, not {}", where, obstacle.motion->period_s));
}

}  // namespace hamelin::scene
