#ifdef HAMELIN_WITH_FCL
#include <fcl/geometry/octree/octree.h>
#include <fcl/narrowphase/distance.h>
#include <octomap/OcTree.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "hamelin/scene/distance.hpp"
#include "hamelin/scene/map_file.hpp"
#include "hamelin/test/scene_data.hpp"
#include "hamelin/test/scene_queries.hpp"

using namespace hamelin;
using namespace hamelin::scene;
using Eigen::Vector3d;

// FCL reads the map with OctoMap's reader and shares no code with ours.
namespace {

void check_against_fcl(const std::filesystem::path& file) {
  CAPTURE(file);
  const MapData map = read_map(file);
  std::vector<Box> leaves, merged;
  for (const Cell& cell : map.occupied) leaves.push_back(to_metres(cell, map.resolution));
  for (const VoxelBox& box : merge(map.occupied)) merged.push_back(to_metres(box, map.resolution));
  const BoxField field(merged);
  const auto tree = std::make_shared<octomap::OcTree>(file.string());
  const fcl::OcTreed octree(tree);
  const double radius = 0.02;
  const fcl::Sphered sphere(radius);
  int compared = 0;
  for (const Vector3d& p : test::points_near(leaves, 200, 0.5, 41)) {
    BoxHit hit;
    REQUIRE(field.nearest(p, 10.0, hit));
    if (hit.distance < radius + 1e-3) continue;  // FCL gives no depth
    fcl::Transform3d at = fcl::Transform3d::Identity();
    at.translation() = p;
    const fcl::DistanceRequestd request;
    fcl::DistanceResultd result;
    fcl::distance(&octree, fcl::Transform3d::Identity(), &sphere, at, request, result);
    // OctoMap hands FCL single-precision box corners.
    CHECK(hit.distance - radius == Approx(result.min_distance).margin(2e-6));
    ++compared;
  }
  CHECK(compared > 100);
}

}  // namespace

TEST_CASE("distances to our maps agree with FCL's", "[scene][unit]") {
  for (const char* name : {"shelf.bt", "clutter.bt"}) check_against_fcl(test::data / "maps" / name);
}

TEST_CASE("distances to real maps agree with FCL's", "[scene][unit]") {
  const auto directory = test::shared_data("maps");
  for (const char* name : {"velma_hanas.bt", "velma_world1.bt"})
    check_against_fcl(directory / name);
}
#endif
