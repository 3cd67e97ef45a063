#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/scene/scene.hpp"

/// A sweep is a directory: `plan.json` (hamelin.sweep/1), what the plan made (`scenes/`), and `records.jsonl`
/// (hamelin.record/1), one line a run in the order in which they ended.
namespace hamelin::sweep {

/// The "problem" label of runs of gain sets without the obstacle.
inline constexpr const char* no_obstacle = "no obstacle";

/// A file that some run reads besides its scene: robot, spheres, SRDF, map, change of a map.
struct PlannedInput {
  std::string file;    ///< as seen from the plan's directory
  std::string sha256;  ///< of its bytes
};

/// A planner of some run.
struct PlannedPlugin {
  std::string name;    ///< or path, as the runs name it
  std::string sha256;  ///< of its shared object
};

/// A scene of a plan.
struct PlannedScene {
  std::string file;    ///< as seen from the plan's directory
  std::string sha256;  ///< of its bytes
  bool feasible = true;
  std::string reason;  ///< why not; see feasibility()
};

/// One run of a plan: a scene with another planner, values set, and a seed.
struct PlannedRun {
  std::string id;     ///< unique in the plan
  std::string scene;  ///< PlannedScene::file
  std::optional<std::string> planner;
  std::vector<std::string> set;  ///< "/json/pointer=VALUE", applied in this order after the planner
  std::uint64_t seed = 1;
  std::map<std::string, std::string> labels;  ///< by which runs are grouped: family, problem, goal, planner, …
  std::map<std::string, double> gains;        ///< of a gain set; empty else
};

struct Plan {
  std::vector<PlannedScene> scenes;
  std::vector<PlannedInput> inputs;    ///< each once
  std::vector<PlannedPlugin> plugins;  ///< each once
  std::vector<PlannedRun> runs;
  std::string sha256;  ///< of the plan's file; empty before it is written
};

/// The document that is written; the same plan gives the same bytes.
[[nodiscard]] Json to_json(const Plan& plan);
/// Writes `directory`/plan.json. @throws Error io; usage where the directory holds records of another plan
void write_plan(Plan& plan, const std::filesystem::path& directory);
/// `directory`/plan.json. @throws Error io, parse or invalid: "file: place: what is wrong, what was expected"
[[nodiscard]] Plan read_plan(const std::filesystem::path& directory);
/// The same for a file of any name.
[[nodiscard]] Plan read_plan_file(const std::filesystem::path& file);

[[nodiscard]] std::filesystem::path plan_file(const std::filesystem::path& directory);
[[nodiscard]] std::filesystem::path records_file(const std::filesystem::path& directory);

/// The scene of a run with its planner, values and seed set.
/// @throws Error io, parse, invalid or usage as scene::read_scene and scene::set_pointer
[[nodiscard]] scene::Scene read_scene(const PlannedRun& run, const std::filesystem::path& directory);

/// Checks that scenes, inputs and planners are what was planned.
/// @param plugin_directories where the runs will look for planners
/// @throws Error invalid naming the first file that has changed; io or plugin for one that is missing
void check_unchanged(const Plan& plan, const std::filesystem::path& directory,
                     const std::vector<std::filesystem::path>& plugin_directories);

/// The records of a plan, as far as there are any.
struct Records {
  std::vector<Json> lines;
  std::size_t good_bytes = 0;  ///< of the file: up to the end of its last whole line
  bool cut = false;            ///< whether something followed it: a line that was not finished
};
/// @throws Error parse or invalid, naming file and line, for what is no record of this plan
[[nodiscard]] Records read_records(const std::filesystem::path& directory, const Plan& plan);

/// The command line of one run, without the program: `sweep one …` (what a sweep starts) or `run …`.
[[nodiscard]] std::vector<std::string> run_arguments(const PlannedRun& run, const std::filesystem::path& directory);

}  // namespace hamelin::sweep
