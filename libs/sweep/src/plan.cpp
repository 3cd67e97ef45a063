#include "hamelin/sweep/plan.hpp"

#include <fmt/format.h>

#include <set>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "hamelin/scene/overrides.hpp"
#include "hamelin/sweep/records.hpp"

namespace hamelin::sweep {

namespace fs = std::filesystem;

fs::path plan_file(const fs::path& directory) {
  return directory / "plan.json";
}

Json to_json(const Plan& plan) {
  Json document{{"schema", "hamelin.sweep/1"},
                {"scenes", Json::array()},
                {"inputs", Json::array()},
                {"plugins", Json::array()},
                {"runs", Json::array()}};
  for (const auto& scene : plan.scenes)
    document["scenes"].push_back(
        {{"file", scene.file},
         {"sha256", scene.sha256},
         {"feasible", scene.feasible},
         {"reason", scene.reason.empty() ? Json(nullptr) : Json(scene.reason)}});
  for (const auto& [file, sha256] : plan.inputs)
    document["inputs"].push_back({{"file", file}, {"sha256", sha256}});
  for (const auto& [name, sha256] : plan.plugins)
    document["plugins"].push_back({{"name", name}, {"sha256", sha256}});
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
  // Plans without ablations have the same bytes as those of earlier versions.
  for (const auto& a : plan.ablations)
    document["ablations"].push_back({{"planner", a.planner},
                                     {"without", a.without},
                                     {"parameter", a.parameter},
                                     {"value", a.value}});
  return document;
}

void write_plan(Plan& plan, const fs::path& directory) {
  const std::string text = to_json(plan).dump(1) + "\n";
  const fs::path file = plan_file(directory);
  std::error_code ec;
  for (const auto& records : record_files(directory))
    if (fs::file_size(records, ec) > 0 && (!fs::exists(file, ec) || read_file(file) != text))
      throw Error(
          ErrorCode::usage,
          fmt::format("{}: holds records of another plan, expected a directory without records",
                      records.string()));
  write_file_atomically(file, text);
  plan.sha256 = sha256_hex(text);
}

Plan read_plan(const fs::path& directory) {
  std::error_code ec;
  if (!fs::is_directory(directory, ec))
    throw Error(ErrorCode::io,
                fmt::format("{}: is not a directory, expected a directory with plan.json",
                            directory.string()));
  return read_plan_file(plan_file(directory));
}

Plan read_plan_file(const fs::path& file) {
  const std::string text = read_file(file), where = file.string();
  const Json document = parse_json(text, where);
  check_shipped_schema(document, "sweep", where);
  Plan plan;
  plan.sha256 = sha256_hex(text);
  std::set<std::string> scenes, ids;
  const auto text_of = [](const Json& value) {
    return value.is_null() ? std::string() : value.get<std::string>();
  };
  for (const Json& scene : document["scenes"]) {
    plan.scenes.push_back({scene["file"], scene["sha256"], scene["feasible"].get<bool>(),
                           text_of(scene.value("reason", Json()))});
    scenes.insert(plan.scenes.back().file);
  }
  // plans of earlier versions do not have these two lists
  for (const Json& input : document.value("inputs", Json::array()))
    plan.inputs.push_back({input["file"], input["sha256"]});
  for (const Json& plugin : document.value("plugins", Json::array()))
    plan.plugins.push_back({plugin["name"], plugin["sha256"]});
  for (std::size_t i = 0; i < document["runs"].size(); ++i) {
    const Json& from = document["runs"][i];
    PlannedRun run;
    run.id = from["id"];
    run.scene = from["scene"];
    if (!scenes.contains(run.scene))
      throw Error(
          ErrorCode::invalid,
          fmt::format("{}: /runs/{}/scene: '{}' is not among the scenes, expected one of them",
                      where, i, run.scene));
    if (!ids.insert(run.id).second)
      throw Error(
          ErrorCode::invalid,
          fmt::format("{}: /runs/{}/id: '{}' occurs twice, expected unique ids", where, i, run.id));
    if (!from["planner"].is_null()) run.planner = from["planner"].get<std::string>();
    run.set = from["set"].get<std::vector<std::string>>();
    run.seed = from["seed"].get<std::uint64_t>();
    for (const auto& [name, value] : from["labels"].items())
      run.labels[name] = value.get<std::string>();
    if (from.contains("gains") && from["gains"].is_object())
      for (const auto& [name, value] : from["gains"].items()) run.gains[name] = value.get<double>();
    plan.runs.push_back(std::move(run));
  }
  for (const Json& from : document.value("ablations", Json::array()))
    plan.ablations.push_back({from["planner"], from["without"], from["parameter"], from["value"]});
  return plan;
}

namespace {

// The planner as a run in any working directory is given it.
std::optional<std::string> planner_from(const PlannedRun& run, const fs::path& directory) {
  if (!run.planner) return {};
  auto python = scene::python_planner(*run.planner, run.id);
  if (!python) return run.planner;
  python->file = resolve_path(directory, python->file).string();
  return python->text();
}

}  // namespace

scene::Scene read_scene(const PlannedRun& run, const fs::path& directory) {
  const fs::path file = resolve_path(directory, run.scene);
  Json document = read_json(file);
  scene::Overrides overrides;
  overrides.planner = planner_from(run, directory);
  overrides.seed = run.seed;
  overrides.set = run.set;
  scene::apply(overrides, "--planner", document);
  return scene::scene_from_json(document, file.parent_path(), file.string());
}

namespace {

void compare_hashes(const fs::path& file, const std::string& now, const std::string& planned) {
  if (now != planned)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: has changed since the sweep was planned: SHA-256 {}, expected {}; "
                            "plan it again, in a new directory if there are records",
                            file.string(), now, planned));
}

