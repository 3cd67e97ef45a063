#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/scene/boxes.hpp"
#include "hamelin/scene/obstacles.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::scene {

/// Which voxels a primitive marks: those that it touches, or those whose centre it contains.
enum class Mark : std::int32_t { touch, centre };

[[nodiscard]] std::string_view to_string(Mark mark) noexcept;
/// @throws Error usage for anything but "touch" and "centre"
[[nodiscard]] Mark mark_from(std::string_view name);

/// Random primitives, uniform in shape, size, position and rotation.
struct Clutter {
  std::size_t count = 0;
  double size_min_m = 0.0, size_max_m = 0.0;  ///< full edges and diameters
  Box bounds;                                 ///< of the centres
  std::vector<Ball> keep_out;                 ///< no primitive overlaps these
  std::uint64_t seed = 1;
};

struct MakeMapOptions {
  double resolution_m = 0.02;
  Mark mark = Mark::touch;
  std::vector<Obstacle> primitives;  ///< in the map's frame, at rest
  std::optional<Clutter> clutter;
  std::optional<Box> free_bounds;  ///< unmarked voxels with their centre inside are free
  std::filesystem::path output;    ///< a .bt file
};

struct MakeReport {
  std::filesystem::path output;
  std::string sha256;
  std::size_t bytes = 0, nodes = 0;
  std::size_t primitives = 0;  ///< clutter included
  std::size_t occupied_voxels = 0, free_voxels = 0;
};

/// The primitives of the clutter; the same seed gives the same primitives.
/// @throws Error invalid if the keep-out balls leave no room
[[nodiscard]] std::vector<Obstacle> make_clutter(const Clutter& clutter);

/// Whether a solid primitive and a cube touch, docs/theory.md (11.33). Exact to 1e-9 m; true in
/// undecided cases.
[[nodiscard]] bool touches(const Obstacle& primitive, const Box& cube);

/// Marks the primitives in an OctoMap and writes it atomically. The same options give the same
/// bytes.
/// @throws Error io, or invalid for sizes, or if more than 2²⁵ cells have to be examined, whose
///        number grows with surfaces, not with volumes
MakeReport make_map(const MakeMapOptions& options);

/// Options from a document of the form hamelin.primitives/1 (docs/schema); `output` is left empty.
/// @throws Error invalid
[[nodiscard]] MakeMapOptions make_options_from_json(const Json& document, const std::string& where);

struct ProblemOptions {
  std::filesystem::path robot, spheres;  ///< spheres may be empty
  std::string tip;                       ///< may be empty
  double resolution_m = 0.02;
  Mark mark = Mark::touch;
  std::filesystem::path output;     ///< the scene; its map gets the extension .bt
  GoalType goal = GoalType::joint;  ///< the goal itself, or the tip's position or pose
};

/// Converts a MotionBenchMaker problem (start, goal, primitives in the robot's base frame) into a
/// map and a scene. The planner sees the map; the primitives are for the judge only. Joint values
/// are matched by order. The map is free up to 0.5 m beyond the arm's reach. Joint, velocity and
/// torque limits, self-collision and gravity are modelled.
/// @throws Error io, parse or invalid, naming the key of the problem that is not understood; then
///        nothing is written
MakeReport make_scene_from_problem(const std::filesystem::path& problem,
                                   const ProblemOptions& options);

}  // namespace hamelin::scene
