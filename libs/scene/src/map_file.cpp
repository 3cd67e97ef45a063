#include "hamelin/scene/map_file.hpp"

#include <fmt/format.h>
#include <octomap/OcTree.h>

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <sstream>

#include "hamelin/core/error.hpp"
#include "hamelin/core/file.hpp"

namespace hamelin::scene {

namespace {

constexpr int max_depth = 16;
constexpr std::string_view first_line_bt = "# Octomap OcTree binary file";
constexpr std::string_view first_line_ot = "# Octomap OcTree file";
constexpr double resolution_min = 1e-5, resolution_max = 1e4;
// OctoMap clamps at ±3.5 unless told otherwise; a hundred is already certainty to 43 digits.
constexpr float log_odds_max = 100.0F;

[[noreturn]] void refuse(const std::string& where, const std::string& place, const std::string& what) {
  throw Error(ErrorCode::parse, fmt::format("{}: {}: {}", where, place, what));
}

// The bytes may be anything: what is shown of them is short and printable.
std::string shown(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, 40)) out += (c >= ' ' && c < '\x7f') ? c : '?';
  return text.size() > 40 ? out + "..." : out;
}

MapFormat format_of(std::string_view bytes, const std::string& where) {
  const auto starts = [&](std::string_view head) { return bytes.substr(0, head.size()) == head; };
  if (bytes.empty()) refuse(where, "byte 0", "the file is empty, expected an OctoMap");
  if (starts("\x1f\x8b")) refuse(where, "byte 0", "gzip-compressed, expected an OctoMap: gunzip it first");
  if (starts("version https://git-lfs"))
    refuse(where, "byte 0", "a Git LFS pointer, expected an OctoMap: run 'git lfs pull' first");
  const std::string_view line = bytes.substr(0, bytes.find('\n'));
  if (starts(first_line_bt) || starts(first_line_ot)) {
    if (line.back() == '\r')
      refuse(where, "header line 1", "ends in CR LF: the file was transferred as text, expected it byte by byte");
    if (line == first_line_bt) return MapFormat::bt;
    if (line == first_line_ot) return MapFormat::ot;
  }
  refuse(where, "header line 1",
         fmt::format(
             "is '{}', expected '{}' or '{}'; a legacy file without header must go through OctoMap's convert_octree",
             shown(line), first_line_bt, first_line_ot));
}

template <typename T>
bool parse_number(std::string_view text, T& value) {
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  return result.ec == std::errc{} && result.ptr == text.data() + text.size();
}

struct StatedHeader {
  MapHeader header;
  int size_line = 0;
};

StatedHeader read_header(std::string_view bytes, const std::string& where) {
  StatedHeader stated;
  auto& header = stated.header;
  header.format = format_of(bytes, where);
  const auto ending = std::filesystem::path(where).extension();
  if ((ending == ".bt" && header.format == MapFormat::ot) || (ending == ".ot" && header.format == MapFormat::bt))
    refuse(where, "header line 1",
           fmt::format("is that of the other format, expected '{}' in a {} file",
                       ending == ".bt" ? first_line_bt : first_line_ot, ending.string()));
  bool has_id = false, has_size = false, has_resolution = false;
  std::size_t at = bytes.find('\n') + 1;
  for (int number = 2;; ++number) {
    const std::string place = fmt::format("header line {}", number);
    const std::size_t end = at == 0 || at >= bytes.size() ? std::string_view::npos : bytes.find('\n', at);
    if (end == std::string_view::npos) refuse(where, place, "the file ends before the line 'data'");
    const std::string_view line = bytes.substr(at, end - at);
    at = end + 1;
    if (line == "data") break;
    if (line.empty() || line.front() == '#') continue;
    if (line.back() == '\r') refuse(where, place, "ends in CR LF, expected LF: the file was transferred as text");
    const std::size_t space = line.find(' ');
    const std::string_view key = line.substr(0, space);
    const std::string_view value = space == std::string_view::npos ? std::string_view{} : line.substr(space + 1);
    const auto once = [&](bool& seen) {
      if (seen) refuse(where, place, fmt::format("'{}' is given twice", key));
      seen = true;
    };
    if (key == "id") {
      once(has_id);
      // The binary form of a coloured tree is the plain one; its full form has wider nodes.
      if (value != "OcTree" && !(value == "ColorOcTree" && header.format == MapFormat::bt))
        refuse(where, place, fmt::format("tree type '{}' is not known, expected OcTree", shown(value)));
    } else if (key == "size") {
      once(has_size);
      stated.size_line = number;
      if (!parse_number(value, header.node_count))
        refuse(where, place, fmt::format("size '{}' is no node count, expected a whole number", shown(value)));
      if (header.node_count == 0) refuse(where, place, "size 0: the map has no nodes, expected at least one");
    } else if (key == "res") {
      once(has_resolution);
      if (!parse_number(value, header.resolution))
        refuse(where, place, fmt::format("res '{}' is no number", shown(value)));
      if (!(header.resolution >= resolution_min && header.resolution <= resolution_max))
        refuse(
            where, place,
            fmt::format("res '{}' is out of range, expected {} to {}", shown(value), resolution_min, resolution_max));
    } else {
      refuse(where, place, fmt::format("'{}' is not known, expected id, size, res or data", shown(line)));
    }
  }
  const char* missing = !has_id ? "id" : !has_size ? "size" : !has_resolution ? "res" : nullptr;
  if (missing != nullptr) refuse(where, "header", fmt::format("the line '{}' is missing", missing));
  header.data_offset = at;
  return stated;
}

