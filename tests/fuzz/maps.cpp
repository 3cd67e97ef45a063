#include <algorithm>
#include <cmath>
#include <cstdint>

#include "hamelin/scene/map_file.hpp"
#include "targets.hpp"

namespace hamelin::fuzz {

namespace {

constexpr double tree_volume = 281474976710656.0;  // voxels of an octree of 16 levels: 2^48

double volume(const std::vector<scene::Cell>& cells) {
  double sum = 0.0;
  for (const scene::Cell& cell : cells) {
    require(cell.size > 0 && (cell.size & (cell.size - 1)) == 0, "a cell's size is a power of two");
    for (const auto lo : cell.lo) {
      require(lo >= -32768 && lo + cell.size <= 32768, "a cell lies within the tree");
      require((lo + 32768) % cell.size == 0, "a cell lies on its level's grid");
    }
    sum += std::pow(static_cast<double>(cell.size), 3);
  }
  return sum;
}

}  // namespace

void maps(std::string_view bytes) {
  const std::string file = "map";
  scene::MapHeader header;
  const bool checked = accepts(file, [&] { header = scene::check_map_bytes(bytes, file); });
  scene::MapData map;
  scene::ReadMapOptions options;
  options.keep_free = true;
  if (checked && header.resolution > 0.5) options.scale = 0.001;
  if (checked && header.resolution < 0.001) options.scale = 1000.0;
  const bool read = accepts(file, [&] { map = scene::map_from_bytes(bytes, file, options); });
  require(read == checked, "a map is read if and only if its bytes pass the check");
  if (!read) {
    require(map.occupied.empty() && map.unknown.empty() && map.file.empty(),
            "a refused map leaves no data behind");
    return;
  }
  // The extension of the file name must match the format.
  const bool bt = accepts("map.bt", [&] { (void)scene::check_map_bytes(bytes, "map.bt"); });
  require(bt == (header.format == scene::MapFormat::bt), "a .bt file has the binary format");
  require(map.node_count == header.node_count, "the node count equals that of the header");
  require(map.free.size() == map.free_leaves, "the free leaves are counted");
  require(map.occupied.size() + map.free_leaves <= map.node_count,
          "there are no more leaves than nodes");
  require(map.resolution > 0.0 && map.resolution <= 1e4, "the resolution is in its range");
  // Volumes are integers below 2^53, so that their sum is exact.
  require(volume(map.occupied) + volume(map.unknown) + volume(map.free) == tree_volume,
          "occupied, free and unknown cells fill the tree");
  std::vector<scene::Cell> all = map.occupied;
  all.insert(all.end(), map.unknown.begin(), map.unknown.end());
  all.insert(all.end(), map.free.begin(), map.free.end());
  std::sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.lo < b.lo; });
  const auto duplicate = std::adjacent_find(
      all.begin(), all.end(), [](const auto& a, const auto& b) { return a.lo == b.lo; });
  require(duplicate == all.end(), "no two cells have the same lower corner");
}

}  // namespace hamelin::fuzz
