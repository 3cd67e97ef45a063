#include "document.hpp"

#include <fmt/format.h>

#include <fstream>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "terminal.hpp"

namespace hamelin::app {

std::string_view to_string(Kind kind) noexcept {
  switch (kind) {
    case Kind::map:
      return "map";
    case Kind::urdf:
    case Kind::robot:
      return "robot";
    case Kind::scene:
      return "scene";
    case Kind::task:
      return "task";
    case Kind::result:
      return "result";
    case Kind::explanation:
      return "explanation";
    case Kind::path:
      return "path";
    case Kind::trajectory:
      return "trajectory";
    case Kind::primitives:
      return "primitives";
    case Kind::spheres:
      return "file of collision spheres";
    case Kind::waypoints:
      return "file of way-points";
    case Kind::log:
      return "log";
    case Kind::sweep:
      return "sweep plan";
    case Kind::records:
      return "file of sweep records";
    case Kind::summary:
      return "sweep summary";
    case Kind::comparison:
      return "sweep comparison";
    case Kind::accuracy:
      return "measurement of accuracy";
    case Kind::problems:
      return "problem set";
    case Kind::benchmark:
      return "file of benchmark results";
    case Kind::archive:
      return "description of a sweep archive";
  }
  return "unknown";
}

namespace {

// A sweep's records and a run's log are both JSON Lines.
bool holds_records(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string line;
  std::getline(in, line);
  const Json first = try_parse_json(line);
  return first.is_object() && first.value("schema", Json()) == "hamelin.record/1";
}

Kind recognise(const std::filesystem::path& file) {
  const auto extension = file.extension();
  if (extension == ".bt" || extension == ".ot") return Kind::map;
  if (extension == ".jsonl" && holds_records(file)) return Kind::records;
  if (extension == ".jsonl" || extension == ".zst") return Kind::log;
  if (extension == ".urdf") return Kind::urdf;
  if (extension == ".csv") return Kind::waypoints;
  const std::string text = read_file(file);
  if (text.starts_with("# Octomap")) return Kind::map;
  const auto first = text.find_first_not_of(" \t\r\n");
  if (first == std::string::npos)
    throw Error(ErrorCode::parse, fmt::format("{}: is empty", file.string()));
  if (text[first] == '<') return Kind::urdf;
  if (text[first] == '[') return Kind::waypoints;
  if (text[first] != '{')
    throw Error(ErrorCode::parse,
                fmt::format("{}: is not a map, XML or a JSON object", file.string()));
  // A log is the only format with one JSON object per line.
  const std::string line = text.substr(0, text.find('\n'));
  if (const Json head = try_parse_json(line);
      head.is_object() && head.value("type", Json()) == "header")
    return Kind::log;
  const Json document = parse_json(text, file.string());
  const Json schema = document.value("schema", Json(nullptr));
  if (schema == "hamelin.robot/1") return Kind::robot;
  if (schema == "hamelin.scene/1") return Kind::scene;
  if (schema == "hamelin.task/1") return Kind::task;
  if (schema == "hamelin.result/1") return Kind::result;
  if (schema == "hamelin.explanation/1") return Kind::explanation;
  if (schema == "hamelin.path/1") return Kind::path;
  if (schema == "hamelin.trajectory/1") return Kind::trajectory;
  if (schema == "hamelin.primitives/1") return Kind::primitives;
  if (schema == "hamelin.sweep/1") return Kind::sweep;
  if (schema == "hamelin.summary/1") return Kind::summary;
  if (schema == "hamelin.comparison/1") return Kind::comparison;
  if (schema == "hamelin.accuracy/1") return Kind::accuracy;
  if (schema == "hamelin.problems/1") return Kind::problems;
  if (schema == "hamelin.benchmark/1") return Kind::benchmark;
  if (schema == "hamelin.archive/1") return Kind::archive;
  if (schema.is_null() && document.contains("links") && document["links"].is_object())
    return Kind::spheres;
  if (schema.is_null() && document.contains("waypoints")) return Kind::waypoints;
  throw Error(
      ErrorCode::invalid,
      fmt::format(
          "{}: /schema: is {}, expected hamelin.robot/1, hamelin.scene/1, hamelin.task/1, "
          "hamelin.result/1, "
          "hamelin.explanation/1, hamelin.path/1, hamelin.trajectory/1, hamelin.primitives/1, "
          "hamelin.sweep/1, hamelin.summary/1, hamelin.comparison/1, hamelin.accuracy/1, "
          "hamelin.problems/1, hamelin.benchmark/1 or hamelin.archive/1",
          file.string(), schema.is_null() ? "missing" : schema.dump()));
}

}  // namespace

Kind kind_of(const std::filesystem::path& file) {
  const Kind kind = recognise(file);
  detail(fmt::format("reading {}: a {}", file.string(), to_string(kind)));
  return kind;
}

}  // namespace hamelin::app
