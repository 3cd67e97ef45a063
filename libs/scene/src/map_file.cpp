#include "hamelin/scene/map_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "map_header.hpp"

namespace hamelin::scene {

namespace {

constexpr std::size_t max_depth = 16;
// OctoMap clamps at ±3.5 by default. A log-odds of 100 is certainty to 43 digits.
constexpr float log_odds_max = 100.0F;

enum class CellState { unknown, free, occupied };

// Traverses the body depth first, in the order of the file, without recursion, and checks every
// byte. `visit(CellState, Cell)` is called for each leaf and for each missing child of an inner
// node. Returns the number of nodes.
class Body {
 public:
  Body(std::string_view bytes, const MapHeader& header, float threshold, const std::string& where)
      : bytes_(bytes), header_(header), threshold_(threshold), where_(where) {}

  template <typename Visit>
  std::size_t walk(const Visit& visit) {
    at_ = header_.data_offset;
    const std::size_t nodes = header_.format == MapFormat::bt ? walk_bt(visit) : walk_ot(visit);
    if (at_ != bytes_.size())
      fail(at_, fmt::format("{} bytes after the end of the tree", bytes_.size() - at_));
    return nodes;
  }

 private:
  struct Level {
    unsigned children = 0;  // code of a .bt, two bits per child, or mask of a .ot
    unsigned next = 0;
    std::array<std::int32_t, 3> lo{};
  };
  static constexpr std::int32_t half = 1 << (max_depth - 1);

  // A .bt stores inner nodes only: two bytes each, with two bits per child.
  template <typename Visit>
  std::size_t walk_bt(const Visit& visit) {
    std::size_t nodes = 1, depth = 0;
    levels_[0] = {code(), 0, {-half, -half, -half}};
    for (;;) {
      Level& level = levels_[depth];
      if (level.next == 8) {
        if (depth-- == 0) return nodes;
        continue;
      }
      const unsigned bits = (level.children >> (2U * level.next)) & 3U;
      const Cell cell = child_of(level, depth);
      ++level.next;
      nodes += bits != 0 ? 1 : 0;
      if (bits != 3) {
        visit(bits == 0   ? CellState::unknown
              : bits == 1 ? CellState::free
                          : CellState::occupied,
              cell);
      } else {
        if (++depth == max_depth) fail(at_, too_deep);
        levels_[depth] = {code(), 0, cell.lo};
      }
    }
  }

  // A .ot stores every node: its log-odds, its colour in a ColorOcTree, one bit per child.
  template <typename Visit>
  std::size_t walk_ot(const Visit& visit) {
    std::size_t nodes = 0, depth = 0;
    const auto enter = [&](const Cell& cell) {
      ++nodes;
      const CellState state = log_odds() >= threshold_ ? CellState::occupied : CellState::free;
      if (header_.colored)
        for (int i = 0; i < 3; ++i) byte();
      levels_[depth] = {byte(), 0, cell.lo};
      if (levels_[depth].children == 0) {
        levels_[depth].next = 8;
        visit(state, cell);
      }
    };
    enter({{-half, -half, -half}, 2 * half});
    for (;;) {
      Level& level = levels_[depth];
      if (level.next == 8) {
        if (depth-- == 0) return nodes;
        continue;
      }
      if (depth == max_depth) fail(at_, too_deep);
      const Cell cell = child_of(level, depth);
      if (((level.children >> level.next++) & 1U) == 0) {
        visit(CellState::unknown, cell);
      } else {
        ++depth;
        enter(cell);
      }
    }
  }

  static Cell child_of(const Level& level, std::size_t depth) {
    Cell cell{level.lo, half >> depth};
    for (unsigned axis = 0; axis < 3; ++axis)
      cell.lo[axis] += (level.next >> axis) & 1U ? cell.size : 0;
    return cell;
  }

  unsigned code() {
    const std::size_t begin = at_;
    const unsigned low = byte(), high = byte();
    if ((low | high) == 0) fail(begin, "inner node without children");
    return low | (high << 8U);
  }

  float log_odds() {
    const std::size_t begin = at_;
    std::uint32_t word = 0;
    for (unsigned i = 0; i < 4; ++i) word |= byte() << (8U * i);
    const float value = std::bit_cast<float>(word);
    if (!(std::abs(value) <= log_odds_max))
      fail(begin,
           fmt::format("log-odds {} of a node, expected a number within ±{}", value, log_odds_max));
    return value;
  }

  unsigned byte() {
    if (at_ >= bytes_.size()) fail(at_, "the file ends in the middle of the tree");
    return static_cast<unsigned char>(bytes_[at_++]);
  }

  [[noreturn]] void fail(std::size_t offset, const std::string& message) const {
    refuse_map(where_, fmt::format("byte {}", offset), message);
  }

  static constexpr const char* too_deep = "the tree is deeper than 16 levels";

