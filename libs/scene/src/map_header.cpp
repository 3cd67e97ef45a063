#include "map_header.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cstdint>
#include <cstring>
#include <filesystem>

#include "hamelin/core/error.hpp"

namespace hamelin::scene {

namespace {

constexpr std::string_view first_line_bt = "# Octomap OcTree binary file";
constexpr std::string_view first_line_ot = "# Octomap OcTree file";

// A short, printable form of arbitrary bytes.
std::string printable(std::string_view text) {
  std::string out;
  for (const char c : text.substr(0, 40)) out += (c >= ' ' && c < '\x7f') ? c : '?';
  return text.size() > 40 ? out + "..." : out;
}

// Files of the time before OctoMap had headers begin with the tree's type, 3, as four bytes, then
// the resolution as a double.
[[noreturn]] void refuse_legacy(std::string_view bytes, const std::string& where) {
  constexpr std::size_t header_size = 4 + 8 + 4;
  double resolution = 0.0;
  std::uint32_t nodes = 0;
  if (bytes.size() <= header_size)
    refuse_map(where, "byte 0",
               "a truncated legacy file without header lines, expected an OctoMap");
  std::memcpy(&resolution, bytes.data() + 4, sizeof resolution);
  std::memcpy(&nodes, bytes.data() + 12, sizeof nodes);
  if (!(resolution >= resolution_min && resolution <= resolution_max))
    refuse_map(
        where, "byte 4",
        fmt::format("a legacy file without header lines, of resolution {}, expected an OctoMap",
                    resolution));
  refuse_map(
      where, "byte 0",
      fmt::format("a legacy file without header lines (resolution {}, {} nodes), expected '{}' "
                  "or '{}': convert it "
                  "with OctoMap's convert_octree",
                  resolution, nodes, first_line_bt, first_line_ot));
}

MapFormat format_of(std::string_view bytes, const std::string& where) {
  const auto starts = [&](std::string_view head) { return bytes.substr(0, head.size()) == head; };
  if (bytes.empty()) refuse_map(where, "byte 0", "the file is empty, expected an OctoMap");
  if (starts("\x1f\x8b"))
    refuse_map(where, "byte 0", "gzip-compressed, expected an OctoMap: gunzip it first");
  if (starts("version https://git-lfs"))
    refuse_map(where, "byte 0", "a Git LFS pointer, expected an OctoMap: run 'git lfs pull' first");
  if (starts(std::string_view("\3\0\0\0", 4))) refuse_legacy(bytes, where);
  const std::string_view line = bytes.substr(0, bytes.find('\n'));
  if (starts(first_line_bt) || starts(first_line_ot)) {
    if (line.back() == '\r')
      refuse_map(where, "header line 1",
                 "ends in CR LF, expected LF: the file was transferred as text");
    if (line == first_line_bt) return MapFormat::bt;
    if (line == first_line_ot) return MapFormat::ot;
  }
  refuse_map(
      where, "header line 1",
      fmt::format("is '{}', expected '{}' or '{}'", printable(line), first_line_bt, first_line_ot));
}

template <typename T>
bool parse_number(std::string_view text, T& value) {
  const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
  return result.ec == std::errc{} && result.ptr == text.data() + text.size();
}

// Reads the lines between the first one and the line 'data'.
class HeaderReader {
 public:
  HeaderReader(std::string_view bytes, const std::string& where) : bytes_(bytes), where_(where) {}

  StatedHeader read() {
    MapHeader& header = stated_.header;
    header.format = format_of(bytes_, where_);
    check_ending();
    at_ = bytes_.find('\n') + 1;
    for (number_ = 2;; ++number_) {
      const std::string_view line = next_line();
      if (line == "data") break;
      if (line.empty() || line.front() == '#') continue;
      if (line.back() == '\r') fail("ends in CR LF, expected LF: the file was transferred as text");
      take(line);
    }
    const char* missing = !has_id_           ? "id"
                          : !has_size_       ? "size"
                          : !has_resolution_ ? "res"
                                             : nullptr;
    if (missing != nullptr)
      refuse_map(where_, "header", fmt::format("the line '{}' is missing", missing));
    header.data_offset = at_;
    return stated_;
  }

 private:
  void check_ending() const {
    const MapFormat format = stated_.header.format;
    const auto ending = std::filesystem::path(where_).extension();
    if ((ending == ".bt" && format == MapFormat::ot) ||
        (ending == ".ot" && format == MapFormat::bt))
      refuse_map(where_, "header line 1",
                 fmt::format("belongs to the other format, expected '{}' in a {} file",
                             ending == ".bt" ? first_line_bt : first_line_ot, ending.string()));
  }

  std::string_view next_line() {
    const std::size_t end =
        at_ == 0 || at_ >= bytes_.size() ? std::string_view::npos : bytes_.find('\n', at_);
    if (end == std::string_view::npos) fail("the file ends before the line 'data'");
    const std::string_view line = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    return line;
  }

  void take(std::string_view line) {
    const std::size_t space = line.find(' ');
    const std::string_view key = line.substr(0, space);
    const std::string_view value =
        space == std::string_view::npos ? std::string_view{} : line.substr(space + 1);
    const auto once = [&](bool& seen) {
      if (seen) fail(fmt::format("'{}' is given twice", key));
      seen = true;
    };
    if (key == "id") {
      once(has_id_);
      take_id(value);
    } else if (key == "size") {
      once(has_size_);
      take_size(value);
    } else if (key == "res") {
      once(has_resolution_);
      take_resolution(value);
    } else {
      fail(fmt::format("'{}' is not known, expected id, size, res or data", printable(line)));
    }
  }

  void take_id(std::string_view value) {
    stated_.header.colored = value == "ColorOcTree";
    if (value != "OcTree" && !stated_.header.colored)
      fail(fmt::format("tree type '{}' is not known, expected OcTree or ColorOcTree",
                       printable(value)));
  }

  void take_size(std::string_view value) {
    stated_.size_line = number_;
    if (!parse_number(value, stated_.header.node_count))
      fail(fmt::format("size '{}' is not a node count, expected an integer", printable(value)));
    if (stated_.header.node_count == 0) fail("size 0: the map has no nodes, expected at least one");
  }

  void take_resolution(std::string_view value) {
    double& resolution = stated_.header.resolution;
    if (!parse_number(value, resolution))
      fail(fmt::format("res '{}' is not a number", printable(value)));
    if (!(resolution >= resolution_min && resolution <= resolution_max))
      fail(fmt::format("res '{}' is out of range, expected {} to {}", printable(value),
                       resolution_min, resolution_max));
  }

  [[noreturn]] void fail(const std::string& message) const {
    refuse_map(where_, fmt::format("header line {}", number_), message);
  }

  std::string_view bytes_;
  const std::string& where_;
  StatedHeader stated_;
  std::size_t at_ = 0;
  int number_ = 2;
  bool has_id_ = false, has_size_ = false, has_resolution_ = false;
};

}  // namespace

StatedHeader read_map_header(std::string_view bytes, const std::string& where) {
  return HeaderReader(bytes, where).read();
}

void refuse_map(const std::string& where, const std::string& place, const std::string& message) {
  throw Error(ErrorCode::parse, fmt::format("{}: {}: {}", where, place, message));
}

}  // namespace hamelin::scene
