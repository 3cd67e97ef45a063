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
constexpr int depth = 16, outermost = 1 << (depth - 1);
// Changes are made at ticks: times of ticks are sums, and carry their rounding.
constexpr double tick_hair_s = 1e-9;
// Of a voxel: a box's face at 0.3 m is that of a voxel of 0.1 m.
constexpr double face_hair = 1e-9;

/// A map's leaves as OctoMap lists them [m].
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
  const auto take = [&](auto tree) {
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
    take(octomap::ColorOcTree(header.resolution));
  else
    take(octomap::OcTree(header.resolution));
  return leaves;
}

/// A cube of an octree: 2^level voxels along each edge, its low corner at `at` times that.
struct Cube {
  int level;
  std::array<int, 3> at;

  [[nodiscard]] int lo(std::size_t axis) const { return at[axis] * (1 << level); }
  [[nodiscard]] int hi(std::size_t axis) const { return (at[axis] + 1) * (1 << level); }
  [[nodiscard]] Cube parent() const {
    // rounds down, below zero too
    return {level + 1, {at[0] >> 1, at[1] >> 1, at[2] >> 1}};
  }
  [[nodiscard]] Cube child(unsigned part) const {
    Cube c{level - 1, at};
    for (std::size_t axis = 0; axis < 3; ++axis) c.at[axis] = 2 * at[axis] + static_cast<int>(part >> axis & 1U);
    return c;
  }
  auto operator<=>(const Cube&) const = default;  // NOLINT(modernize-use-nullptr): clang-tidy 14 sees a 0 in it
};

enum class Share { none, part, all };

/// How much of a cube the voxels from lo to hi hold.
Share share_of(const Cube& cube, const std::array<int, 3>& lo, const std::array<int, 3>& hi) {
  bool inside = true;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (cube.hi(axis) <= lo[axis] || cube.lo(axis) >= hi[axis]) return Share::none;
    inside = inside && cube.lo(axis) >= lo[axis] && cube.hi(axis) <= hi[axis];
  }
  return inside ? Share::all : Share::part;
}

/// The largest cubes that the voxels from lo to hi are made of.
void add_cubes(const Cube& within, const std::array<int, 3>& lo, const std::array<int, 3>& hi, std::vector<Cube>& out) {
  const Share share = share_of(within, lo, hi);
  if (share == Share::all) out.push_back(within);
  if (share != Share::part) return;
  for (unsigned part = 0; part < 8; ++part) add_cubes(within.child(part), lo, hi, out);
}

std::vector<Cube> cubes_of(const std::array<int, 3>& lo, const std::array<int, 3>& hi) {
  std::vector<Cube> cubes;
  for (unsigned octant = 0; octant < 8; ++octant) {
    const Cube around{depth - 1,
                      {(octant & 1U) != 0 ? 0 : -1, (octant & 2U) != 0 ? 0 : -1, (octant & 4U) != 0 ? 0 : -1}};
    add_cubes(around, lo, hi, cubes);
  }
  return cubes;
}

/// Space that a change frees: which cubes wholly, and which hold such cubes.
class Freed {
 public:
  void add(const Cube& cube) {
    whole_.insert(cube);
    for (Cube above = cube.parent(); above.level < depth && holding_.insert(above).second;) above = above.parent();
  }

  [[nodiscard]] Share of(const Cube& cube) const {
    for (Cube around = cube; around.level < depth; around = around.parent())
      if (whole_.contains(around)) return Share::all;
    return holding_.contains(cube) ? Share::part : Share::none;
  }

  /// What of a cube stays.
  void subtract_from(const Cube& cube, std::vector<Cube>& kept) const {
    const Share freed = of(cube);
    if (freed == Share::none) kept.push_back(cube);
    if (freed != Share::part) return;
    for (unsigned part = 0; part < 8; ++part) subtract_from(cube.child(part), kept);
  }

