#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

namespace hamelin::sensing {

/// Voxels along each axis that OctoMap has keys for: [−limit, limit).
inline constexpr std::int32_t key_limit = 32768;

inline std::int32_t voxel_at(double x, double voxels_per_m) noexcept {
  return static_cast<std::int32_t>(std::floor(voxels_per_m * x));
}
inline double centre_of(std::int32_t voxel, double resolution) noexcept {
  return (static_cast<double>(voxel) + 0.5) * resolution;
}
/// Whether there is a key for a point.
inline bool has_key(const Eigen::Vector3f& p, double voxels_per_m) noexcept {
  const auto within = [&](float x) {
    const double voxel = std::floor(voxels_per_m * static_cast<double>(x));
    return voxel >= -key_limit && voxel < key_limit;
  };
  return within(p[0]) && within(p[1]) && within(p[2]);
}

/// A walk along the voxels that a ray passes, docs/theory.md (20.2): J. Amanatides, A. Woo, A Fast
/// Voxel Traversal Algorithm for Ray Tracing, Eurographics 1987. Numbers are as precise as
/// OctoMap's where that decides which voxels these are.
class Ray {
 public:
  Ray(const Eigen::Vector3f& origin, const Eigen::Vector3f& end, double resolution) noexcept {
    const double voxels_per_m = 1.0 / resolution;
    const Eigen::Vector3f way = end - origin;
    const float squared = way[0] * way[0] + way[1] * way[1] + way[2] * way[2],
                length = static_cast<float>(std::sqrt(static_cast<double>(squared)));
    length_ = static_cast<double>(length);
    for (int i = 0; i < 3; ++i) {
      const auto a = static_cast<std::size_t>(i);
      voxel_[a] = voxel_at(static_cast<double>(origin[i]), voxels_per_m);
      end_[a] = voxel_at(static_cast<double>(end[i]), voxels_per_m);
      const float direction = way[i] / length;
      step_[a] = direction > 0.0F ? 1 : direction < 0.0F ? -1 : 0;
      if (step_[a] == 0) continue;
      const double border = centre_of(voxel_[a], resolution) +
                            static_cast<double>(static_cast<float>(step_[a] * resolution * 0.5));
      next_[a] = (border - static_cast<double>(origin[i])) / static_cast<double>(direction);
      apart_[a] = resolution / std::abs(static_cast<double>(direction));
    }
    done_ = voxel_ == end_;
  }

  [[nodiscard]] const std::array<std::int32_t, 3>& voxel() const noexcept { return voxel_; }
  [[nodiscard]] const std::array<std::int32_t, 3>& end() const noexcept { return end_; }
  [[nodiscard]] int step(std::size_t axis) const noexcept { return step_[axis]; }
  /// Where the next border across each axis is, along the ray, and how far apart they are.
  [[nodiscard]] const std::array<double, 3>& next() const noexcept { return next_; }
  [[nodiscard]] const std::array<double, 3>& apart() const noexcept { return apart_; }
  [[nodiscard]] double length() const noexcept { return length_; }
  /// Whether the voxel is that of the end, or lies behind it.
  [[nodiscard]] bool done() const noexcept { return done_; }
  /// Goes on to the next voxel. @return the axis along which that lies
  std::size_t advance() noexcept {
    const std::size_t axis =
        next_[0] < next_[1] ? (next_[0] < next_[2] ? 0 : 2) : (next_[1] < next_[2] ? 1 : 2);
    voxel_[axis] += step_[axis];
    next_[axis] += apart_[axis];
    // rounding may lead past the end
    done_ = voxel_ == end_ || std::min({next_[0], next_[1], next_[2]}) > length_;
    return axis;
  }

 private:
  static constexpr double never = std::numeric_limits<double>::max();
  std::array<std::int32_t, 3> voxel_{}, end_{};
  std::array<int, 3> step_{};
  std::array<double, 3> next_{never, never, never}, apart_{never, never, never};
  double length_ = 0.0;
  bool done_ = false;
};

}  // namespace hamelin::sensing
