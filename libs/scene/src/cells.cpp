#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/scene/boxes.hpp"
#include "hamelin/scene/distance.hpp"

namespace hamelin::scene {

namespace {

double squared_distance(const Eigen::Vector3d& p, const Box& box) {
  return (box.lo - p).cwiseMax(p - box.hi).cwiseMax(0.0).squaredNorm();
}

double squared_distance_to_farthest_corner(const Eigen::Vector3d& p, const Box& box) {
  return (p - box.lo).cwiseAbs().cwiseMax((box.hi - p).cwiseAbs()).squaredNorm();
}

void push_children(const Cell& cell, std::vector<Cell>& stack) {
  const std::int32_t size = cell.size / 2;
  for (unsigned child = 8; child-- > 0;) {
    Cell part{cell.lo, size};
    for (unsigned axis = 0; axis < 3; ++axis) part.lo[axis] += (child >> axis) & 1U ? size : 0;
    stack.push_back(part);
  }
}

// Tells whether a box touches any of the capsules. Tests their bounding boxes first.
class CapsuleSet {
 public:
  explicit CapsuleSet(std::span<const Capsule> capsules) : capsules_(capsules) {
    for (const Capsule& c : capsules) {
      hulls_.push_back(
          {c.from.cwiseMin(c.to).array() - c.radius, c.from.cwiseMax(c.to).array() + c.radius});
      hull_ = {hull_.lo.cwiseMin(hulls_.back().lo), hull_.hi.cwiseMax(hulls_.back().hi)};
    }
  }

  [[nodiscard]] bool touches(const Box& box) const {
    if (apart(box, hull_)) return false;
    for (std::size_t i = 0; i < capsules_.size(); ++i) {
      const Capsule& c = capsules_[i];
      if (apart(box, hulls_[i])) continue;
      const bool touching = c.from == c.to ? squared_distance(c.from, box) <= c.radius * c.radius
                                           : closest_on_box(c.from, c.to, box).distance <= c.radius;
      if (touching) return true;
    }
    return false;
  }

 private:
  static bool apart(const Box& a, const Box& b) {
    return (a.lo.array() > b.hi.array()).any() || (b.lo.array() > a.hi.array()).any();
  }

  std::span<const Capsule> capsules_;
  std::vector<Box> hulls_;
  Box hull_{Eigen::Vector3d::Constant(infinity), Eigen::Vector3d::Constant(-infinity)};
};

/// The grains, cubes of so many voxels, whose centres are in a ball.
class GrainsInBall {
 public:
  GrainsInBall(const Ball& ball, std::int32_t grain, double resolution)
      : ball_(ball), grain_(grain), resolution_(resolution), radius2_(ball.radius * ball.radius) {}

  /// Whether the grain of this voxel is one.
  [[nodiscard]] bool contains(const std::array<std::int32_t, 3>& voxel) const {
    return squared(0, index(voxel[0])) + squared(1, index(voxel[1])) +
               squared(2, index(voxel[2])) <=
           radius2_;
  }

  /// Their volume in a cell that is larger than a grain, in voxels, column by column.
  [[nodiscard]] double volume(const Cell& cell) const {
    std::array<Range, 3> range;
    for (unsigned axis = 0; axis < 3; ++axis) {
      const std::int32_t first = index(cell.lo[axis]);
      range[axis] = within(axis, 0.0, {first, first + cell.size / grain_});
    }
    double count = 0.0;
    for (std::int32_t x = range[0].begin; x < range[0].end; ++x)
      for (std::int32_t y = range[1].begin; y < range[1].end; ++y) {
        const Range column = within(2, squared(0, x) + squared(1, y), range[2]);
        count += column.end - column.begin;
      }
    const double edge = grain_;
    return count * edge * edge * edge;
  }

 private:
  struct Range {
    std::int32_t begin, end;
  };

