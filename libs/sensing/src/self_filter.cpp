#include "hamelin/sensing/self_filter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "hamelin/core/error.hpp"

namespace hamelin::sensing {

using Eigen::Index;
using Eigen::Vector3f;

namespace {

// Neighbours in an image are near each other, so that most of the arm is far from all points of a
// chunk.
constexpr Index chunk = 128;
// More than single precision loses on distances within ten metres.
constexpr double rounding_m = 5e-6;

// Points with each coordinate in a row of its own.
struct Chunk {
  std::array<std::array<float, chunk>, 3> at;
  std::array<bool, chunk> on_arm;
  Vector3f low, high;

  Chunk(const Eigen::Ref<Eigen::Matrix3Xf>& points, Index first, Index count) {
    const auto block = points.middleCols(first, count);
    low = block.rowwise().minCoeff();
    high = block.rowwise().maxCoeff();
    for (std::size_t i = 0; i < 3; ++i)
      for (Index k = 0; k < chunk; ++k)
        at[i][static_cast<std::size_t>(k)] =
            k < count ? block(static_cast<Index>(i), k) : high[static_cast<Index>(i)];
    on_arm.fill(false);
  }

  // Marks what is within `reach` of the segment from a to a + way.
  void mark(const Vector3f& a, const Vector3f& way, float reach) {
    const float squared = way.squaredNorm(), per_squared = squared > 0.0F ? 1.0F / squared : 0.0F,
                most = reach * reach;
    for (std::size_t k = 0; k < on_arm.size(); ++k) {
      float x = at[0][k] - a[0], y = at[1][k] - a[1], z = at[2][k] - a[2];
      float along = (x * way[0] + y * way[1] + z * way[2]) * per_squared;
      along = along < 0.0F ? 0.0F : along;
      along = along > 1.0F ? 1.0F : along;
      x -= along * way[0];
      y -= along * way[1];
      z -= along * way[2];
      on_arm[k] = on_arm[k] | (x * x + y * y + z * z <= most);
    }
  }
};

}  // namespace

Index remove_arm(const scene::Shapes& arm, double margin_m, Eigen::Ref<Eigen::Matrix3Xf> points) {
  if (!(margin_m >= 0.0) || !std::isfinite(margin_m))
    throw Error(ErrorCode::invalid,
                fmt::format("self-filter: a margin of {} m given, expected 0 or more", margin_m));
  Index kept = 0;
  for (Index first = 0; first < points.cols(); first += chunk) {
    const Index count = std::min(chunk, points.cols() - first);
    Chunk some(points, first, count);
    for (std::size_t s = 0; s < arm.size(); ++s) {
      const bool capsule = arm.is_capsule(s);
      const Vector3f a = (capsule ? arm.from(s) : arm.centers[s]).cast<float>(),
                     b = (capsule ? arm.to(s) : arm.centers[s]).cast<float>();
      const auto reach = static_cast<float>(arm.radii[s] + margin_m + rounding_m);
      const bool near = (a.cwiseMin(b).array() - reach <= some.high.array()).all() &&
                        (a.cwiseMax(b).array() + reach >= some.low.array()).all();
      if (near) some.mark(a, b - a, reach);
    }
    for (Index k = 0; k < count; ++k)
      if (!some.on_arm[static_cast<std::size_t>(k)]) points.col(kept++) = points.col(first + k);
  }
  return kept;
}

}  // namespace hamelin::sensing