  std::string_view bytes_;
  const MapHeader& header_;
  float threshold_;
  const std::string& where_;
  std::size_t at_ = 0;
  std::array<Level, max_depth + 1> levels_{};
};

// Rounded to single precision as OctoMap does.
float log_odds_of(double probability) {
  return static_cast<float>(std::log(probability / (1.0 - probability)));
}

void check_count(const StatedHeader& stated, std::size_t nodes, const std::string& where) {
  if (nodes != stated.header.node_count)
    refuse_map(where, fmt::format("header line {}", stated.size_line),
               fmt::format("size {}, but the file has {} nodes", stated.header.node_count, nodes));
}

void warn(MapData& map) {
  if (map.resolution > 0.5)
    map.warnings.push_back(
        fmt::format("resolution {} m is above 0.5 m: is the scale right?", map.resolution));
  if (map.resolution < 0.001)
    map.warnings.push_back(
        fmt::format("resolution {} m is below 0.001 m: is the scale right?", map.resolution));
  if (map.occupied.empty()) {
    map.warnings.push_back("no occupied leaf: the map has no obstacles");
  } else if (map.free_leaves == 0) {
    map.warnings.push_back("no free leaf: everything that is not occupied is unknown");
  }
  constexpr double huge_m = 10.0;
  std::size_t huge = 0;
  std::int32_t largest = 0;
  for (const Cell& cell : map.occupied) {
    huge += cell.size * map.resolution > huge_m ? 1 : 0;
    largest = std::max(largest, cell.size);
  }
  if (huge > 0)
    map.warnings.push_back(
        fmt::format("{} occupied leaves are wider than {} m, the widest {} m: kept as single boxes",
                    huge, huge_m, largest * map.resolution));
}

}  // namespace

MapHeader check_map_bytes(std::string_view bytes, const std::string& where) {
  const StatedHeader stated = read_map_header(bytes, where);
  check_count(stated, Body(bytes, stated.header, 0.0F, where).walk([](CellState, const Cell&) {}),
              where);
  return stated.header;
}

MapData map_from_bytes(std::string_view bytes, const std::string& where,
                       const ReadMapOptions& options) {
  const auto invalid = [&](const std::string& message) {
    throw Error(ErrorCode::invalid, fmt::format("{}: {}", where, message));
  };
  if (options.scale && !(*options.scale > 0.0 && std::isfinite(*options.scale)))
    invalid(fmt::format("scale {} is not allowed, expected a number above 0", *options.scale));
  if (!(options.occupancy_threshold > 0.0 && options.occupancy_threshold < 1.0))
    invalid(fmt::format("occupancy threshold {} is not allowed, expected above 0 and below 1",
                        options.occupancy_threshold));
  const StatedHeader stated = read_map_header(bytes, where);
  const MapHeader& header = stated.header;
  Body body(bytes, header, log_odds_of(options.occupancy_threshold), where);
  // The first pass checks and counts: a bad file allocates nothing, and a good one exactly what it
  // needs.
  std::array<std::size_t, 3> count{};
  check_count(stated, body.walk([&](CellState state, const Cell&) {
    ++count[static_cast<std::size_t>(state)];
  }),
              where);
  if (header.resolution > 0.5 && !options.scale)
    invalid(
        fmt::format("resolution {} is above 0.5, expected an explicit scale, metres per unit of "
                    "the file (0.001 for millimetres, 1 for "
                    "metres)",
                    header.resolution));

  MapData map;
  map.file = where;
  map.sha256 = sha256_hex(bytes);
  map.resolution = header.resolution * options.scale.value_or(1.0);
  if (!(map.resolution >= resolution_min && map.resolution <= resolution_max))
    invalid(fmt::format("resolution {} times scale {} is {} m, expected {} to {}",
                        header.resolution, options.scale.value_or(1.0), map.resolution,
                        resolution_min, resolution_max));
  map.node_count = header.node_count;
  map.free_leaves = count[static_cast<std::size_t>(CellState::free)];
  map.occupied.reserve(count[static_cast<std::size_t>(CellState::occupied)]);
  map.unknown.reserve(count[static_cast<std::size_t>(CellState::unknown)]);
  if (options.keep_free) map.free.reserve(map.free_leaves);
  body.walk([&](CellState state, const Cell& cell) {
    if (state == CellState::occupied) map.occupied.push_back(cell);
    if (state == CellState::unknown) map.unknown.push_back(cell);
    if (state == CellState::free && options.keep_free) map.free.push_back(cell);
  });
  warn(map);
  if (header.format == MapFormat::bt && options.occupancy_threshold != 0.5)
    map.warnings.push_back(fmt::format(
        "the occupancy threshold {} has no effect: a .bt distinguishes only occupied and free",
        options.occupancy_threshold));
  return map;
}

MapData read_map(const std::filesystem::path& file, const ReadMapOptions& options) {
  return map_from_bytes(read_file(file), file.string(), options);
}

}  // namespace hamelin::scene
