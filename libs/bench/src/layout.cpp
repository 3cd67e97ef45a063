#include "layout.hpp"

#include <cmath>

#include "hamelin/geometry/so3.hpp"

namespace hamelin::bench {

using Eigen::Vector3d;
using geometry::SE3;

namespace {

constexpr double grain_m = 1e-4;     // of positions and sizes
constexpr double ratio_grain = 1e6;  // inverse of the grain of quaternions

double rounded(double x) {
  return std::round(x / grain_m) / std::round(1.0 / grain_m);
}

// The nearest odd multiple of the grain.
double odd(double size) {
  const double half = std::floor(0.5 * size / grain_m);
  return (2.0 * half + 1.0) / std::round(1.0 / grain_m);
}

// A quarter of a turn about x: it takes z to −y.
Eigen::Matrix3d along_y() {
  return (Eigen::Matrix3d() << 1, 0, 0, 0, 0, -1, 0, 1, 0).finished();
}

}  // namespace

bool Room::contains(const Vector3d& p) const {
  const Vector3d local = frame.inverse() * p;
  return (local.array() >= box.lo.array()).all() && (local.array() <= box.hi.array()).all();
}

double LayoutBuilder::uniform(double low, double high) {
  return rounded(rng.uniform(low, high));
}

int LayoutBuilder::below(int count) {
  return static_cast<int>(rng.below(static_cast<std::uint64_t>(count)));
}

void LayoutBuilder::set_frame(const Place& place) {
  // The rational form of a rotation needs no sine, whose last digit depends on the library.
  const double t = place.tan_half_yaw, c = (1.0 - t * t) / (1.0 + t * t),
               s = 2.0 * t / (1.0 + t * t);
  frame_ = {(Eigen::Matrix3d() << c, -s, 0, s, c, 0, 0, 0, 1).finished(),
            Vector3d(place.x, place.y, 0.0)};
}

void LayoutBuilder::box(const std::string& name, const Vector3d& center, const Vector3d& size) {
  scene::Obstacle o;
  o.name = name;
  o.shape = scene::Shape::box;
  o.size_m = size;
  place(o, {Eigen::Matrix3d::Identity(), center});
}

void LayoutBuilder::post(const std::string& name, double x, double y, double z_low, double z_high,
                         double radius) {
  scene::Obstacle o;
  o.name = name;
  o.shape = scene::Shape::cylinder;
  o.radius_m = radius;
  o.length_m = z_high - z_low;
  place(o, {Eigen::Matrix3d::Identity(), {x, y, 0.5 * (z_low + z_high)}});
}

void LayoutBuilder::beam(const std::string& name, const Vector3d& center, double length,
                         double radius) {
  scene::Obstacle o;
  o.name = name;
  o.shape = scene::Shape::cylinder;
  o.radius_m = radius;
  o.length_m = length;
  place(o, {along_y(), center});
}

void LayoutBuilder::place(scene::Obstacle obstacle, const SE3& in_frame) {
  obstacle.pose = frame_ * in_frame;
  add(std::move(obstacle));
}

void LayoutBuilder::add(scene::Obstacle obstacle) {
  const Vector3d p = obstacle.pose.p().unaryExpr([](double x) { return rounded(x); });
  const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(obstacle.pose.R());
  for (std::size_t i = 0; i < 4; ++i)
    obstacle.quaternion_wxyz[i] =
        std::round(ratio_grain * wxyz[static_cast<Eigen::Index>(i)]) / ratio_grain;
  obstacle.pose = {obstacle.pose.R(), p};
  obstacle.size_m = obstacle.size_m.unaryExpr([](double x) { return odd(x); });
  obstacle.radius_m = 0.5 * odd(2.0 * obstacle.radius_m);
  obstacle.length_m = odd(obstacle.length_m);
  layout.obstacles.push_back(std::move(obstacle));
}

}  // namespace hamelin::bench
