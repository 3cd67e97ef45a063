#include <fmt/format.h>
#include <octomap/ColorOcTree.h>
#include <octomap/OcTree.h>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/sweep/judge.hpp"
#include "judge_geometry.hpp"

namespace hamelin::sweep {

using Eigen::Vector3d;

namespace {

// An octree has 2^16 voxels along each axis, half of them on either side of its origin.
constexpr int depth = 16, half_extent = 1 << (depth - 1);
// Changes are applied at ticks, whose times are sums with rounding errors.
constexpr double tick_tolerance_s = 1e-9;
// In voxels: a box with a face at 0.3 m must end at the face of a voxel of 0.1 m, despite rounding.
constexpr double face_tolerance = 1e-9;

/// The leaves of a map as OctoMap lists them [m].
struct Leaves {
  double voxel_m = 0.0;
  std::vector<scene::Box> free, occupied;
};

Leaves read_leaves(const std::filesystem::path& file, const scene::MapSpec& spec) {
  const std::string bytes = read_file(file);
  const auto header = scene::check_map_bytes(bytes, file.string());
  const double scale = spec.scale.value_or(1.0);
  Leaves leaves;
  leaves.voxel_m = scale * header.resolution;
  std::istringstream body(bytes.substr(header.data_offset));
  const auto read_tree = [&](auto tree) {
    if (header.format == scene::MapFormat::bt) {
      tree.readBinaryData(body);
    } else {
      tree.setOccupancyThres(spec.occupancy_threshold);
      tree.readData(body);
    }
    for (auto leaf = tree.begin_leafs(), end = tree.end_leafs(); leaf != end; ++leaf) {
      const Vector3d center{leaf.getX(), leaf.getY(), leaf.getZ()};
      const Vector3d half = Vector3d::Constant(0.5 * leaf.getSize());
      (tree.isNodeOccupied(*leaf) ? leaves.occupied : leaves.free)
          .push_back({scale * (center - half), scale * (center + half)});
    }
  };
  if (header.colored)
    read_tree(octomap::ColorOcTree(header.resolution));
  else
    read_tree(octomap::OcTree(header.resolution));
  return leaves;
}

/// A cube of an octree: 2^level voxels along each edge, with its low corner at `at` times its edge.
struct Cube {
  int level;
  std::array<int, 3> at;

  [[nodiscard]] int lo(std::size_t axis) const { return at[axis] * (1 << level); }
  [[nodiscard]] int hi(std::size_t axis) const { return (at[axis] + 1) * (1 << level); }
  [[nodiscard]] Cube parent() const {
    // the shift rounds down for negative numbers as well
    return {level + 1, {at[0] >> 1, at[1] >> 1, at[2] >> 1}};
  }
  [[nodiscard]] Cube child(unsigned part) const {
    Cube c{level - 1, at};
    for (std::size_t axis = 0; axis < 3; ++axis)
      c.at[axis] = 2 * at[axis] + static_cast<int>(part >> axis & 1U);
    return c;
  }
  // clang-tidy 14 has a false positive here
  auto operator<=>(const Cube&) const = default;  // NOLINT(modernize-use-nullptr)
};

/// How much of a cube is covered.
enum class Coverage { none, part, all };

/// Coverage of a cube by the voxels from lo to hi.
Coverage coverage_of(const Cube& cube, const std::array<int, 3>& lo, const std::array<int, 3>& hi) {
  bool inside = true;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (cube.hi(axis) <= lo[axis] || cube.lo(axis) >= hi[axis]) return Coverage::none;
    inside = inside && cube.lo(axis) >= lo[axis] && cube.hi(axis) <= hi[axis];
  }
  return inside ? Coverage::all : Coverage::part;
}

/// Appends the largest cubes that together make up the voxels from lo to hi inside of `cube`.
void add_cubes(const Cube& cube, const std::array<int, 3>& lo, const std::array<int, 3>& hi,
               std::vector<Cube>& out) {
  const Coverage coverage = coverage_of(cube, lo, hi);
  if (coverage == Coverage::all) out.push_back(cube);
  if (coverage != Coverage::part) return;
  for (unsigned part = 0; part < 8; ++part) add_cubes(cube.child(part), lo, hi, out);
}

std::vector<Cube> cubes_of(const std::array<int, 3>& lo, const std::array<int, 3>& hi) {
  std::vector<Cube> cubes;
  for (unsigned octant = 0; octant < 8; ++octant) {
    const Cube around{
        depth - 1,
        {(octant & 1U) != 0 ? 0 : -1, (octant & 2U) != 0 ? 0 : -1, (octant & 4U) != 0 ? 0 : -1}};
    add_cubes(around, lo, hi, cubes);
  }
  return cubes;
}

/// Space that a change frees: the freed cubes, and the cubes that contain a freed one.
class FreedSpace {
 public:
  void add(const Cube& cube) {
    freed_.insert(cube);
    for (Cube above = cube.parent(); above.level < depth && ancestors_.insert(above).second;)
      above = above.parent();
  }

