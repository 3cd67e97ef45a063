#pragma once
#include <string>

#include "hamelin/bench/families.hpp"
#include "hamelin/core/rng.hpp"

namespace hamelin::bench {

/// Builds a layout from pieces that are placed in the frame of a piece of furniture.
class LayoutBuilder {
 public:
  explicit LayoutBuilder(std::uint64_t seed) : rng(seed) {}

  /// Uniform in [low, high), rounded to 0.1 mm.
  double uniform(double low, double high);
  /// Uniform in 0 .. count − 1.
  int below(int count);

  /// A place on the ground, turned about z by an angle whose half has this tangent.
  struct Place {
    double x = 0.0, y = 0.0, tan_half_yaw = 0.0;
  };
  /// The frame of the pieces and rooms that follow.
  void set_frame(const Place& place);
  /// A box with its edges along the axes of the frame.
  void box(const std::string& name, const Eigen::Vector3d& center, const Eigen::Vector3d& size);
  /// A cylinder along z.
  void post(const std::string& name, double x, double y, double z_low, double z_high,
            double radius);
  /// A cylinder along the y axis of the frame.
  void beam(const std::string& name, const Eigen::Vector3d& center, double length, double radius);
  /// A primitive in the base frame.
  void add(scene::Obstacle obstacle);
  [[nodiscard]] Room room(const Eigen::Vector3d& lo, const Eigen::Vector3d& hi) const {
    return {frame_, {lo, hi}};
  }

  Rng rng;
  Layout layout;

 private:
  void place(scene::Obstacle obstacle, const geometry::SE3& in_frame);

  geometry::SE3 frame_;
};

}  // namespace hamelin::bench
