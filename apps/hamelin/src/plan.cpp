#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/control/plan_paths.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/log/trajectory.hpp"
#include "output.hpp"
#include "scene_flags.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct PlanOptions {
  std::filesystem::path file;
  SceneFlags flags;
  std::optional<long> checks;
  std::string format = "json";
  double rate_hz = 250.0;
  std::optional<std::filesystem::path> output;
  bool json = false;
};

std::string plan_text(const control::PlannedGoal& goal, std::size_t index) {
  const search::Path& path = goal.path;
  const std::string name = fmt::format("goal {}", index + 1);
  if (!path.found())
    return fmt::format("{:<12}{}: {}: {}, {} checks\n", name, goal.type,
                       coloured("no path", Colour::bad), path.cause, path.checks);
  std::string text = fmt::format(
      "{:<12}{}: {} of length {:.4g} with {} way-points\n"
      "{:<12}proved to keep {:.3g} m from obstacles and from itself\n"
      "{:<12}{} checks, {} until the first path, which had the length {:.4g}; {:.3g} ms\n",
      name, goal.type, coloured("path", Colour::good), path.length, path.points.cols(), "",
      *std::min_element(goal.clearance_m.begin(), goal.clearance_m.end()), "", path.checks,
      path.first_checks, search::path_length(path.planned), 1e3 * goal.search_s);
  if (goal.motion)
    text += fmt::format("{:<12}{} of {:.4g} s, proved to keep {:.3g} m all the way\n", "",
                        coloured("motion", Colour::good), goal.motion->motion.duration_s(),
                        goal.motion->clearance_m);
  else
    text +=
        fmt::format("{:<12}{}: {}\n", "", coloured("no motion", Colour::bad), goal.motion_cause);
  return text;
}

std::string file_text(const PlanOptions& options, const control::PathPlan& plan,
                      const Json& document) {
  if (options.format == "json") return document.dump(1) + "\n";
  const scene::JointTrajectory motion = control::trajectory_of(plan, 1.0 / options.rate_hz);
  log::Trajectory out{plan.joints, {}};
  for (Eigen::Index i = 0; i < motion.points(); ++i)
    out.points.push_back({motion.time_s[i], motion.q.col(i), motion.v.col(i), {}, motion.a.col(i)});
  return options.format == "csv" ? log::to_csv(out) : log::to_joint_trajectory(out).dump(1) + "\n";
}

int plan(PlanOptions options) {
  if (options.checks)
    options.flags.set.push_back(
        fmt::format("/planner/guide_options/checks_max={}", *options.checks));
  const scene::Scene scene = read_scene(options.file, options.flags);
  std::optional<std::filesystem::path> target;
  if (options.output) target = output_target(*options.output, files_of(scene));
  const control::PathPlan plan = control::plan_paths(scene, {.motions = true});
  const Json document = control::to_json(plan);
  if (target) write_file_atomically(*target, file_text(options, plan, document));
  if (options.json) {
    print_json(document);
  } else {
    std::string text = fmt::format("{:<12}{}, seed {}\n", "guide", plan.guide, plan.seed);
    for (std::size_t i = 0; i < plan.goals.size(); ++i) text += plan_text(plan.goals[i], i);
    report(text);
  }
  return plan.found() ? 0 : 1;
}

void add_plan(CLI::App& app, int& exit_code) {
  auto* command =
      add_command(app, "plan",
                  "Search a proved path to each goal of a scene, and a motion along it. "
                  "The exit code is 1 if there is a goal to which no path was found",
                  "hamelin plan data/scenes/shelf.json -o path.json\n"
                  "hamelin plan data/scenes/shelf.json --format ros -o motion.json\n"
                  "hamelin plan data/scenes/shelf.json --seed 2 --checks 100000 --json");
  const auto options = std::make_shared<PlanOptions>();
  command->add_option("scene", options->file, "scene file")->required()->type_name("SCENE.json");
  add_guide_option(*command, options->flags);
  command
      ->add_option("--checks", options->checks,
                   "checks after which a search ends without a path (default the scene's, or "
                   "200000)")
      ->type_name("N")
      ->check(CLI::Range(1L, 1000000000L));
  add_seed_option(*command, options->flags);
  add_set_option(*command, options->flags.set,
                 "set one value of the scene, e.g. /planner/guide_options/margin_m=0.02; may be "
                 "repeated");
  restrict_values(
      command
          ->add_option("--format", options->format,
                       "of the file: json, paths and motions; or the motions to all goals one "
                       "after the other as csv, or as ros for the fields of "
                       "trajectory_msgs/msg/JointTrajectory")
          ->capture_default_str(),
      {"json", "csv", "ros"});
  command->add_option("--rate", options->rate_hz, "points per second of csv and ros, at least")
      ->type_name("HZ")
      ->check(CLI::Range(1.0, 1e5))
      ->capture_default_str();
  command->add_option("-o,--output", options->output, "file to write")->type_name("FILE");
  command->add_flag("--json", options->json, "print JSON");
  command->callback([options, &exit_code] { exit_code = plan(*options); });
}

const RegisteredCommand registered_plan("plan", add_plan);

}  // namespace

}  // namespace hamelin::app
