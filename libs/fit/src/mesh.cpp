#include "hamelin/fit/mesh.hpp"

#include <assimp/cimport.h>
#include <assimp/config.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <string>

#include "hamelin/core/error.hpp"
#include "hamelin/core/shared_library.hpp"

namespace hamelin::fit {

namespace {

using Eigen::Vector3d;

constexpr std::uintmax_t file_bytes_max = 1ULL << 30;

// The functions of assimp that are used; it is loaded for the first mesh.
struct Assimp {
  SharedLibrary library{HAMELIN_ASSIMP_FILE, "the reader of meshes"};
  HAMELIN_LOADED(library, aiCreatePropertyStore);
  HAMELIN_LOADED(library, aiSetImportPropertyInteger);
  HAMELIN_LOADED(library, aiReleasePropertyStore);
  HAMELIN_LOADED(library, aiImportFileExWithProperties);
  HAMELIN_LOADED(library, aiGetErrorString);
  HAMELIN_LOADED(library, aiReleaseImport);
};

const Assimp& assimp() {
  static const Assimp functions;
  return functions;
}

using ScenePointer = std::unique_ptr<const aiScene, decltype(&aiReleaseImport)>;

// Null if the file cannot be read.
ScenePointer import_scene(const std::filesystem::path& file) {
  const Assimp& with = assimp();
  const std::unique_ptr<aiPropertyStore, decltype(&aiReleasePropertyStore)> options(
      with.aiCreatePropertyStore(), with.aiReleasePropertyStore);
  // ROS tools do not rotate COLLADA meshes to the file's up-axis.
  with.aiSetImportPropertyInteger(options.get(), AI_CONFIG_IMPORT_COLLADA_IGNORE_UP_DIRECTION, 1);
  return {with.aiImportFileExWithProperties(file.c_str(),
                                            aiProcess_Triangulate | aiProcess_PreTransformVertices,
                                            nullptr, options.get()),
          with.aiReleaseImport};
}

[[noreturn]] void fail(ErrorCode code, const std::filesystem::path& file, std::string message) {
  std::replace_if(
      message.begin(), message.end(), [](unsigned char c) { return c < ' '; }, ' ');
  throw Error(code, fmt::format("{}: {}", file.string(), message));
}

void add_triangle(Mesh& mesh, std::size_t a, std::size_t b, std::size_t c) {
  mesh.triangles.push_back(
      {static_cast<std::int32_t>(a), static_cast<std::int32_t>(b), static_cast<std::int32_t>(c)});
}

// Sides of a polygon around a circle whose corners are at most facet_error_m off it:
// docs/theory.md (13.40).
std::size_t sides_around(double radius) {
  const double half_angle = std::acos(radius / (radius + facet_error_m));
  return static_cast<std::size_t>(std::clamp(std::ceil(std::numbers::pi / half_angle), 8.0, 720.0));
}

}  // namespace

Mesh load_mesh(const std::filesystem::path& file, const Vector3d& scale) {
  std::error_code error;
  const auto bytes = std::filesystem::file_size(file, error);
  if (error) fail(ErrorCode::io, file, "cannot be read: " + error.message());
  if (bytes > file_bytes_max)
    fail(ErrorCode::invalid, file,
         fmt::format("has {} bytes, expected a mesh of at most {}", bytes, file_bytes_max));
  const ScenePointer scene = import_scene(file);
  if (scene == nullptr)
    fail(ErrorCode::parse, file, fmt::format("not a mesh: {}", assimp().aiGetErrorString()));
  Mesh mesh;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& part = *scene->mMeshes[m];
    const std::size_t first = mesh.vertices.size();
    if (mesh.triangles.size() + part.mNumFaces > triangles_max)
      fail(ErrorCode::invalid, file,
           fmt::format("has more than {} triangles, expected a coarser mesh", triangles_max));
    for (unsigned v = 0; v < part.mNumVertices; ++v) {
      const aiVector3D& at = part.mVertices[v];
      mesh.vertices.push_back({static_cast<double>(at.x) * scale.x(),
                               static_cast<double>(at.y) * scale.y(),
                               static_cast<double>(at.z) * scale.z()});
      if (!mesh.vertices.back().allFinite() || mesh.vertices.back().norm() > 1e6)
        fail(ErrorCode::invalid, file,
             fmt::format("vertex {} is at ({}, {}, {}), expected finite coordinates within 1e6 m",
                         v, at.x, at.y, at.z));
    }
    for (unsigned f = 0; f < part.mNumFaces; ++f) {
      const aiFace& face = part.mFaces[f];
      if (face.mNumIndices != 3) continue;  // points and lines bound nothing
      for (unsigned k = 0; k < 3; ++k)
        if (face.mIndices[k] >= part.mNumVertices)
          fail(ErrorCode::parse, file,
               fmt::format("face {} names vertex {}, expected an index below {}", f,
                           face.mIndices[k], part.mNumVertices));
      add_triangle(mesh, first + face.mIndices[0], first + face.mIndices[1],
                   first + face.mIndices[2]);
    }
  }
  if (mesh.triangles.empty())
    fail(ErrorCode::invalid, file, "has no triangles, expected a surface");
  return mesh;
}