// Walks the body depth first, as it is stored. Each level of `waiting` holds a bit for each child still to be read.
class BodyCheck {
 public:
  BodyCheck(std::string_view bytes, std::size_t offset, const std::string& where)
      : bytes_(bytes), at_(offset), where_(where) {}

  std::size_t count_bt() {
    std::size_t nodes = 1;
    walk(max_depth - 1, [&] {  // only inner nodes are stored
      const std::size_t begin = at_;
      const unsigned low = byte(), high = byte();
      const unsigned code = low | (high << 8U);
      unsigned inner = 0;
      for (unsigned child = 0; child < 8; ++child) {
        const unsigned bits = (code >> (2U * child)) & 3U;
        nodes += bits != 0 ? 1 : 0;
        if (bits == 3) inner |= 1U << child;
      }
      if (code == 0) fail(begin, "inner node without children");
      return inner;
    });
    return nodes;
  }

  std::size_t count_ot() {
    std::size_t nodes = 0;
    walk(max_depth, [&] {
      const std::size_t begin = at_;
      std::uint32_t word = 0;
      for (unsigned i = 0; i < 4; ++i) word |= byte() << (8U * i);
      const float log_odds = std::bit_cast<float>(word);
      if (!(std::abs(log_odds) <= log_odds_max))
        fail(begin, fmt::format("log-odds {} of a node, expected a number within ±{}", log_odds, log_odds_max));
      ++nodes;
      return byte();
    });
    return nodes;
  }

 private:
  template <typename ReadNode>
  void walk(int deepest, const ReadNode& read_node) {
    std::array<unsigned, max_depth + 1> waiting{};
    int depth = 0;
    for (bool done = false; !done;) {
      if (depth > deepest) fail(at_, fmt::format("the tree is deeper than {} levels", max_depth));
      waiting[static_cast<std::size_t>(depth)] = read_node();
      while (waiting[static_cast<std::size_t>(depth)] == 0 && depth > 0) --depth;
      auto& here = waiting[static_cast<std::size_t>(depth)];
      done = here == 0;
      here &= here - 1;
      ++depth;
    }
    if (at_ != bytes_.size()) fail(at_, fmt::format("{} bytes behind the end of the tree", bytes_.size() - at_));
  }

  unsigned byte() {
    if (at_ >= bytes_.size()) fail(at_, "the file ends in the middle of the tree");
    return static_cast<unsigned char>(bytes_[at_++]);
  }

  [[noreturn]] void fail(std::size_t offset, const std::string& what) const {
    refuse(where_, fmt::format("byte {}", offset), what);
  }

  std::string_view bytes_;
  std::size_t at_;
  const std::string& where_;
};