  [[nodiscard]] std::int32_t index(std::int32_t voxel) const {
    return (voxel & ~(grain_ - 1)) / grain_;
  }
  /// Square of the distance of a grain's centre from that of the ball along an axis.
  [[nodiscard]] double squared(unsigned axis, std::int32_t grain) const {
    const double lo = resolution_ * (grain * grain_), hi = resolution_ * ((grain + 1) * grain_);
    const double offset = 0.5 * (lo + hi) - ball_.center[axis];
    return offset * offset;
  }
  /// The part of a range of grains along an axis that is in the ball, given the squares along the
  /// other axes. The root gives its ends to rounding, the sum of squares decides.
  [[nodiscard]] Range within(unsigned axis, double others, Range range) const {
    const auto in = [&](std::int32_t grain) { return others + squared(axis, grain) <= radius2_; };
    const double edge = resolution_ * grain_, center = ball_.center[axis] / edge - 0.5,
                 half = std::sqrt(std::max(0.0, radius2_ - others)) / edge;
    const auto clamped = [&](double x) {
      return static_cast<std::int32_t>(
          std::clamp(x, static_cast<double>(range.begin), static_cast<double>(range.end)));
    };
    Range found{clamped(std::ceil(center - half)), clamped(std::floor(center + half) + 1.0)};
    while (found.begin > range.begin && in(found.begin - 1)) --found.begin;
    while (found.end < range.end && in(found.end)) ++found.end;
    while (found.begin < found.end && !in(found.begin)) ++found.begin;
    while (found.begin < found.end && !in(found.end - 1)) --found.end;
    return found;
  }

  Ball ball_;
  std::int32_t grain_;
  double resolution_, radius2_;
};

}  // namespace

std::vector<Cell> crop(const std::vector<Cell>& cells, double resolution, const Ball& ball) {
  std::vector<Cell> kept;
  std::copy_if(cells.begin(), cells.end(), std::back_inserter(kept), [&](const Cell& cell) {
    return squared_distance(ball.center, to_metres(cell, resolution)) <= ball.radius * ball.radius;
  });
  return kept;
}

std::size_t count_touched(const std::vector<Cell>& cells, double resolution,
                          std::span<const Capsule> capsules) {
  const CapsuleSet all(capsules);
  return static_cast<std::size_t>(std::count_if(cells.begin(), cells.end(), [&](const Cell& cell) {
    return all.touches(to_metres(cell, resolution));
  }));
}

CutOut cut_out(const std::vector<Cell>& cells, double resolution,
               std::span<const Capsule> capsules) {
  constexpr std::size_t more_max = std::size_t{1} << 22U;
  const CapsuleSet all(capsules);
  CutOut cut;
  std::vector<Cell> stack;
  for (const Cell& leaf : cells) {
    const std::size_t before = cut.voxels;
    stack.push_back(leaf);
    while (!stack.empty()) {
      const Cell cell = stack.back();
      stack.pop_back();
      if (!all.touches(to_metres(cell, resolution))) {
        cut.cells.push_back(cell);
      } else if (cell.size > 1) {
        push_children(cell, stack);
      } else {
        ++cut.voxels;
      }
      if (cut.cells.size() + cut.voxels > cells.size() + more_max)
        throw Error(
            ErrorCode::invalid,
            fmt::format(
                "voxels of {} m are too fine to cut shapes out of the map: more than {} pieces",
                resolution, more_max));
    }
    cut.leaves += cut.voxels > before ? 1 : 0;
  }
  return cut;
}

double volume_inside(const std::vector<Cell>& cells, double resolution, const Ball& ball) {
  double voxels = 0.0;
  const double radius2 = ball.radius * ball.radius;
  // A voxel counts if the centre of its grain is in the ball. Then volumes add up however space is
  // divided into cells.
  std::int32_t grain = 1;
  while (2.0 * grain * 128.0 * resolution <= ball.radius && grain < (1 << 15)) grain *= 2;
  const GrainsInBall grains(ball, grain, resolution);
  for (const Cell& cell : cells) {
    const double edge = cell.size, volume = edge * edge * edge;
    if (cell.size <= grain) {
      if (grains.contains(cell.lo)) voxels += volume;
      continue;
    }
    const Box box = to_metres(cell, resolution);
    if (squared_distance(ball.center, box) > radius2) continue;
    voxels += squared_distance_to_farthest_corner(ball.center, box) <= radius2
                  ? volume
                  : grains.volume(cell);
  }
  return voxels * resolution * resolution * resolution;
}

}  // namespace hamelin::scene
