#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/scene/scene.hpp"

/// A sweep is a directory with `plan.json` (hamelin.sweep/1), the scenes made for the plan
/// (`scenes/`), and files of records (records.hpp) with one line per run, in the order in which the
/// runs ended.
namespace hamelin::sweep {

/// The "problem" label of runs of gain sets without the obstacle.
inline constexpr const char* no_obstacle = "no obstacle";

/// A file that a run reads in addition to its scene: robot, spheres, SRDF, map, change of a map.
struct PlannedInput {
  std::string file;    ///< relative to the plan's directory
  std::string sha256;  ///< of its bytes
};

/// A planner that runs use.
struct PlannedPlugin {
  std::string name;    ///< name or path, as in the runs
  std::string sha256;  ///< of its shared object
};

/// A scene of a plan.
struct PlannedScene {
  std::string file;    ///< relative to the plan's directory
  std::string sha256;  ///< of its bytes
  bool feasible = true;
  std::string reason;  ///< why it is not feasible; see feasibility()
};

/// One run of a plan: a scene with its planner replaced, values set, and a seed.
struct PlannedRun {
  std::string id;     ///< unique in the plan
  std::string scene;  ///< PlannedScene::file
  /// A name, or "python:FILE:CLASS" with a file relative to the plan; none: the scene's.
  std::optional<std::string> planner;
  std::vector<std::string> set;  ///< "/json/pointer=VALUE", applied in this order after the planner
  std::uint64_t seed = 1;
  std::map<std::string, std::string> labels;  ///< for grouping: family, problem, goal, planner, …
  std::map<std::string, double> gains;        ///< of a gain set; otherwise empty
};

/// Two planners of a plan that differ in one part only: the runs show what the part contributes.
struct Ablation {
  std::string planner;    ///< the planner as given, which is the label of its runs
  std::string without;    ///< the label of the runs without the part
  std::string parameter;  ///< of the planner
  Json value;             ///< of the parameter in the runs without the part
};

struct Plan {
  std::vector<PlannedScene> scenes;
  std::vector<PlannedInput> inputs;    ///< each once
  std::vector<PlannedPlugin> plugins;  ///< each once
  std::vector<PlannedRun> runs;
  std::vector<Ablation> ablations;
  std::string sha256;  ///< of the plan's file; empty before it is written
};

/// The JSON document of a plan; the same plan gives the same bytes.
[[nodiscard]] Json to_json(const Plan& plan);
/// Writes `directory`/plan.json and sets the plan's SHA-256.
/// @throws Error io; usage if the directory holds records of another plan
void write_plan(Plan& plan, const std::filesystem::path& directory);
/// Reads `directory`/plan.json. @throws Error io, parse or invalid
[[nodiscard]] Plan read_plan(const std::filesystem::path& directory);
/// Reads a plan from a file of any name. @throws Error io, parse or invalid
[[nodiscard]] Plan read_plan_file(const std::filesystem::path& file);

[[nodiscard]] std::filesystem::path plan_file(const std::filesystem::path& directory);

/// Reads the scene of a run and sets its planner, values and seed.
/// @throws Error io, parse, invalid or usage as scene::read_scene and scene::set_pointer
[[nodiscard]] scene::Scene read_scene(const PlannedRun& run,
                                      const std::filesystem::path& directory);

/// The content of a file of a plan. @param sha256 the hash that the plan has
/// @throws Error io; invalid if the file has changed since it was planned
[[nodiscard]] std::string read_planned_file(const std::filesystem::path& file,
                                            const std::string& sha256);
/// Checks that the scenes of these runs, and all inputs, have not changed since they were planned.
/// @throws Error invalid with the name of the first file that has changed; io for a missing one
void check_files(const Plan& plan, const std::filesystem::path& directory,
                 const std::vector<const PlannedRun*>& runs);
/// The same of the planners. @param plugin_directories where the runs search for planners
/// @throws Error as check_files(); plugin for a missing planner
void check_planners(const Plan& plan, const std::vector<std::filesystem::path>& plugin_directories);

/// The arguments of one run after `hamelin sweep one` (which a sweep starts) or `hamelin run`.
[[nodiscard]] std::vector<std::string> run_arguments(const PlannedRun& run,
                                                     const std::filesystem::path& directory);

/// The values that vary within a sweep: (JSON pointer, value) for each "/pointer=VALUE" of the
/// run's label "values".
[[nodiscard]] std::vector<std::pair<std::string, std::string>> varied_values(const PlannedRun& run);

}  // namespace hamelin::sweep
