#include <octomap/octomap.h>

#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/sensing/occupancy_grid.hpp"
#include "hamelin/sensing/self_filter.hpp"

using namespace hamelin;

namespace {

// What a camera of 320 × 240 points and 60° sees of three shelves before a wall, 1 m away.
Eigen::Matrix3Xf shelf(const Eigen::Vector3f& origin) {
  constexpr int width = 320, height = 240;
  const double focal = 160.0 / std::tan(M_PI / 6.0);
  Eigen::Matrix3Xf points(3, width * height);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const Eigen::Vector3d way(1.0, -(u - 159.5) / focal, -(v - 119.5) / focal);
      double along = 1.0 + 0.002 * std::sin(12.9898 * u + 78.233 * v);
      for (const double level : {0.2, 0.5, 0.8})
        if (const double at = (level - static_cast<double>(origin[2])) / way[2]; at > 0.4)
          along = std::min(along, at);
      points.col(v * width + u) = origin + (along * way).cast<float>();
    }
  return points;
}

}  // namespace

TEST_CASE("frames of 76 800 points", "[sensing][bench]") {
  const Eigen::Vector3f origin(0.2F, 0.01F, 0.63F);
  const Eigen::Matrix3Xf points = shelf(origin);
  sensing::OccupancyGrid grid(0.01, {{-120, -120, -120}, {130, 120, 120}});
  BENCHMARK("grid of 1 cm") {
    return grid.insert(points, origin).size();
  };
  std::vector<Eigen::Vector3d> centers;
  for (int i = 0; i < 60; ++i) centers.emplace_back(0.01 * i, 0.1 * std::sin(0.3 * i), 0.02 * i);
  const std::vector<double> radii(centers.size(), 0.08);
  BENCHMARK("self-filter, 60 spheres") {
    Eigen::Matrix3Xf rest = points;
    return sensing::remove_arm({centers, radii}, 0.02, rest);
  };
  octomap::Pointcloud cloud;
  for (Eigen::Index i = 0; i < points.cols(); ++i)
    cloud.push_back(points(0, i), points(1, i), points(2, i));
  octomap::OcTree tree(0.01);
  BENCHMARK("OctoMap, 1 cm, discretized") {
    tree.insertPointCloud(cloud, {origin[0], origin[1], origin[2]}, -1.0, false, true);
    return tree.size();
  };
}
