#include <cmath>

#include "hamelin/fit/cover.hpp"
#include "hamelin/task/task.hpp"

namespace hamelin::task {

using Eigen::Vector3d;

namespace {

// How far what covers an object sticks out of it, if not more than so many shapes are needed.
constexpr double excess_m = 0.005;
constexpr int shapes_max = 60;
constexpr std::size_t grid_nodes = 20000;

// Shapes about a solid at the origin.
std::vector<fit::Shape> cover(const scene::Obstacle& solid) {
  const Vector3d half(0.0, 0.0, 0.5 * solid.length_m);
  if (solid.shape == scene::Shape::sphere)
    return {{Vector3d::Zero(), Vector3d::Zero(), solid.radius_m}};
  if (solid.shape == scene::Shape::capsule) return {{-half, half, solid.radius_m}};
  const fit::Mesh mesh = solid.shape == scene::Shape::box
                             ? fit::box_mesh(solid.size_m)
                             : fit::cylinder_mesh(solid.radius_m, solid.length_m);
  return fit::cover(fit::Solid(mesh, grid_nodes), {}, {excess_m, shapes_max, true}).shapes;
}

// Principal moments per mass of a cylinder with a share of the mass, and of two half balls at its
// ends with the rest.
Vector3d capsule_moments(double radius, double length) {
  const double cylinder = length, balls = 4.0 / 3.0 * radius, all = cylinder + balls;
  const double r2 = radius * radius, h = 0.5 * length;
  const double round = (cylinder * 0.5 * r2 + balls * 0.4 * r2) / all;
  const double across = (cylinder * (0.25 * r2 + length * length / 12.0) +
                         balls * (0.4 * r2 + h * h + 0.75 * h * radius)) /
                        all;
  return {across, across, round};
}

Vector3d moments_per_mass(const scene::Obstacle& solid) {
  const double r2 = solid.radius_m * solid.radius_m;
  if (solid.shape == scene::Shape::sphere) return Vector3d::Constant(0.4 * r2);
  if (solid.shape == scene::Shape::capsule) return capsule_moments(solid.radius_m, solid.length_m);
  if (solid.shape == scene::Shape::box) {
    const Vector3d squares = solid.size_m.cwiseProduct(solid.size_m);
    return (Vector3d::Constant(squares.sum()) - squares) / 12.0;
  }
  const double across = 0.25 * r2 + solid.length_m * solid.length_m / 12.0;
  return {across, across, 0.5 * r2};
}

}  // namespace

scene::Payload payload_of(const Object& object) {
  scene::Payload out;
  out.name = object.solid.name;
  out.mass_kg = object.mass_kg;
  const Vector3d moments = object.mass_kg * moments_per_mass(object.solid);
  out.inertia_kg_m2 = moments.asDiagonal();
  for (const fit::Shape& shape : cover(object.solid)) {
    if (shape.ball())
      out.spheres.push_back({shape.from, shape.radius_m, {}});
    else
      out.capsules.push_back({shape.from, shape.to, shape.radius_m, {}});
  }
  return out;
}

scene::Payload held_at(const geometry::SE3& grasp, scene::Payload payload) {
  const geometry::SE3 in_tip = grasp.inverse();
  payload.position_m = in_tip * payload.position_m;
  payload.inertia_kg_m2 = in_tip.R() * payload.inertia_kg_m2 * in_tip.R().transpose();
  for (model::Sphere& sphere : payload.spheres) sphere.center_m = in_tip * sphere.center_m;
  for (model::Segment& capsule : payload.capsules) {
    capsule.from_m = in_tip * capsule.from_m;
    capsule.to_m = in_tip * capsule.to_m;
  }
  return payload;
}

}  // namespace hamelin::task
