#include "hamelin/scene/map_crop.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "bt_writer.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"

namespace hamelin::scene {

namespace {

// The Morton code of a cell: the bits of its coordinates, interleaved. It sorts cells in the order
// of the file.
std::uint64_t morton_code(const Cell& cell) {
  std::uint64_t code = 0;
  for (unsigned axis = 0; axis < 3; ++axis)
    for (unsigned bit = 0; bit < 16; ++bit)
      code |= ((static_cast<std::uint64_t>(cell.lo[axis] + BtWriter::half) >> bit) & 1U)
              << (3U * bit + axis);
  return code;
}

struct Leaf {
  std::uint64_t code = 0;
  std::int32_t size = 1;
  BtNode node = BtNode::unknown;
};

void append_leaves(const std::vector<Cell>& cells, BtNode node, const CropOptions& options,
                   double resolution, std::vector<Leaf>& leaves) {
  const auto keep = [&](const Cell& cell) {
    const Box box = to_metres(cell, resolution);
    if (const auto* ball = std::get_if<Ball>(&options.region))
      return (box.lo - ball->center).cwiseMax(ball->center - box.hi).cwiseMax(0.0).norm() <=
             ball->radius;
    const Box& region = std::get<Box>(options.region);
    return (box.lo.array() <= region.hi.array()).all() &&
           (region.lo.array() <= box.hi.array()).all();
  };
  for (const Cell& cell : cells)
    if (keep(cell)) leaves.push_back({morton_code(cell), cell.size, node});
}

void check_region(const CropOptions& options) {
  const auto invalid = [](const std::string& message) { throw Error(ErrorCode::invalid, message); };
  if (const auto* ball = std::get_if<Ball>(&options.region)) {
    if (!(ball->center.allFinite() && ball->radius > 0.0 && std::isfinite(ball->radius)))
      invalid(fmt::format("crop: radius {} m, expected a number above 0 and a finite centre",
                          ball->radius));
  } else {
    const Box& box = std::get<Box>(options.region);
    if (!(box.lo.allFinite() && box.hi.allFinite() && (box.lo.array() < box.hi.array()).all()))
      invalid(
          "crop: the first corner of the box is not below the second, expected it to be on each "
          "axis");
  }
}

void check_output(const CropOptions& options) {
  std::error_code ignored;
  if (std::filesystem::equivalent(options.map, options.output, ignored))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: is the map itself, expected another file to write",
                            options.output.string()));
  if (options.output.extension() != ".bt")
    throw Error(ErrorCode::invalid,
                fmt::format("{}: expected a name that ends in .bt, the format written",
                            options.output.string()));
}

// @param leaves in the order of the file
BtWriter writer_of(const std::vector<Leaf>& leaves) {
  struct Range {
    std::size_t begin = 0, end = 0;
  };
  return BtWriter(Range{0, leaves.size()}, [&](const Cell& cell, const Range& above, Range& here) {
    const auto edge = static_cast<std::uint64_t>(cell.size);
    const std::uint64_t first = morton_code(cell), last = first + edge * edge * edge;
    const auto at = [&](std::uint64_t code, std::size_t from) {
      const auto begin = leaves.begin();
      const auto found = std::lower_bound(
          begin + static_cast<std::ptrdiff_t>(from), begin + static_cast<std::ptrdiff_t>(above.end),
          code, [](const Leaf& leaf, std::uint64_t c) { return leaf.code < c; });
      return static_cast<std::size_t>(found - begin);
    };
    here.begin = at(first, above.begin);
    here.end = at(last, here.begin);
    if (here.begin == here.end) return BtNode::unknown;
    return leaves[here.begin].size == cell.size ? leaves[here.begin].node : BtNode::parts;
  });
}

}  // namespace

CropReport crop_map(const CropOptions& options) {
  check_region(options);
  check_output(options);
  const std::string bytes = read_file(options.map);
  ReadMapOptions read = options.read;
  read.keep_free = true;
  const MapData map = map_from_bytes(bytes, options.map.string(), read);
  std::vector<Leaf> leaves;
  append_leaves(map.occupied, BtNode::occupied, options, map.resolution, leaves);
  CropReport report;
  report.occupied_leaves = leaves.size();
  append_leaves(map.free, BtNode::free, options, map.resolution, leaves);
  if (options.unknown_is_free)
    append_leaves(map.unknown, BtNode::free, options, map.resolution, leaves);
  report.free_leaves = leaves.size() - report.occupied_leaves;
  if (leaves.empty())
    throw Error(ErrorCode::invalid, fmt::format("{}: nothing of the map is in the region, expected "
                                                "a region in the map's own frame, in metres",
                                                options.map.string()));
  std::sort(leaves.begin(), leaves.end(),
            [](const Leaf& a, const Leaf& b) { return a.code < b.code; });
  const BtWriter writer = writer_of(leaves);
  const std::string out = writer.file(map.resolution, "cropped by hamelin");
  write_file_atomically(options.output, out);
  report.sha256 = sha256_hex(out);
  report.bytes_before = bytes.size();
  report.bytes = out.size();
  report.nodes_before = map.node_count;
  report.nodes = writer.nodes();
  report.occupied_leaves_before = map.occupied.size();
  report.free_leaves_before = map.free_leaves;
  report.resolution_m = map.resolution;
  report.warnings = map.warnings;
  return report;
}

}  // namespace hamelin::scene
