#pragma once
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/fit/cover.hpp"
#include "hamelin/fit/coverage.hpp"
#include "hamelin/fit/shape.hpp"
#include "hamelin/io/json.hpp"

namespace hamelin::fit {

/// Where meshes are looked for.
struct MeshPlaces {
  std::vector<std::pair<std::string, std::filesystem::path>> packages;  ///< NAME of package://NAME/…, its folder
  std::vector<std::filesystem::path> folders;  ///< tried with the mesh's path and ever shorter ends of it
};

/// The file that a URDF means: package://NAME/PATH in NAME's folder, file://PATH, or a path from the URDF's own folder;
/// where that is absent, the path and its ever shorter ends below each of `folders` and below the URDF's folder and the
/// folders above it.
/// @param urdf the file that names it
/// @param tried receives what was looked at
/// @return none if there is no such file
[[nodiscard]] std::optional<std::filesystem::path> find_mesh(const std::string& name, const std::filesystem::path& urdf,
                                                             const MeshPlaces& places,
                                                             std::vector<std::filesystem::path>* tried = nullptr);

struct FitOptions {
  CoverOptions cover;
  std::optional<int> total;  ///< as many shapes in all, at most: the excess is then the least that does
  double padding_m = 0.0;    ///< added to all radii at last
  bool visual = false;       ///< take <visual> where a link has no <collision>
  MeshPlaces meshes;
  double tolerance_m = 1e-4;  ///< to which the coverage gap is bounded
};

/// One link's shapes beside its geometry; link frame.
struct LinkFit {
  std::string name;
  std::size_t triangles = 0;
  bool closed = true;  ///< whether its meshes are
  std::vector<Shape> shapes;
  Gap gap;
  Excess excess;
  double volume_m3 = 0.0;  ///< of the geometry
};

struct RobotFit {
  std::vector<LinkFit> links;  ///< those with geometry, in the file's order
  std::vector<std::string> notes;
  [[nodiscard]] std::size_t shapes() const;
  [[nodiscard]] double gap_bound_m() const;    ///< the largest
  [[nodiscard]] double excess_max_m() const;   ///< the largest
  [[nodiscard]] double excess_mean_m() const;  ///< over the surfaces of all links' shapes
  [[nodiscard]] double volume_ratio() const;   ///< of all shapes to all geometry
};

/// Fits shapes to all links of a .urdf that have geometry.
/// @throws Error io, parse, invalid or usage: "file: line N: link 'x': what is wrong"
[[nodiscard]] RobotFit fit_robot(const std::filesystem::path& urdf, const FitOptions& options);

/// Measures the shapes of a sidecar against the geometry of the same .urdf. Links without shapes have an infinite gap.
/// @throws Error as fit_robot
[[nodiscard]] RobotFit measure_sidecar(const std::filesystem::path& urdf, const std::filesystem::path& sidecar,
                                       const FitOptions& options);

/// The sidecar that read_robot takes as RobotOptions::spheres.
[[nodiscard]] Json sidecar_json(const RobotFit& fit, const std::string& note,
                                const std::vector<std::pair<std::string, std::string>>& self_collision_disabled);

/// Figures by link and in all, for --json.
[[nodiscard]] Json figures_json(const RobotFit& fit);

}  // namespace hamelin::fit
