#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace hamelin::scene {

/// A cell of the octree: the cube [lo, lo + size)³, counted in voxels from the map's origin. Never expanded: a pruned
/// leaf of a kilometre stays one cell.
struct Cell {
  std::array<std::int32_t, 3> lo{};
  std::int32_t size = 1;
};

enum class MapFormat : std::int32_t { bt, ot };

/// What a map file's header says, and how many nodes its body really has.
struct MapHeader {
  MapFormat format = MapFormat::bt;
  bool colored = false;         ///< a ColorOcTree: in a .ot each node has three bytes more
  double resolution = 0.0;      ///< edge of a voxel, in the file's own unit
  std::size_t node_count = 0;   ///< inner nodes and leaves
  std::size_t data_offset = 0;  ///< first byte of the body
};

/// Checks every byte of a `.bt` or `.ot` file (OcTree or ColorOcTree) without recursion: header, depth of at most 16,
/// no inner node without children, finite log-odds within ±100, node count as stated, nothing missing and nothing
/// behind the end.
/// @param where the file's name, opens each message; its ending, if .bt or .ot, must agree with the first line
/// @throws Error parse, naming the header line or the byte
[[nodiscard]] MapHeader check_map_bytes(std::string_view bytes, const std::string& where);

struct ReadMapOptions {
  std::optional<double> scale;       ///< metres per unit of the file; must be given where the resolution is above 0.5
  double occupancy_threshold = 0.5;  ///< a leaf of a `.ot` is occupied from this probability on; a `.bt` has no grades
  bool keep_free = false;            ///< whether MapData::free is wanted
};

/// An OctoMap as the cells that matter here, in the file's order. Free space is what `occupied` and `unknown` leave.
struct MapData {
  std::string file;
  std::string sha256;       ///< of the file's bytes
  double resolution = 0.0;  ///< edge of a voxel [m], scale applied
  std::size_t node_count = 0;
  std::size_t free_leaves = 0;
  std::vector<Cell> occupied;         ///< occupied leaves
  std::vector<Cell> unknown;          ///< cells the tree says nothing about
  std::vector<Cell> free;             ///< free leaves, if asked for
  std::vector<std::string> warnings;  ///< one line each, without the file's name
};

/// Checks the bytes as check_map_bytes() does, then takes the cells from them: what is refused leaves nothing. Memory:
/// 16 bytes a cell, at most 64 times the bytes.
/// @param where the map's name, see check_map_bytes
/// @throws Error parse or invalid, one line
[[nodiscard]] MapData map_from_bytes(std::string_view bytes, const std::string& where,
                                     const ReadMapOptions& options = {});

/// The map in a file. @throws Error io, parse or invalid, one line
[[nodiscard]] MapData read_map(const std::filesystem::path& file, const ReadMapOptions& options = {});

}  // namespace hamelin::scene
