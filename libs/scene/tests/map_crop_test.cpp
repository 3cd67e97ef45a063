#include "hamelin/scene/map_crop.hpp"

#include <octomap/OcTree.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <map>
#include <string>

#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/scene/make.hpp"
#include "hamelin/scene/map_field.hpp"
#include "hamelin/test/damaged_maps.hpp"
#include "hamelin/test/scene_data.hpp"
#include "hamelin/test/temporary.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;
using Eigen::Vector3d;

// 'u', 'f' or 'o' by OctoMap's own search.
char kind_at(const octomap::OcTree& tree, const Vector3d& p) {
  const auto* node = tree.search(p.x(), p.y(), p.z());
  return node == nullptr ? 'u' : tree.isNodeOccupied(node) ? 'o' : 'f';
}

std::filesystem::path clutter_map() {
  MakeMapOptions options;
  options.resolution_m = 0.02;
  options.output = test::temporary("hamelin_scene_uncropped.bt");
  options.free_bounds = Box{{-1.1, -0.9, -0.3}, {1.0, 1.2, 1.0}};
  Clutter clutter;
  clutter.count = 60;
  clutter.size_min_m = 0.05;
  clutter.size_max_m = 0.4;
  clutter.bounds = {{-1.2, -1.2, -0.2}, {1.2, 1.2, 1.2}};
  clutter.seed = 3;
  options.clutter = clutter;
  make_map(options);
  return options.output;
}

}  // namespace

TEST_CASE("inside the region a cropped map equals the map, to OctoMap and in distances",
          "[scene][property]") {
  CropOptions options;
  options.map = clutter_map();
  options.output = test::temporary("hamelin_scene_cropped.bt");
  const bool as_ball = GENERATE(true, false);
  const Ball ball{{0.2, -0.1, 0.4}, 0.5};
  const Box box{{-0.3, -0.4, 0.1}, {0.6, 0.2, 0.7}};
  if (as_ball)
    options.region = ball;
  else
    options.region = box;
  const CropReport report = crop_map(options);
  CHECK(report.bytes * 2 < report.bytes_before);
  CHECK(report.bytes == std::filesystem::file_size(options.output));
  CHECK(report.sha256 == sha256_of_file(options.output));
  const octomap::OcTree whole(options.map.string()), part(options.output.string());
  CHECK(part.size() == report.nodes);
  CHECK(part.getResolution() == whole.getResolution());
  const MapData before = read_map(options.map), after = read_map(options.output);
  CHECK(after.occupied.size() == report.occupied_leaves);
  CHECK(before.occupied.size() == report.occupied_leaves_before);
  const MapField far_field(before.occupied, before.resolution, {0.0, 0.0, 0.4}),
      near_field(after.occupied, after.resolution, {0.0, 0.0, 0.4});
  Rng rng(17);
  std::map<char, int> kinds;
  int near = 0;
  for (int i = 0; i < 20000; ++i) {
    const Vector3d p(rng.uniform(-0.4, 0.8), rng.uniform(-0.6, 0.4), rng.uniform(-0.1, 0.9));
    const double depth = as_ball ? ball.radius - (p - ball.center).norm()
                                 : (p - box.lo).cwiseMin(box.hi - p).minCoeff();
    if (depth <= 0.0) continue;
    const char kind = kind_at(whole, p);
    ++kinds[kind];
    REQUIRE(kind_at(part, p) == kind);
    // Obstacles within the region are found at the same distance.
    BoxHit a, b;
    const bool found = far_field.nearest(p, depth, a);
    REQUIRE(near_field.nearest(p, depth, b) == found);
    if (!found || kind == 'o') continue;
    ++near;
    REQUIRE(std::abs(a.distance - b.distance) <= 1e-12);
  }
  CHECK(kinds['o'] > 200);
  CHECK(kinds['f'] > 1000);
  CHECK(near > 1000);
  std::filesystem::remove(options.map);
  std::filesystem::remove(options.output);
}

