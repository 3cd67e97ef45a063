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

/// Where mesh files are searched for.
struct MeshPlaces {
  /// NAME of package://NAME/…, and the folder of that package.
  std::vector<std::pair<std::string, std::filesystem::path>> packages;
  /// Searched for the mesh's path, and for the ends of that path.
  std::vector<std::filesystem::path> folders;
};

/// Finds the mesh file that a URDF names: package://NAME/PATH or model://NAME/PATH in NAME's
/// folder, file://PATH, or a path relative to the URDF's folder. If that file does not exist, the
/// path and its ends (without the first folder, the first two, …) are searched below each of
/// `folders`, below the URDF's folder and below the folders above it.
/// @param urdf the file that names the mesh
/// @param tried receives the paths that were tried
/// @return none if there is no such file
[[nodiscard]] std::optional<std::filesystem::path> find_mesh(
    const std::string& name, const std::filesystem::path& urdf, const MeshPlaces& places,
    std::vector<std::filesystem::path>* tried = nullptr);

struct FitOptions {
  CoverOptions cover;
  std::optional<int> total;  ///< most shapes of all links together; the excess is then minimized
  double padding_m = 0.0;    ///< added to all radii after fitting
  bool visual = false;       ///< use `<visual>` where a link has no `<collision>`
  MeshPlaces meshes;
  double tolerance_m = 1e-4;  ///< of the bound of the coverage gap
};

/// One link's shapes and how they fit its geometry; link frame.
struct LinkFit {
  std::string name;
  std::size_t triangles = 0;
  bool closed = true;  ///< whether its meshes are closed
  std::vector<Shape> shapes;
  Gap gap;
  Excess excess;
  double volume_m3 = 0.0;  ///< of the geometry
};

struct RobotFit {
  std::vector<LinkFit> links;  ///< links with geometry, in the file's order
  std::vector<std::string> notes;
  [[nodiscard]] std::size_t shapes() const;
  [[nodiscard]] double gap_bound_m() const;    ///< largest of all links
  [[nodiscard]] double excess_max_m() const;   ///< largest of all links
  [[nodiscard]] double excess_mean_m() const;  ///< over the surfaces of all links' shapes
  [[nodiscard]] double volume_ratio() const;   ///< volume of all shapes over that of all geometry
};

/// Fits shapes to all links with geometry of a URDF.
/// @throws Error io, parse, invalid or usage: "file: line N: link 'x': what is wrong"
[[nodiscard]] RobotFit fit_robot(const std::filesystem::path& urdf, const FitOptions& options);

/// Measures the shapes of a sidecar file against the geometry of its URDF. Links without shapes
/// have an infinite gap.
/// @throws Error as fit_robot
[[nodiscard]] RobotFit measure_sidecar(const std::filesystem::path& urdf,
                                       const std::filesystem::path& sidecar,
                                       const FitOptions& options);

/// The sidecar document that read_robot reads as RobotOptions::spheres.
[[nodiscard]] Json sidecar_json(
    const RobotFit& fit, const std::string& note,
    const std::vector<std::pair<std::string, std::string>>& self_collision_disabled);

/// Figures per link and in total, for --json.
[[nodiscard]] Json figures_json(const RobotFit& fit);

/// One line for the note of a sidecar: what was covered, the coverage gap and the excess.
/// @param capsules whether capsules were allowed
[[nodiscard]] std::string sidecar_note(const RobotFit& fit, const std::filesystem::path& urdf,
                                       bool capsules);

}  // namespace hamelin::fit