// Needs no memory for the file.
void check_hash(const fs::path& file, const std::string& planned) {
  compare_hashes(file, sha256_of_file(file), planned);
}

}  // namespace

std::string read_planned_file(const fs::path& file, const std::string& sha256) {
  std::string content = read_file(file);
  compare_hashes(file, sha256_hex(content), sha256);
  return content;
}

void check_files(const Plan& plan, const fs::path& directory,
                 const std::vector<const PlannedRun*>& runs) {
  std::set<std::string_view> scenes;
  for (const PlannedRun* run : runs) scenes.insert(run->scene);
  for (const auto& scene : plan.scenes)
    if (scenes.contains(scene.file)) check_hash(resolve_path(directory, scene.file), scene.sha256);
  for (const auto& input : plan.inputs)
    check_hash(resolve_path(directory, input.file), input.sha256);
}

void check_planners(const Plan& plan, const std::vector<fs::path>& plugin_directories) {
  for (const auto& plugin : plan.plugins)
    check_hash(planning::find_plugin_file(plugin.name, plugin_directories), plugin.sha256);
}

std::vector<std::string> run_arguments(const PlannedRun& run, const fs::path& directory) {
  std::vector<std::string> arguments{resolve_path(directory, run.scene).string()};
  const auto add = [&](const char* option, const std::string& value) {
    arguments.emplace_back(option);
    arguments.push_back(value);
  };
  if (const auto planner = planner_from(run, directory)) add("--planner", *planner);
  for (const auto& assignment : run.set) add("--set", assignment);
  add("--seed", fmt::format("{}", run.seed));
  return arguments;
}

std::vector<std::pair<std::string, std::string>> varied_values(const PlannedRun& run) {
  std::vector<std::pair<std::string, std::string>> values;
  const auto label = run.labels.find("values");
  if (label == run.labels.end()) return values;
  // The varied values are the last of `set`, joined by blanks in the label.
  std::string joined;
  for (auto at = run.set.rbegin(); at != run.set.rend() && joined != label->second; ++at) {
    joined = joined.empty() ? *at : fmt::format("{} {}", *at, joined);
    const auto equal = at->find('=');
    values.insert(values.begin(),
                  {at->substr(0, equal), equal == std::string::npos ? "" : at->substr(equal + 1)});
  }
  if (joined != label->second) values.clear();
  return values;
}

}  // namespace hamelin::sweep