namespace {

void check_whole_crop(const std::filesystem::path& map) {
  CAPTURE(map);
  CropOptions options;
  options.output = test::temporary("hamelin_scene_whole_crop.bt");
  options.map = map;
  options.region = Ball{{0.0, 0.0, 0.0}, 1e6};
  const CropReport report = crop_map(options);
  const octomap::OcTree theirs(options.map.string()), ours(options.output.string());
  octomap::OcTree pruned(theirs);
  pruned.prune();
  CHECK(ours.size() == pruned.size());
  CHECK(ours == pruned);
  CHECK(report.nodes == pruned.size());
  std::filesystem::remove(options.output);
}

}  // namespace

TEST_CASE("a crop to a region larger than the map gives the tree of the map", "[scene][unit]") {
  for (const char* name : {"shelf.bt", "clutter.bt"}) check_whole_crop(test::data / "maps" / name);
}

TEST_CASE("a crop to a region larger than a real map gives the tree of the map", "[scene][unit]") {
  const auto directory = test::shared_data("maps");
  for (const char* name : {"aurora.bt", "octomap_python_test.bt", "velma_world1.bt", "geb079.bt"})
    check_whole_crop(directory / name);
}

TEST_CASE("a crop is in metres, keeps huge leaves whole and writes unknown space as requested",
          "[scene][unit]") {
  CropOptions options;
  options.output = test::temporary("hamelin_scene_huge_crop.bt");
  options.region = Ball{{-0.3, -0.3, -0.3}, 0.1};
  options.map = test::temporary("hamelin_scene_occupied_root.ot");
  write_file_atomically(options.map, test::occupied_root());
  crop_map(options);
  CHECK(read_map(options.output).occupied.size() ==
        8);  // a .bt cannot express a root that is a leaf
  options.map = test::temporary("hamelin_scene_occupied_octant.bt");
  write_file_atomically(options.map, test::occupied_octant());
  options.region = Ball{{0.0, 0.0, 0.0}, 1.0};
  crop_map(options);
  const MapData kept = read_map(options.output);
  REQUIRE(kept.occupied.size() == 1);
  CHECK(kept.occupied[0].size == 32768);
  CHECK(kept.free_leaves == 0);
  options.unknown_is_free = true;
  CHECK(crop_map(options).free_leaves == 7);
  CHECK(read_map(options.output).unknown.empty());
  options.map = test::temporary("hamelin_scene_millimetre_map.bt");
  write_file_atomically(options.map, test::millimetre_map());
  CHECK_THROWS_WITH(crop_map(options), Catch::Contains("scale"));
  options.read.scale = 0.001;
  options.region = Ball{{0.0, 0.0, 0.0}, 10.0};
  crop_map(options);
  CHECK(read_map(options.output).resolution == 0.05);
  for (const char* name : {"occupied_root.ot", "occupied_octant.bt", "millimetre_map.bt"})
    std::filesystem::remove(test::temporary(std::string("hamelin_scene_") + name));
  std::filesystem::remove(options.output);
}

TEST_CASE("a crop that is not possible is refused and nothing is written", "[scene][unit]") {
  CropOptions options;
  options.map = clutter_map();
  const std::string bytes = read_file(options.map);
  options.output = options.map;
  options.region = Ball{{0.0, 0.0, 0.4}, 0.5};
  CHECK_THROWS_WITH(crop_map(options), Catch::Contains("is the map itself"));
  CHECK(read_file(options.map) == bytes);
  options.output = test::temporary("hamelin_scene_crop.ot");
  CHECK_THROWS_WITH(crop_map(options), Catch::Contains("expected a name that ends in .bt"));
  options.output = test::temporary("hamelin_scene_no_crop.bt");
  options.region = Ball{{300.0, 0.0, 0.4}, 0.5};
  CHECK_THROWS_WITH(crop_map(options), Catch::Contains("nothing of the map is in the region"));
  options.region = Ball{{0.0, 0.0, 0.4}, -0.5};
  CHECK_THROWS_WITH(crop_map(options), Catch::Contains("radius -0.5 m"));
  options.region = Box{{0.0, 0.0, 0.0}, {1.0, 0.0, 1.0}};
  CHECK_THROWS_WITH(crop_map(options), Catch::Contains("first corner"));
  CHECK_FALSE(std::filesystem::exists(options.output));
  std::filesystem::remove(options.map);
}
