#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/fit/mesh.hpp"
#include "hamelin/test/temporary.hpp"

/// Meshes and files for the tests, made here and not by the library.
namespace hamelin::test {

using fit::Mesh;

using Eigen::Vector3d;

/// Several boxes, each with its own closed surface.
inline Mesh boxes(const std::vector<std::array<Vector3d, 2>>& low_high) {
  Mesh mesh;
  for (const auto& [low, high] : low_high) {
    const auto first = static_cast<std::int32_t>(mesh.vertices.size());
    for (int i = 0; i < 8; ++i)
      mesh.vertices.emplace_back((i & 1) != 0 ? high.x() : low.x(),
                                 (i & 2) != 0 ? high.y() : low.y(),
                                 (i & 4) != 0 ? high.z() : low.z());
    for (const auto& [a, b, c, d] : std::vector<std::array<int, 4>>{
             {0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}) {
      mesh.triangles.push_back({first + a, first + b, first + c});
      mesh.triangles.push_back({first + a, first + c, first + d});
    }
  }
  return mesh;
}

/// An L of two arms, 0.3 m long and 0.08 thick, as one prism.
inline Mesh l_shape() {
  const std::vector<std::array<double, 2>> outline{{0.0, 0.0},   {0.3, 0.0},  {0.3, 0.08},
                                                   {0.08, 0.08}, {0.08, 0.3}, {0.0, 0.3}};
  Mesh mesh;
  for (const double z : {0.0, 0.08})
    for (const auto& [x, y] : outline) mesh.vertices.emplace_back(x, y, z);
  for (int i = 0; i < 6; ++i) {
    const int j = (i + 1) % 6;
    mesh.triangles.push_back({i, j, 6 + j});
    mesh.triangles.push_back({i, 6 + j, 6 + i});
  }
  for (const auto& [a, b, c] :
       std::vector<std::array<int, 3>>{{0, 3, 1}, {1, 3, 2}, {0, 4, 3}, {0, 5, 4}}) {
    mesh.triangles.push_back({a, b, c});
    mesh.triangles.push_back({6 + a, 6 + c, 6 + b});
  }
  return mesh;
}

/// A tube along z; its ends open or closed.
inline Mesh tube(double radius, double length, int sides, bool ends) {
  Mesh mesh;
  for (const double z : {0.0, length})
    for (int i = 0; i < sides; ++i)
      mesh.vertices.emplace_back(radius * std::cos(2.0 * M_PI * i / sides),
                                 radius * std::sin(2.0 * M_PI * i / sides), z);
  mesh.vertices.emplace_back(0.0, 0.0, 0.0);
  mesh.vertices.emplace_back(0.0, 0.0, length);
  for (int i = 0; i < sides; ++i) {
    const int j = (i + 1) % sides;
    mesh.triangles.push_back({i, j, sides + j});
    mesh.triangles.push_back({i, sides + j, sides + i});
    if (!ends) continue;
    mesh.triangles.push_back({2 * sides, j, i});
    mesh.triangles.push_back({2 * sides + 1, sides + i, sides + j});
  }
  return mesh;
}

/// A ball, triangulated along its circles of latitude.
inline Mesh ball(double radius, int rings) {
  Mesh mesh;
  const int around = 2 * rings;
  for (int r = 0; r <= rings; ++r)
    for (int i = 0; i < around; ++i) {
      const double up = M_PI * r / rings, side = 2.0 * M_PI * i / around;
      mesh.vertices.emplace_back(radius * std::sin(up) * std::cos(side),
                                 radius * std::sin(up) * std::sin(side), radius * std::cos(up));
    }
  for (int r = 0; r < rings; ++r)
    for (int i = 0; i < around; ++i) {
      const int a = r * around + i, b = r * around + (i + 1) % around;
      mesh.triangles.push_back({a, a + around, b + around});
      mesh.triangles.push_back({a, b + around, b});
    }
  return mesh;
}

inline std::string binary_stl(const Mesh& mesh) {
  std::string bytes(80, ' ');
  const auto add = [&](const auto& value) {
    std::array<char, sizeof value> raw{};
    std::memcpy(raw.data(), &value, sizeof value);
    bytes.append(raw.data(), raw.size());
  };
  add(static_cast<std::uint32_t>(mesh.triangles.size()));
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) add(0.0F);
    for (std::size_t corner = 0; corner < 3; ++corner)
      for (int k = 0; k < 3; ++k) add(static_cast<float>(mesh.corner(t, corner)[k]));
    add(std::uint16_t{0});
  }
  return bytes;
}

inline std::string numbers(const Vector3d& v) {
  return std::to_string(v.x()) + " " + std::to_string(v.y()) + " " + std::to_string(v.z());
}

inline std::string ascii_stl(const Mesh& mesh) {
  std::string text = "solid test\n";
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    text += "facet normal 0 0 0\nouter loop\n";
    for (std::size_t k = 0; k < 3; ++k) text += "vertex " + numbers(mesh.corner(t, k)) + "\n";
    text += "endloop\nendfacet\n";
  }
  return text + "endsolid test\n";
}

inline std::string obj(const Mesh& mesh) {
  std::string text;
  for (const Vector3d& v : mesh.vertices) text += "v " + numbers(v) + "\n";
  for (const auto& t : mesh.triangles)
    text += "f " + std::to_string(t[0] + 1) + " " + std::to_string(t[1] + 1) + " " +
            std::to_string(t[2] + 1) + "\n";
  return text;
}

/// Random points of a surface, uniform by area.
inline std::vector<Vector3d> random_points(const Mesh& mesh, std::size_t count,
                                           std::uint64_t seed) {
  std::vector<double> sums;
  double area = 0.0;
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vector3d a = mesh.corner(t, 0), b = mesh.corner(t, 1) - a, c = mesh.corner(t, 2) - a;
    area += 0.5 * std::sqrt(std::max(0.0, b.squaredNorm() * c.squaredNorm() - b.dot(c) * b.dot(c)));
    sums.push_back(area);
  }
  Rng rng(seed);
  std::vector<Vector3d> points;
  while (points.size() < count) {
    const double at = rng.uniform(0.0, area);
    const auto t =
        static_cast<std::size_t>(std::lower_bound(sums.begin(), sums.end(), at) - sums.begin());
    double u = rng.uniform(), v = rng.uniform();
    if (u + v > 1.0) {
      u = 1.0 - u;
      v = 1.0 - v;
    }
    points.emplace_back((1.0 - u - v) * mesh.corner(t, 0) + u * mesh.corner(t, 1) +
                        v * mesh.corner(t, 2));
  }
  return points;
}

}  // namespace hamelin::test