  [[nodiscard]] Coverage coverage(const Cube& cube) const {
    for (Cube around = cube; around.level < depth; around = around.parent())
      if (freed_.contains(around)) return Coverage::all;
    return ancestors_.contains(cube) ? Coverage::part : Coverage::none;
  }

  /// Appends the parts of a cube that are not freed.
  void subtract_from(const Cube& cube, std::vector<Cube>& kept) const {
    const Coverage freed = coverage(cube);
    if (freed == Coverage::none) kept.push_back(cube);
    if (freed != Coverage::part) return;
    for (unsigned part = 0; part < 8; ++part) subtract_from(cube.child(part), kept);
  }

 private:
  std::set<Cube> freed_, ancestors_;
};

}  // namespace

JudgedMap::JudgedMap(const scene::MapSpec& spec) : from_world_(isometry(spec.pose).inverse()) {
  Leaves leaves = read_leaves(spec.file, spec);
  leaves_ = std::move(leaves.occupied);
  voxel_m_ = leaves.voxel_m;
  for (const auto& change : spec.changes) changes_.push_back(read_change(change, spec));
}

JudgedMap::JudgedMap(const scene::Scene& scene, const JudgedArm& arm) : JudgedMap(*scene.map) {
  if (!scene.map->self_filter_padding_m) return;
  // a row of balls that models a capsule leaves gaps of this size at the capsule's surface
  const double padding = *scene.map->self_filter_padding_m + JudgedArm::capsule_gap_m;
  std::vector<Vector3d> centers;
  arm.place(scene.start_q.size() > 0 ? scene.start_q
                                     : Eigen::VectorXd::Zero(static_cast<Eigen::Index>(arm.dof())),
            centers);
  std::vector<JudgedBall> balls = arm.balls();
  for (std::size_t k = 0; k < balls.size(); ++k) balls[k].center = to_map_frame(centers[k]);
  for (JudgedBall ball : arm.base_balls()) {
    ball.center = to_map_frame(isometry(scene.base) * ball.center);
    balls.push_back(ball);
  }
  const auto touched = [&](const scene::Box& box) {
    return std::any_of(balls.begin(), balls.end(), [&](const JudgedBall& ball) {
      return distance_from_box(box, ball.center) <= ball.radius + padding;
    });
  };
  std::vector<scene::Box> kept;
  while (!leaves_.empty()) {
    const scene::Box box = leaves_.back();
    leaves_.pop_back();
    if (!touched(box)) {
      kept.push_back(box);
    } else if (box.hi.x() - box.lo.x() > 1.5 * voxel_m_) {
      const Vector3d half = 0.5 * (box.hi - box.lo);
      for (unsigned part = 0; part < 8; ++part) {
        const Vector3d lo =
            box.lo + Vector3d((part & 1U) != 0 ? half.x() : 0.0, (part & 2U) != 0 ? half.y() : 0.0,
                              (part & 4U) != 0 ? half.z() : 0.0);
        leaves_.push_back({lo, lo + half});
      }
    }
  }
  leaves_ = std::move(kept);
}