Mesh box_mesh(const Vector3d& size) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i)
    mesh.vertices.push_back(0.5 * Vector3d((i & 1) != 0 ? size.x() : -size.x(),
                                           (i & 2) != 0 ? size.y() : -size.y(),
                                           (i & 4) != 0 ? size.z() : -size.z()));
  mesh.triangles = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                    {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return mesh;
}

Mesh cylinder_mesh(double radius, double length) {
  Mesh mesh;
  const std::size_t n = sides_around(radius);
  const double step = 2.0 * std::numbers::pi / static_cast<double>(n);
  const double around = radius / std::cos(0.5 * step);
  for (const double z : {-0.5 * length, 0.5 * length})
    for (std::size_t i = 0; i < n; ++i)
      mesh.vertices.push_back({around * std::cos(step * static_cast<double>(i)),
                               around * std::sin(step * static_cast<double>(i)), z});
  for (const double z : {-0.5 * length, 0.5 * length}) mesh.vertices.push_back({0.0, 0.0, z});
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t j = (i + 1) % n;
    add_triangle(mesh, i, j, n + j);
    add_triangle(mesh, i, n + j, n + i);
    add_triangle(mesh, 2 * n, j, i);
    add_triangle(mesh, 2 * n + 1, n + i, n + j);
  }
  return mesh;
}

Mesh ball_mesh(const Vector3d& center, double radius) {
  // Quads between circles of latitude. The radius is raised so that their planes stay outside,
  // docs/theory.md (13.41).
  Mesh mesh;
  const std::size_t around = sides_around(radius), rings = around / 2 + 1;
  const double turn = 2.0 * std::numbers::pi / static_cast<double>(around);
  const double tilt = std::numbers::pi / static_cast<double>(rings);
  const double corner_radius = radius / (std::cos(0.5 * turn) * std::cos(0.5 * tilt));
  const auto at = [&](std::size_t ring, std::size_t i) { return ring * around + i % around; };
  for (std::size_t ring = 0; ring <= rings; ++ring)
    for (std::size_t i = 0; i < around; ++i) {
      const double up = tilt * static_cast<double>(ring), side = turn * static_cast<double>(i);
      const double level = ring == 0 || ring == rings ? 0.0 : std::sin(up);  // the poles are points
      mesh.vertices.push_back(center + corner_radius * Vector3d(level * std::cos(side),
                                                                level * std::sin(side),
                                                                std::cos(up)));
    }
  for (std::size_t ring = 0; ring < rings; ++ring)
    for (std::size_t i = 0; i < around; ++i) {
      if (ring > 0) add_triangle(mesh, at(ring, i), at(ring + 1, i), at(ring, i + 1));
      if (ring + 1 < rings)
        add_triangle(mesh, at(ring, i + 1), at(ring + 1, i), at(ring + 1, i + 1));
    }
  return mesh;
}

void append(Mesh& mesh, const Mesh& other, const geometry::SE3& pose) {
  const auto first = static_cast<std::int32_t>(mesh.vertices.size());
  for (const Vector3d& v : other.vertices) mesh.vertices.push_back(pose * v);
  for (const auto& t : other.triangles)
    mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

}  // namespace hamelin::fit
