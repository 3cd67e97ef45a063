#include "map_maker.hpp"

#include <fmt/format.h>
#include <octomap/octomap.h>

#include <cmath>
#include <sstream>

#include "hamelin/core/error.hpp"

namespace hamelin::app {

using Eigen::Index;

struct MapMaker::Tree {
  octomap::OcTree octree;
  double voxels_per_m;
};

namespace {

// Voxels along each axis that there are keys for: from minus this up.
constexpr int key_limit = 32768;

bool has_key(const Eigen::Vector3f& p, double voxels_per_m) {
  const Eigen::Array3d voxel = (voxels_per_m * p.cast<double>().array()).floor();
  return (voxel >= -key_limit).all() && (voxel < key_limit).all();
}

[[noreturn]] void refuse_map(const std::string& what) {
  throw Error(ErrorCode::invalid, "map of points: " + what);
}

std::size_t voxels_in(const octomap::OcTree& tree, bool occupied) {
  std::size_t sum = 0;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf)
    if (tree.isNodeOccupied(*leaf) == occupied)
      sum += std::size_t{1} << (3 * (tree.getTreeDepth() - leaf.getDepth()));
  return sum;
}

}  // namespace

MapMaker::MapMaker(double resolution_m) {
  if (!(resolution_m > 0.0) || !std::isfinite(resolution_m))
    refuse_map(fmt::format("a resolution of {} m given, expected a positive number", resolution_m));
  tree_ = std::make_unique<Tree>(Tree{octomap::OcTree(resolution_m), 1.0 / resolution_m});
}

MapMaker::~MapMaker() = default;
MapMaker::MapMaker(MapMaker&&) noexcept = default;
MapMaker& MapMaker::operator=(MapMaker&&) noexcept = default;

void MapMaker::insert(const Eigen::Ref<const Eigen::Matrix3Xf>& points,
                      const Eigen::Vector3f& origin, double range_m) {
  const auto check = [&](const Eigen::Vector3f& p, const char* what) {
    if (!p.allFinite() || !has_key(p, tree_->voxels_per_m))
      refuse_map(fmt::format("{} at ({:.6g}, {:.6g}, {:.6g}) m, expected one within {} voxels",
                             what, p[0], p[1], p[2], key_limit));
  };
  check(origin, "a sensor");
  if (!(range_m > 0.0))
    refuse_map(fmt::format("a range of {} m given, expected more than 0", range_m));
  octomap::Pointcloud cloud;
  cloud.reserve(static_cast<std::size_t>(points.cols()));
  for (Index i = 0; i < points.cols(); ++i) {
    check(points.col(i), "a point");
    cloud.push_back(points(0, i), points(1, i), points(2, i));
  }
  tree_->octree.insertPointCloud(cloud, {origin[0], origin[1], origin[2]},
                                 std::isinf(range_m) ? -1.0 : range_m, true, true);
  tree_->octree.updateInnerOccupancy();
}

std::size_t MapMaker::occupied() const {
  return voxels_in(tree_->octree, true);
}

std::size_t MapMaker::free() const {
  return voxels_in(tree_->octree, false);
}

std::string MapMaker::bytes(scene::MapFormat format) {
  tree_->octree.prune();
  std::ostringstream out;
  if (format == scene::MapFormat::bt)
    tree_->octree.writeBinaryConst(out);
  else
    tree_->octree.write(out);
  return out.str();
}

}  // namespace hamelin::app
