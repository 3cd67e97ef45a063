#include <fmt/format.h>

#include <map>

#include "hamelin/core/error.hpp"
#include "hamelin/core/file.hpp"
#include "hamelin/log/run_log.hpp"

namespace hamelin::log {

namespace {

std::string place(const std::filesystem::path& file, std::size_t index) {
  return fmt::format("{}: line {}", file.string(), index + 1);
}

// The schema of one kind of line, with what it refers to.
Json line_schema(const std::string& type) {
  if (type == "result") {
    Json schema = Json::parse(schema_text("result"));
    schema["properties"]["type"] = {{"description", "kind of line"}, {"const", "result"}};
    return schema;
  }
  const Json run = Json::parse(schema_text("run"));
  Json schema = run["definitions"][type];
  schema["definitions"] = run["definitions"];
  return schema;
}

Json array_of(const Json& schema) {
  Json outer = {{"type", "array"}, {"items", schema}};
  if (schema.contains("definitions")) outer["definitions"] = schema["definitions"];
  return outer;
}

}  // namespace

LogLines read_log(const std::filesystem::path& file) {
  const std::string text = read_file(file);
  LogLines log;
  for (std::size_t begin = 0; begin < text.size();) {
    const auto end = text.find('\n', begin);
    if (end == std::string::npos) {
      log.cut = true;
      break;
    }
    const std::string where = place(file, log.lines.size());
    log.lines.push_back(parse_json(std::string_view(text).substr(begin, end - begin), where));
    if (!log.lines.back().is_object())
      throw Error(ErrorCode::parse, fmt::format("{}: no JSON object, expected one a line", where));
    begin = end + 1;
  }
  return log;
}

LogSummary check_log(const std::filesystem::path& file) {
  const LogLines log = read_log(file);
  LogSummary summary;
  summary.cut = log.cut;
  if (log.lines.empty())
    throw Error(ErrorCode::invalid, fmt::format("{}: has no whole line, expected a header", file.string()));
  std::map<std::string, std::vector<std::size_t>> by_type;
  double k_before = -1.0;
  for (std::size_t i = 0; i < log.lines.size(); ++i) {
    const Json& line = log.lines[i];
    const Json type = line.value("type", Json(nullptr));
    const bool header = type == "header", tick = type == "tick", event = type == "event", result = type == "result";
    if (!header && !tick && !event && !result)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: type {}, expected header, tick, event or result", place(file, i), type.dump()));
    if (header != (i == 0))
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: type {}, expected the header first, and only there", place(file, i), type.dump()));
    if (summary.has_result)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: stands behind the result, expected nothing there", place(file, i)));
    by_type[type.get<std::string>()].push_back(i);
    summary.ticks += tick ? 1 : 0;
    summary.events += event ? 1 : 0;
    summary.has_result = result;
    if (tick && line.contains("k") && line["k"].is_number()) {
      const double k = line["k"].get<double>();
      if (k <= k_before)
        throw Error(ErrorCode::invalid,
                    fmt::format("{}: /k: {} after {}, expected rising steps", place(file, i), k, k_before));
      k_before = k;
    }
  }
  for (const auto& [type, indices] : by_type) {
    const Json schema = line_schema(type);
    Json all = Json::array();
    for (const auto i : indices) all.push_back(log.lines[i]);
    // All at once is fast; one by one, only where something is wrong, names the line.
    try {
      check_schema(all, array_of(schema), file.string());
    } catch (const Error&) {
      for (const auto i : indices) check_schema(log.lines[i], schema, place(file, i));
      throw;
    }
  }
  return summary;
}

}  // namespace hamelin::log
