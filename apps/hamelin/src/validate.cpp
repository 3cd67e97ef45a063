#include <fmt/format.h>

#include <memory>
#include <optional>
#include <sstream>
#include <string>
#include <string_view>

#include "command_line.hpp"
#include "commands.hpp"
#include "document.hpp"
#include "hamelin/accuracy/accuracy.hpp"
#include "hamelin/bench/problem_set.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/scene/make.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/sweep/plan.hpp"
#include "hamelin/task/task.hpp"
#include "robot_commands.hpp"
#include "robot_notes.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct ValidateOptions {
  std::vector<std::filesystem::path> files;
  std::optional<std::string> tip;
  std::optional<double> scale;
  bool strict = false, json = false;
};

std::string check_robot(const std::filesystem::path& file,
                        const description::RobotOptions& options) {
  const model::Robot robot = description::read_robot(file, options);
  note_warnings(robot, file);
  return fmt::format("robot, {} joints", robot.dof());
}

std::string describe_map(const scene::MapData& map) {
  return fmt::format("map, resolution {:.4g} m, {} occupied leaves", map.resolution,
                     map.occupied.size());
}

// A scene is valid only if the files that it names are.
std::string check_scene(const std::filesystem::path& file, bool strict) {
  const scene::Scene scene = scene::read_scene(file);
  (void)control::load_model(scene);
  std::string description = fmt::format(
      "scene, {}", check_robot(scene.robot.file,
                               {scene.robot.tip, scene.robot.spheres, scene.robot.srdf, strict}));
  if (scene.map && !scene.map->file.empty())
    description += fmt::format(
        ", {}", describe_map(scene::read_map(scene.map->file,
                                             {scene.map->scale, scene.map->occupancy_threshold})));
  return description;
}

// Checks each line alone; `hamelin sweep merge` checks that the records belong to their plan.
std::string check_records(const std::filesystem::path& file) {
  std::istringstream in(read_file(file));
  std::size_t count = 0;
  for (std::string line; std::getline(in, line);) {
    const std::string where = fmt::format("{}: line {}", file.string(), ++count);
    const Json record = parse_json(line, where);
    check_shipped_schema(record, "record", where);
    if (!record["result"].is_null())
      check_shipped_schema(record["result"], "result", where + ": /result");
  }
  return fmt::format("sweep records, {}", count);
}

// For kinds of files that have no other rules than their schema.
std::string check_by_schema(const std::filesystem::path& file, std::string_view schema,
                            const std::string& description) {
  check_shipped_schema(read_json(file), schema, file.string());
  return description;
}

std::string check_map(const std::filesystem::path& file, std::optional<double> scale) {
  const auto map = scene::read_map(file, {scale, 0.5});
  for (const auto& warning : map.warnings) note(fmt::format("{}: {}", file.string(), warning));
  return describe_map(map);
}

std::string check_task(const std::filesystem::path& file) {
  const auto task = task::task_from_json(read_json(file), file.parent_path(), file.string());
  return fmt::format("task, {} objects, {} steps", task.objects.size(), task.steps.size());
}

std::string check_waypoints(const std::filesystem::path& file) {
  const auto path = scene::read_waypoint_path(file, {});
  return fmt::format("way-points, {}, up to {:.3g} m/s and {:.3g} rad/s", path.waypoints().size(),
                     path.speed_max(), path.rate_max());
}

std::string check_plan(const std::filesystem::path& file) {
  const auto plan = sweep::read_plan_file(file);
  return fmt::format("sweep plan, {} runs of {} scenes", plan.runs.size(), plan.scenes.size());
}

std::string check_benchmark(const std::filesystem::path& file) {
  const Json document = read_json(file);
  check_shipped_schema(document, "benchmark", file.string());
  check_shipped_schema(document["summary"], "summary", file.string() + ": /summary");
  return "benchmark results";
}

