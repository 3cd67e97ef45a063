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

/// A cell of the octree: the cube [lo, lo + size)³ in voxels from the map's origin. Cells are never
/// expanded: a pruned leaf of a kilometre stays one cell.
struct Cell {
  std::array<std::int32_t, 3> lo{};
  std::int32_t size = 1;
};

enum class MapFormat : std::int32_t { bt, ot };

/// The header of a map file, with the number of nodes that its body was checked to have.
struct MapHeader {
  MapFormat format = MapFormat::bt;
  bool colored = false;         ///< a ColorOcTree: each node of a .ot has three more bytes
  double resolution = 0.0;      ///< edge of a voxel, in the file's own unit
  std::size_t node_count = 0;   ///< inner nodes and leaves
  std::size_t data_offset = 0;  ///< first byte of the body
};

/// Checks every byte of a `.bt` or `.ot` file (OcTree or ColorOcTree) without recursion: header,
/// depth of at most 16, no inner node without children, finite log-odds within ±100, node count as
/// stated, no missing bytes and no bytes after the end.
/// @param where the file's name, the prefix of each message; its ending, if .bt or .ot, must agree
///        with the first line
/// @throws Error parse, naming the header line or the byte
[[nodiscard]] MapHeader check_map_bytes(std::string_view bytes, const std::string& where);

struct ReadMapOptions {
  std::optional<double> scale;       ///< metres per unit; required if the resolution is above 0.5
  double occupancy_threshold = 0.5;  ///< least probability of an occupied leaf of a `.ot`
  bool keep_free = false;            ///< whether to fill MapData::free
};

/// An OctoMap as lists of cells in the file's order. Free space is everything that is neither
/// occupied nor unknown.
struct MapData {
  std::string file;
  std::string sha256;       ///< of the file's bytes
  double resolution = 0.0;  ///< edge of a voxel [m], scale applied
  std::size_t node_count = 0;
  std::size_t free_leaves = 0;
  std::vector<Cell> occupied;         ///< occupied leaves
  std::vector<Cell> unknown;          ///< cells for which the tree has no node
  std::vector<Cell> free;             ///< free leaves, if ReadMapOptions::keep_free is set
  std::vector<std::string> warnings;  ///< one line each, without the file's name
};

/// Checks the bytes as check_map_bytes() does, then extracts the cells; a file that is refused
/// allocates none. Memory: 16 bytes per cell, at most 64 times the number of bytes.
/// @param where the map's name, see check_map_bytes
/// @throws Error parse or invalid, one line
[[nodiscard]] MapData map_from_bytes(std::string_view bytes, const std::string& where,
                                     const ReadMapOptions& options = {});

/// The map in a file. @throws Error io, parse or invalid, one line
[[nodiscard]] MapData read_map(const std::filesystem::path& file,
                               const ReadMapOptions& options = {});

}  // namespace hamelin::scene