 private:
  std::set<Cube> whole_, holding_;
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
  // balls that stand for a capsule leave that much of it out
  const double padding = *scene.map->self_filter_padding_m + JudgedArm::capsule_gap_m;
  std::vector<Vector3d> centers;
  arm.place(scene.start_q.size() > 0 ? scene.start_q : Eigen::VectorXd::Zero(static_cast<Eigen::Index>(arm.dof())),
            centers);
  std::vector<JudgedBall> balls = arm.balls();
  for (std::size_t k = 0; k < balls.size(); ++k) balls[k].center = local(centers[k]);
  for (JudgedBall ball : arm.base_balls()) {
    ball.center = local(isometry(scene.base) * ball.center);
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
        const Vector3d lo = box.lo + Vector3d((part & 1U) != 0 ? half.x() : 0.0, (part & 2U) != 0 ? half.y() : 0.0,
                                              (part & 4U) != 0 ? half.z() : 0.0);
        leaves_.push_back({lo, lo + half});
      }
    }
  }
  leaves_ = std::move(kept);
}

JudgedMap::Change JudgedMap::read_change(const scene::MapChangeSpec& spec, const scene::MapSpec& map) const {
  Change change{spec.time_s, {}, {}};
  if (spec.file) {
    const Leaves leaves = read_leaves(*spec.file, map);
    if (std::abs(leaves.voxel_m - voxel_m_) > 1e-9 * voxel_m_)
      throw Error(ErrorCode::invalid, fmt::format("{}: resolution {} m, expected {} m as the map that it changes",
                                                  spec.file->string(), leaves.voxel_m, voxel_m_));
    for (const auto& leaf : leaves.free) change.free.push_back(voxels_of(leaf));
    for (const auto& leaf : leaves.occupied) change.occupied.push_back(voxels_of(leaf));
  }
  // all voxels that a box touches with more than its faces, as far as an octree reaches
  const auto touched = [&](const scene::Box& box) {
    Voxels voxels{};
    const auto within = [](double voxel) {
      return static_cast<int>(std::clamp(voxel, -1.0 * outermost, 1.0 * outermost));
    };
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<Eigen::Index>(axis);
      voxels.lo[axis] = within(std::floor(box.lo[a] / voxel_m_ + face_hair));
      voxels.hi[axis] = within(std::ceil(box.hi[a] / voxel_m_ - face_hair));
    }
    return voxels;
  };
  for (const auto& box : spec.free_m) change.free.push_back(touched(box));
  for (const auto& box : spec.occupied_m) change.occupied.push_back(touched(box));
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
  const std::size_t before = made_;
  for (; made_ < changes_.size() && changes_[made_].time_s <= time_s + tick_hair_s; ++made_) {
    free(changes_[made_].free);
    for (const Voxels& voxels : changes_[made_].occupied)
      if (voxels.lo[0] < voxels.hi[0] && voxels.lo[1] < voxels.hi[1] && voxels.lo[2] < voxels.hi[2])
        leaves_.push_back(box_of(voxels));
  }
  return made_ > before;
}

void JudgedMap::free(const std::vector<Voxels>& freed_voxels) {
  if (freed_voxels.empty()) return;
  Freed freed;
  for (const Voxels& voxels : freed_voxels)
    for (const Cube& cube : cubes_of(voxels.lo, voxels.hi)) freed.add(cube);
  std::vector<scene::Box> kept;
  for (const auto& leaf : leaves_) {
    const Voxels voxels = voxels_of(leaf);
    const auto cubes = cubes_of(voxels.lo, voxels.hi);
    std::vector<Cube> left;
    for (const Cube& cube : cubes) freed.subtract_from(cube, left);
    if (left == cubes) {
      kept.push_back(leaf);
      continue;
    }
    for (const Cube& cube : left)
      kept.push_back(box_of({{cube.lo(0), cube.lo(1), cube.lo(2)}, {cube.hi(0), cube.hi(1), cube.hi(2)}}));
  }
  leaves_ = std::move(kept);
}

double JudgedMap::distance(const Vector3d& p) const {
  return distance_from_boxes(leaves_, local(p));
}

std::vector<scene::Box> JudgedMap::near(const Vector3d& p, double distance) const {
  const Vector3d at = local(p);
  std::vector<scene::Box> found;
  for (const auto& leaf : leaves_)
    if (distance_from_box(leaf, at) <= distance) found.push_back(leaf);
  return found;
}

}  // namespace hamelin::sweep