std::string check_archive(const std::filesystem::path& file) {
  const Json document = read_json(file);
  check_shipped_schema(document, "archive", file.string());
  return fmt::format("description of a sweep archive, {} files", document["files"].size());
}

std::string check_log(const std::filesystem::path& file) {
  const auto log = log::check_log(file);
  return fmt::format("log, {} ticks, {} events{}{}", log.ticks, log.events,
                     log.has_result ? "" : ", no result: unfinished",
                     log.cut ? ", last line cut" : "");
}

// @return what the file holds
std::string check_file(const std::filesystem::path& file, const ValidateOptions& options) {
  switch (kind_of(file)) {
    case Kind::map:
      return check_map(file, options.scale);
    case Kind::urdf:
    case Kind::robot:
      return check_robot(file, {options.tip, {}, {}, options.strict});
    case Kind::scene:
      return check_scene(file, options.strict);
    case Kind::task:
      return check_task(file);
    case Kind::result:
      return check_by_schema(file, "result", "result");
    case Kind::explanation:
      return check_by_schema(file, "explanation", "explanation");
    case Kind::path:
      return check_by_schema(file, "path", "path");
    case Kind::trajectory:
      return check_by_schema(file, "trajectory", "trajectory");
    case Kind::primitives:
      return fmt::format(
          "primitives, {} obstacles",
          scene::make_options_from_json(read_json(file), file.string()).primitives.size());
    case Kind::spheres:
      return fmt::format("collision spheres, {}", description::check_spheres(file));
    case Kind::waypoints:
      return check_waypoints(file);
    case Kind::sweep:
      return check_plan(file);
    case Kind::records:
      return check_records(file);
    case Kind::summary:
      return check_by_schema(file, "summary", "sweep summary");
    case Kind::comparison:
      return check_by_schema(file, "comparison", "sweep comparison");
    case Kind::accuracy:
      return fmt::format(
          "measurement of accuracy, {} rows",
          accuracy::measurement_from_json(read_json(file), file.string()).rows.size());
    case Kind::problems:
      return fmt::format("problem set, {} problems", bench::read_problem_set(file).problems.size());
    case Kind::benchmark:
      return check_benchmark(file);
    case Kind::archive:
      return check_archive(file);
    case Kind::log:
      return check_log(file);
  }
  return "";
}

int validate(const ValidateOptions& options) {
  int code = 0;
  Json all = Json::array();
  for (const auto& file : options.files) {
    Json entry{{"file", file.string()}, {"ok", true}, {"holds", nullptr}, {"error", nullptr}};
    try {
      const std::string description = check_file(file, options);
      entry["holds"] = description;
      if (!options.json) report(fmt::format("{}: ok ({})\n", file.string(), description));
    } catch (const Error& e) {
      error_line(e.what());
      entry["ok"] = false;
      entry["error"] = e.what();
      code = 2;
    }
    all.push_back(std::move(entry));
  }
  if (options.json) print_json(all);
  return code;
}

void add_validate(CLI::App& app, int& exit_code) {
  auto* command = add_command(app, "validate",
                              "Check files of all formats, from robots to results. "
                              "The kind of each file is recognised by its content",
                              "hamelin validate data/scenes/shelf.json data/maps/shelf.bt\n"
                              "hamelin validate arm.urdf --tip tool0\n"
                              "hamelin validate run.jsonl --json");
  const auto options = std::make_shared<ValidateOptions>();
  command->add_option("files", options->files, "files to check")->required()->type_name("FILE...");
  command->add_option("--tip", options->tip, "tip link (default for a URDF: its only leaf)")
      ->type_name("LINK");
  command->add_option("--scale", options->scale, "metres per unit of a map")->type_name("S");
  command->add_flag("--strict", options->strict, strict_help);
  command->add_flag("--json", options->json, "print JSON, one entry per file");
  command->callback([options, &exit_code] { exit_code = validate(*options); });
}

const RegisteredCommand registered_validate("validate", add_validate);

}  // namespace

}  // namespace hamelin::app