void collect_cells(const octomap::OcTree& tree, MapData& map) {
  struct Entry {
    const octomap::OcTreeNode* node;
    Cell cell;
  };
  constexpr std::int32_t half = 1 << (max_depth - 1);
  std::vector<Entry> stack{{tree.getRoot(), {{-half, -half, -half}, 2 * half}}};
  while (!stack.empty()) {
    const Entry entry = stack.back();
    stack.pop_back();
    if (entry.node == nullptr) {
      map.unknown.push_back(entry.cell);
    } else if (!tree.nodeHasChildren(entry.node)) {
      if (tree.isNodeOccupied(entry.node)) {
        map.occupied.push_back(entry.cell);
      } else {
        ++map.free_leaves;
      }
    } else {
      const std::int32_t size = entry.cell.size / 2;
      for (unsigned child = 8; child-- > 0;) {
        Cell cell{entry.cell.lo, size};
        for (unsigned axis = 0; axis < 3; ++axis) cell.lo[axis] += (child >> axis) & 1U ? size : 0;
        stack.push_back(
            {tree.nodeChildExists(entry.node, child) ? tree.getNodeChild(entry.node, child) : nullptr, cell});
      }
    }
  }
}

void warn(MapData& map) {
  if (map.resolution > 0.5)
    map.warnings.push_back(fmt::format("resolution {} m is above 0.5 m: is the scale right?", map.resolution));
  if (map.resolution < 0.001)
    map.warnings.push_back(fmt::format("resolution {} m is below 0.001 m: is the scale right?", map.resolution));
  if (map.occupied.empty()) {
    map.warnings.push_back("no occupied leaf: the map has no obstacles");
  } else if (map.free_leaves == 0) {
    map.warnings.push_back("no free leaf: all that is not occupied is unknown");
  }
  constexpr double huge_m = 10.0;
  std::size_t huge = 0;
  std::int32_t largest = 0;
  for (const Cell& cell : map.occupied) {
    huge += cell.size * map.resolution > huge_m ? 1 : 0;
    largest = std::max(largest, cell.size);
  }
  if (huge > 0)
    map.warnings.push_back(fmt::format("{} occupied leaves are wider than {} m, the widest {} m: kept as single boxes",
                                       huge, huge_m, largest * map.resolution));
}

}  // namespace

MapHeader check_map_bytes(std::string_view bytes, const std::string& where) {
  const StatedHeader stated = read_header(bytes, where);
  BodyCheck body(bytes, stated.header.data_offset, where);
  const std::size_t nodes = stated.header.format == MapFormat::bt ? body.count_bt() : body.count_ot();
  if (nodes != stated.header.node_count)
    refuse(where, fmt::format("header line {}", stated.size_line),
           fmt::format("size {}, but the file has {} nodes", stated.header.node_count, nodes));
  return stated.header;
}

MapData read_map(const std::filesystem::path& file, const ReadMapOptions& options) {
  const std::string where = file.string();
  const auto invalid = [&](const std::string& what) {
    throw Error(ErrorCode::invalid, fmt::format("{}: {}", where, what));
  };
  if (options.scale && !(*options.scale > 0.0 && std::isfinite(*options.scale)))
    invalid(fmt::format("scale {} is not allowed, expected a number above 0", *options.scale));
  if (!(options.occupancy_threshold > 0.0 && options.occupancy_threshold < 1.0))
    invalid(fmt::format("occupancy threshold {} is not allowed, expected above 0 and below 1",
                        options.occupancy_threshold));
  const std::string bytes = read_file(file);
  const MapHeader header = check_map_bytes(bytes, where);
  if (header.resolution > 0.5 && !options.scale)
    invalid(fmt::format(
        "resolution {} is above 0.5: expected an explicit scale, metres per unit of the file (0.001 if it is in "
        "millimetres, 1 if it is meant so)",
        header.resolution));

  MapData map;
  map.file = where;
  map.sha256 = sha256_hex(bytes);
  map.resolution = header.resolution * options.scale.value_or(1.0);
  map.node_count = header.node_count;
  octomap::OcTree tree(header.resolution);
  tree.setOccupancyThres(options.occupancy_threshold);
  std::istringstream body(bytes.substr(header.data_offset));
  if (header.format == MapFormat::bt) {
    tree.readBinaryData(body);
  } else {
    tree.readData(body);
  }
  if (tree.size() != header.node_count)
    invalid(fmt::format("OctoMap reads {} nodes of {}", tree.size(), header.node_count));
  collect_cells(tree, map);
  warn(map);
  return map;
}

}  // namespace hamelin::scene
