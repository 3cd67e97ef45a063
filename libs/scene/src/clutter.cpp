#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/scene/make.hpp"

namespace hamelin::scene {

namespace {

Eigen::Matrix3d random_rotation(Rng& rng) {
  // Uniform quaternions: K. Shoemake, Uniform random rotations, Graphics Gems III, 1992.
  const double u = rng.uniform(), a = 2.0 * std::numbers::pi * rng.uniform(),
               b = 2.0 * std::numbers::pi * rng.uniform();
  return Eigen::Quaterniond(std::sqrt(u) * std::cos(b), std::sqrt(1.0 - u) * std::sin(a),
                            std::sqrt(1.0 - u) * std::cos(a), std::sqrt(u) * std::sin(b))
      .normalized()
      .toRotationMatrix();
}

}  // namespace

std::vector<Obstacle> make_clutter(const Clutter& clutter) {
  if (!(clutter.size_min_m > 0.0 && clutter.size_min_m <= clutter.size_max_m))
    throw Error(ErrorCode::invalid,
                fmt::format("clutter sizes {} to {} m, expected 0 < size_min_m <= size_max_m",
                            clutter.size_min_m, clutter.size_max_m));
  Rng rng(clutter.seed);
  const auto size = [&] { return rng.uniform(clutter.size_min_m, clutter.size_max_m); };
  std::vector<Obstacle> made;
  const std::size_t tries_max = 1000 * (clutter.count + 1);
  for (std::size_t tries = 0; made.size() < clutter.count; ++tries) {
    if (tries == tries_max)
      throw Error(
          ErrorCode::invalid,
          fmt::format(
              "clutter: only {} of {} primitives placed in {} tries, expected more room outside "
              "the keep-out balls",
              made.size(), clutter.count, tries_max));
    Obstacle o;
    o.name = fmt::format("clutter{}", made.size());
    o.shape = static_cast<Shape>(rng.below(3));
    // Every primitive draws the same random numbers for every shape.
    const double a = size(), b = size(), c = size();
    o.size_m = {a, b, c};
    o.radius_m = 0.5 * a;
    o.length_m = b;
    Eigen::Vector3d center;
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      center[axis] = rng.uniform(clutter.bounds.lo[axis], clutter.bounds.hi[axis]);
    o.pose = {random_rotation(rng), center};
    const bool clear =
        std::all_of(clutter.keep_out.begin(), clutter.keep_out.end(), [&](const Ball& ball) {
          return closest_on(o, o.pose, ball.center).distance >= ball.radius;
        });
    if (clear) made.push_back(o);
  }
  return made;
}

}  // namespace hamelin::scene