JudgedMap::Change JudgedMap::read_change(const scene::MapChangeSpec& spec,
                                         const scene::MapSpec& map) const {
  Change change{spec.time_s, {}, {}};
  if (spec.file) {
    const Leaves leaves = read_leaves(*spec.file, map);
    if (std::abs(leaves.voxel_m - voxel_m_) > 1e-9 * voxel_m_)
      throw Error(
          ErrorCode::invalid,
          fmt::format(
              "{}: resolution {} m, expected {} m, the resolution of the map that it changes",
              spec.file->string(), leaves.voxel_m, voxel_m_));
    for (const auto& leaf : leaves.free) change.free.push_back(voxels_of(leaf));
    for (const auto& leaf : leaves.occupied) change.occupied.push_back(voxels_of(leaf));
  }
  // all voxels of the octree's range that a box overlaps; touching with a face is not enough
  const auto overlapped = [&](const scene::Box& box) {
    Voxels voxels{};
    const auto clamped = [](double voxel) {
      return static_cast<int>(std::clamp(voxel, -1.0 * half_extent, 1.0 * half_extent));
    };
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<Eigen::Index>(axis);
      voxels.lo[axis] = clamped(std::floor(box.lo[a] / voxel_m_ + face_tolerance));
      voxels.hi[axis] = clamped(std::ceil(box.hi[a] / voxel_m_ - face_tolerance));
    }
    return voxels;
  };
  for (const auto& box : spec.free_m) change.free.push_back(overlapped(box));
  for (const auto& box : spec.occupied_m) change.occupied.push_back(overlapped(box));
  return change;
}

JudgedMap::Voxels JudgedMap::voxels_of(const scene::Box& leaf) const {
  Voxels voxels{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto a = static_cast<Eigen::Index>(axis);
    voxels.lo[axis] = static_cast<int>(std::lround(leaf.lo[a] / voxel_m_));
    voxels.hi[axis] = static_cast<int>(std::lround(leaf.hi[a] / voxel_m_));
  }
  return voxels;
}

scene::Box JudgedMap::box_of(const Voxels& voxels) const {
  const auto corner = [&](const std::array<int, 3>& at) {
    return Vector3d(voxel_m_ * at[0], voxel_m_ * at[1], voxel_m_ * at[2]);
  };
  return {corner(voxels.lo), corner(voxels.hi)};
}

bool JudgedMap::advance(double time_s) {
  const std::size_t before = applied_;
  for (; applied_ < changes_.size() && changes_[applied_].time_s <= time_s + tick_tolerance_s;
       ++applied_) {
    free(changes_[applied_].free);
    for (const Voxels& voxels : changes_[applied_].occupied)
      if (voxels.lo[0] < voxels.hi[0] && voxels.lo[1] < voxels.hi[1] && voxels.lo[2] < voxels.hi[2])
        leaves_.push_back(box_of(voxels));
  }
  return applied_ > before;
}

void JudgedMap::free(const std::vector<Voxels>& freed_voxels) {
  if (freed_voxels.empty()) return;
  FreedSpace freed;
  for (const Voxels& voxels : freed_voxels)
    for (const Cube& cube : cubes_of(voxels.lo, voxels.hi)) freed.add(cube);
  std::vector<scene::Box> kept;
  for (const auto& leaf : leaves_) {
    const Voxels voxels = voxels_of(leaf);
    const auto cubes = cubes_of(voxels.lo, voxels.hi);
    std::vector<Cube> remaining;
    for (const Cube& cube : cubes) freed.subtract_from(cube, remaining);
    if (remaining == cubes) {
      kept.push_back(leaf);
      continue;
    }
    for (const Cube& cube : remaining)
      kept.push_back(
          box_of({{cube.lo(0), cube.lo(1), cube.lo(2)}, {cube.hi(0), cube.hi(1), cube.hi(2)}}));
  }
  leaves_ = std::move(kept);
}

double JudgedMap::distance(const Vector3d& p) const {
  return distance_from_boxes(leaves_, to_map_frame(p));
}

std::vector<scene::Box> JudgedMap::leaves_within(const Vector3d& p, double distance) const {
  const Vector3d at = to_map_frame(p);
  std::vector<scene::Box> found;
  for (const auto& leaf : leaves_)
    if (distance_from_box(leaf, at) <= distance) found.push_back(leaf);
  return found;
}

}  // namespace hamelin::sweep
