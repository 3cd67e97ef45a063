#include "hamelin/sensing/depth_camera.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "hamelin/core/error.hpp"
#include "hamelin/geometry/so3.hpp"
#include "hamelin/sensing/map_grid.hpp"
#include "ray.hpp"

namespace hamelin::sensing {

using Eigen::Index;
using Eigen::Vector3d;

namespace {

// A ray that is this near to a surface has met it.
constexpr double met_m = 1e-5;
// Where nothing is, a point is farther than the range by this share.
constexpr double beyond = 1.01;

// Where a ray meets a solid, or `limit`: it goes on by the distance of the nearest point.
double distance_to(const DepthRenderer::Solid& solid, const Vector3d& from,
                   const Vector3d& direction, double limit) {
  const double radius = scene::bounding_radius(solid.shape),
               along = (solid.pose.p() - from).dot(direction),
               aside = (solid.pose.p() - from - along * direction).norm();
  if (aside > radius || along < -radius || along - radius > limit) return limit;
  double t = std::max(0.0, along - radius);
  while (t < limit && t < along + radius + met_m) {
    const double distance =
        scene::closest_on(solid.shape, solid.pose, from + t * direction).distance;
    if (distance < met_m) return t;
    t += distance;
  }
  return limit;
}

}  // namespace

void check(const DepthCamera& camera) {
  const auto refuse = [](const std::string& what) {
    throw Error(ErrorCode::invalid, "camera: " + what);
  };
  constexpr int pixels_max = 2'000'000;
  if (camera.width < 1 || camera.height < 1 || camera.height > pixels_max / camera.width)
    refuse(
        fmt::format("{} × {} pixels, expected 1 to {}", camera.width, camera.height, pixels_max));
  if (!(camera.fov_rad > 0.0 && camera.fov_rad < std::numbers::pi))
    refuse(fmt::format("a field of view of {} rad, expected one between 0 and π", camera.fov_rad));
  if (!(camera.range_m > 0.0 && std::isfinite(camera.range_m)))
    refuse(fmt::format("a range of {} m, expected a number above 0", camera.range_m));
  if (!(camera.noise_m >= 0.0 && std::isfinite(camera.noise_m)))
    refuse(fmt::format("a noise of {} m, expected a number from 0 up", camera.noise_m));
}

struct DepthRenderer::Map {
  OccupancyGrid grid;
  geometry::SE3 from_world;
};

DepthRenderer::DepthRenderer(const DepthCamera& camera) : camera_(camera) {
  check(camera);
  const double focal = 0.5 * camera.width / std::tan(0.5 * camera.fov_rad);
  rays_.resize(3, Index{camera.width} * camera.height);
  points_.resize(3, rays_.cols());
  for (int y = 0; y < camera.height; ++y)
    for (int x = 0; x < camera.width; ++x)
      rays_.col(Index{y} * camera.width + x) =
          Vector3d(x + 0.5 - 0.5 * camera.width, y + 0.5 - 0.5 * camera.height, focal).normalized();
}

DepthRenderer::~DepthRenderer() = default;
DepthRenderer::DepthRenderer(DepthRenderer&&) noexcept = default;
DepthRenderer& DepthRenderer::operator=(DepthRenderer&&) noexcept = default;

void DepthRenderer::set_map(const scene::Environment& environment) {
  map_.reset();
  if (environment.summary().has_map)
    map_ = std::make_unique<Map>(Map{grid_of(environment, {}), environment.map_pose().inverse()});
}

// Where the ray from one place to another in the world enters the first occupied voxel, or all of
// its length.
double DepthRenderer::distance_in_map(const Vector3d& from, const Vector3d& to) const {
  Ray ray((map_->from_world * from).cast<float>(), (map_->from_world * to).cast<float>(),
          map_->grid.resolution_m());
  const auto blocked = [&] {
    return map_->grid.state(ray.voxel()) == OccupancyGrid::State::occupied;
  };
  if (blocked()) return 0.0;
  while (!ray.done()) {
    const std::size_t axis = ray.advance();
    if (blocked()) return ray.next()[axis] - ray.apart()[axis];
  }
  return ray.length();
}

const Eigen::Matrix3Xf& DepthRenderer::render(const geometry::SE3& camera,
                                              const std::vector<Solid>& solids, Rng& noise) {
  for (Index i = 0; i < rays_.cols(); ++i) {
    const Vector3d direction = camera.R() * rays_.col(i);
    double distance = beyond * camera_.range_m;
    for (const Solid& solid : solids)
      distance = distance_to(solid, camera.p(), direction, distance);
    if (map_)
      distance = std::min(distance, distance_in_map(camera.p(), camera.p() + distance * direction));
    if (distance > camera_.range_m)
      distance = beyond * camera_.range_m;
    else if (camera_.noise_m > 0.0)
      distance = std::max(0.0, distance + camera_.noise_m * noise.normal());
    points_.col(i) = (distance * rays_.col(i)).cast<float>();
  }
  return points_;
}

void add_solids(const scene::Shapes& arm, std::vector<DepthRenderer::Solid>& solids) {
  for (std::size_t i = 0; i < arm.size(); ++i) {
    DepthRenderer::Solid& solid = solids.emplace_back();
    solid.shape.radius_m = arm.radii[i];
    solid.pose = {Eigen::Matrix3d::Identity(), arm.centers[i]};
    if (!arm.is_capsule(i)) continue;
    const Vector3d half = arm.half_axes[i];
    solid.shape.shape = scene::Shape::capsule;
    solid.shape.length_m = 2.0 * half.norm();
    solid.pose = {geometry::rotation_between(Vector3d::UnitZ(), half), arm.centers[i]};
  }
}

}  // namespace hamelin::sensing
