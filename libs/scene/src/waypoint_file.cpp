#include "waypoint_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <initializer_list>
#include <string_view>
#include <system_error>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/io/file.hpp"

namespace hamelin::scene {

namespace {

constexpr std::size_t waypoints_max = 1'000'000;
constexpr std::uintmax_t file_bytes_max = std::uintmax_t{64} << 20U;

constexpr std::array<std::string_view, 8> columns{"time_s", "x_m", "y_m", "z_m",
                                                  "qw",     "qx",  "qy",  "qz"};
constexpr std::size_t columns_without_rotation = 4;
constexpr const char* headers = "time_s,x_m,y_m,z_m or time_s,x_m,y_m,z_m,qw,qx,qy,qz";

[[noreturn]] void refuse_waypoints(ErrorCode code, const std::string& where,
                                   const std::string& what) {
  throw Error(code, fmt::format("{}: {}", where, what));
}

std::string_view trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

std::string shown(std::string_view text) {
  constexpr std::size_t shown_max = 60;
  return one_line(text.substr(0, shown_max)) + (text.size() > shown_max ? "…" : "");
}

// The next cell of a line, which is removed from it.
std::string_view take_cell(std::string_view& line) {
  const auto comma = line.find(',');
  const std::string_view cell = trimmed(line.substr(0, comma));
  line = comma == std::string_view::npos ? std::string_view() : line.substr(comma + 1);
  return cell;
}

std::size_t count_csv_cells(std::string_view line) {
  return 1 + static_cast<std::size_t>(std::count(line.begin(), line.end(), ','));
}

// Returns the number of columns.
std::size_t read_csv_header(std::string_view line, const std::string& where) {
  const std::size_t count = count_csv_cells(line);
  bool known = count == columns.size() || count == columns_without_rotation;
  std::string_view rest = line;
  for (std::size_t i = 0; known && i < count; ++i) known = take_cell(rest) == columns.at(i);
  if (!known)
    refuse_waypoints(ErrorCode::parse, where,
                     fmt::format("the header is '{}', expected {}", shown(line), headers));
  return count;
}

Waypoint read_csv_row(std::string_view line, std::size_t count, const std::string& where) {
  if (const std::size_t found = count_csv_cells(line); found != count)
    refuse_waypoints(ErrorCode::parse, where,
                     fmt::format("{} cells, expected {} as in the header", found, count));
  std::array<double, columns.size()> values{0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0};
  for (std::size_t i = 0; i < count; ++i) {
    const std::string_view cell = take_cell(line);
    const auto [end, error] = std::from_chars(cell.data(), cell.data() + cell.size(), values.at(i));
    if (error != std::errc() || end != cell.data() + cell.size() || !std::isfinite(values.at(i)))
      refuse_waypoints(
          ErrorCode::parse, where,
          fmt::format("{} is '{}', expected a finite number", columns.at(i), shown(cell)));
  }
  return {
      values[0], {values[1], values[2], values[3]}, {values[4], values[5], values[6], values[7]}};
}

std::vector<Waypoint> read_csv(std::string_view text, const std::string& file) {
  constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";
  if (text.starts_with(byte_order_mark)) text.remove_prefix(byte_order_mark.size());
  std::vector<Waypoint> out;
  std::size_t count = 0;  // of columns; 0 before the header
  for (int number = 1; !text.empty(); ++number) {
    const auto end = text.find('\n');
    const std::string_view line = trimmed(text.substr(0, end));
    text = end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
    if (line.empty() || line.front() == '#') continue;
    const auto where = [&] { return fmt::format("{}: line {}", file, number); };
    if (count == 0) {
      count = read_csv_header(line, where());
      continue;
    }
    if (out.size() == waypoints_max)
      refuse_waypoints(
          ErrorCode::invalid, where(),
          fmt::format("more way-points than {}, expected at most so many", waypoints_max));
    out.push_back(read_csv_row(line, count, where()));
    out.back().line = number;
  }
  if (count == 0)
    refuse_waypoints(ErrorCode::parse, file, fmt::format("no header, expected {}", headers));
  return out;
}

void refuse_other_keys(const Json& object, std::initializer_list<std::string_view> known,
                       const std::string& where) {
  for (const auto& [key, value] : object.items())
    if (std::find(known.begin(), known.end(), key) == known.end())
      refuse_waypoints(
          ErrorCode::invalid, where,
          fmt::format("has the key '{}', expected {}", shown(key), fmt::join(known, ", ")));
}

template <std::size_t n>
std::array<double, n> numbers(const Json& list, const std::string& where) {
  std::array<double, n> out{};
  bool valid = list.is_array() && list.size() == n;
  for (std::size_t i = 0; valid && i < n; ++i) {
    valid = list[i].is_number();
    if (valid) out.at(i) = list[i].template get<double>();
  }
  if (!valid)
    refuse_waypoints(ErrorCode::invalid, where, fmt::format("expected a list of {} numbers", n));
  return out;
}

}  // namespace

std::vector<Waypoint> waypoints_from_json(const Json& list, const std::string& where) {
  if (list.size() > waypoints_max)
    refuse_waypoints(ErrorCode::invalid, where,
                     fmt::format("{} way-points, expected at most {}", list.size(), waypoints_max));
  std::vector<Waypoint> out;
  for (std::size_t i = 0; i < list.size(); ++i) {
    const Json& in = list[i];
    const std::string place = fmt::format("{}/{}", where, i);
    if (!in.is_object())
      refuse_waypoints(ErrorCode::invalid, place, "expected an object with time_s and position_m");
    refuse_other_keys(in, {"time_s", "position_m", "quaternion_wxyz"}, place);
    Waypoint waypoint;
    if (!in.contains("time_s") || !in["time_s"].is_number())
      refuse_waypoints(ErrorCode::invalid, place + "/time_s", "expected a number");
    waypoint.time_s = in["time_s"].get<double>();
    const auto p =
        numbers<3>(in.contains("position_m") ? in["position_m"] : Json(), place + "/position_m");
    waypoint.position_m = {p[0], p[1], p[2]};
    if (in.contains("quaternion_wxyz") && !in["quaternion_wxyz"].is_null())
      waypoint.quaternion_wxyz = numbers<4>(in["quaternion_wxyz"], place + "/quaternion_wxyz");
    out.push_back(waypoint);
  }
  return out;
}

WaypointFile read_waypoint_file(const std::filesystem::path& path) {
  const std::string file = path.string();
  std::error_code unknown;
  if (const auto bytes = std::filesystem::file_size(path, unknown);
      !unknown && bytes > file_bytes_max)
    refuse_waypoints(ErrorCode::invalid, file,
                     fmt::format("{} bytes, expected at most {}", bytes, file_bytes_max));
  const std::string text = read_file(path);
  const auto first = text.find_first_not_of(" \t\r\n");
  if (first == std::string::npos || (text[first] != '[' && text[first] != '{'))
    return {read_csv(text, file), file};
  const Json document = parse_json(text, file);
  std::string where = file + ": ";
  if (document.is_array()) return {waypoints_from_json(document, where), where};
  refuse_other_keys(document, {"waypoints"}, file);
  where += "/waypoints";
  if (!document.contains("waypoints") || !document["waypoints"].is_array())
    refuse_waypoints(ErrorCode::invalid, where, "expected a list of way-points");
  return {waypoints_from_json(document["waypoints"], where), where};
}

std::vector<Waypoint> read_waypoints(const std::filesystem::path& file) {
  return read_waypoint_file(file).waypoints;
}

WaypointPath read_waypoint_path(const std::filesystem::path& file,
                                const WaypointPath::Options& options) {
  WaypointFile read = read_waypoint_file(file);
  return {std::move(read.waypoints), options, read.where, file};
}

}  // namespace hamelin::scene
