#include "hamelin/study/sweep.hpp"

#include <fmt/format.h>

#include <set>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"

namespace hamelin::study {

namespace fs = std::filesystem;

fs::path plan_file(const fs::path& directory) {
  return directory / "plan.json";
}

fs::path records_file(const fs::path& directory) {
  return directory / "records.jsonl";
}

Json to_json(const SweepPlan& plan) {
  Json document{{"schema", "hamelin.sweep/1"}, {"scenes", Json::array()}, {"runs", Json::array()}};
  for (const auto& scene : plan.scenes)
    document["scenes"].push_back({{"file", scene.file},
                                  {"sha256", scene.sha256},
                                  {"feasible", scene.feasible},
                                  {"reason", scene.reason.empty() ? Json(nullptr) : Json(scene.reason)}});
  for (const auto& run : plan.runs) {
    Json labels = Json::object(), gains = Json::object();
    for (const auto& [name, value] : run.labels) labels[name] = value;
    for (const auto& [name, value] : run.gains) gains[name] = value;
    document["runs"].push_back({{"id", run.id},
                                {"scene", run.scene},
                                {"planner", run.planner ? Json(*run.planner) : Json(nullptr)},
                                {"set", run.set},
                                {"seed", run.seed},
                                {"labels", std::move(labels)},
                                {"gains", run.gains.empty() ? Json(nullptr) : std::move(gains)}});
  }
  return document;
}

void write_plan(SweepPlan& plan, const fs::path& directory) {
  const std::string text = to_json(plan).dump(1) + "\n";
  const fs::path file = plan_file(directory), records = records_file(directory);
  std::error_code ec;
  if (fs::exists(records, ec) && fs::file_size(records, ec) > 0 && (!fs::exists(file, ec) || read_file(file) != text))
    throw Error(ErrorCode::usage,
                fmt::format("{}: holds records of another plan, expected a directory without any", records.string()));
  write_file_aside(file, text);
  plan.sha256 = sha256_hex(text);
}

namespace {

// Whether a line has what the code that sums up relies on; `hamelin validate` holds it against the whole schema.
bool is_record(const Json& line) {
  const auto has = [&](const char* key) { return line.contains(key); };
  const auto text = [&](const char* key) { return has(key) && line[key].is_string(); };
  const auto object_or_null = [&](const char* key) {
    return has(key) && (line[key].is_object() || line[key].is_null());
  };
  return line.is_object() && line.value("schema", Json()) == "hamelin.record/1" && text("plan") && text("id") &&
         text("outcome") && has("cause") && object_or_null("result") && object_or_null("judge") &&
         (line["judge"].is_null() || (line["judge"].contains("obstacles") && line["judge"].contains("self")));
}

}  // namespace

SweepPlan read_plan(const fs::path& directory) {
  std::error_code ec;
  if (!fs::is_directory(directory, ec))
    throw Error(ErrorCode::io,
                fmt::format("{}: is no directory, expected one that holds plan.json", directory.string()));
  return read_plan_file(plan_file(directory));
}

SweepPlan read_plan_file(const fs::path& file) {
  const std::string text = read_file(file), where = file.string();
  const Json document = parse_json(text, where);
  check_shipped_schema(document, "sweep", where);
  SweepPlan plan;
  plan.sha256 = sha256_hex(text);
  std::set<std::string> scenes, ids;
  const auto text_of = [](const Json& value) { return value.is_null() ? std::string() : value.get<std::string>(); };
  for (const Json& scene : document["scenes"]) {
    plan.scenes.push_back(
        {scene["file"], scene["sha256"], scene["feasible"].get<bool>(), text_of(scene.value("reason", Json()))});
    scenes.insert(plan.scenes.back().file);
  }
  for (std::size_t i = 0; i < document["runs"].size(); ++i) {
    const Json& from = document["runs"][i];
    SweepRun run;
    run.id = from["id"];
    run.scene = from["scene"];
    if (!scenes.contains(run.scene))
      throw Error(
          ErrorCode::invalid,
          fmt::format("{}: /runs/{}/scene: '{}' is not among the scenes, expected one of them", where, i, run.scene));
    if (!ids.insert(run.id).second)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: /runs/{}/id: '{}' is there twice, expected one run of each id", where, i, run.id));
    if (!from["planner"].is_null()) run.planner = from["planner"].get<std::string>();
    run.set = from["set"].get<std::vector<std::string>>();
    run.seed = from["seed"].get<std::uint64_t>();
    for (const auto& [name, value] : from["labels"].items()) run.labels[name] = value.get<std::string>();
    if (from.contains("gains") && from["gains"].is_object())
      for (const auto& [name, value] : from["gains"].items()) run.gains[name] = value.get<double>();
    plan.runs.push_back(std::move(run));
  }
  return plan;
}

Records read_records(const fs::path& directory, const SweepPlan& plan) {
  const fs::path file = records_file(directory);
  Records records;
  std::error_code ec;
  if (!fs::exists(file, ec)) return records;
  const std::string text = read_file(file);
  std::set<std::string> planned, seen;
  for (const auto& run : plan.runs) planned.insert(run.id);
  while (records.good_bytes < text.size()) {
    const auto end = text.find('\n', records.good_bytes);
    if (end == std::string::npos) break;
    const std::string where = fmt::format("{}: line {}", file.string(), records.lines.size() + 1);
    Json record = parse_json(text.substr(records.good_bytes, end - records.good_bytes), where);
    if (!is_record(record))
      throw Error(ErrorCode::invalid, fmt::format("{}: is no record, expected hamelin.record/1", where));
    if (record["plan"] != plan.sha256)
      throw Error(ErrorCode::invalid, fmt::format("{}: is of another plan, expected records of {} as it is now", where,
                                                  plan_file(directory).string()));
    const std::string id = record["id"];
    if (!planned.contains(id) || !seen.insert(id).second)
      throw Error(ErrorCode::invalid, fmt::format("{}: run '{}' is {}", where, id,
                                                  planned.contains(id) ? "recorded twice, expected once"
                                                                       : "not in the plan, expected one that is"));
    records.lines.push_back(std::move(record));
    records.good_bytes = end + 1;
  }
  records.cut = records.good_bytes < text.size();
  return records;
}

std::vector<std::string> run_arguments(const SweepRun& run, const fs::path& directory) {
  std::vector<std::string> arguments{(directory / run.scene).lexically_normal().string()};
  const auto add = [&](const char* option, const std::string& value) {
    arguments.emplace_back(option);
    arguments.push_back(value);
  };
  if (run.planner) add("--planner", *run.planner);
  for (const auto& assignment : run.set) add("--set", assignment);
  add("--seed", fmt::format("{}", run.seed));
  return arguments;
}

}  // namespace hamelin::study
