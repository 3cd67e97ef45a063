#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "command_line.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/sweep/make_plan.hpp"
#include "scene_flags.hpp"
#include "sweep.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct PlanFlags {
  sweep::PlanOptions plan;
  std::vector<std::string> goals;
  std::string mark = "touch", sizes = "0.05,0.2", bounds = "-0.8,-0.8,0,0.8,0.8,1.2";
  std::vector<std::string> keep_out;
  std::optional<double> sphere_m, visible_m;
  std::string swing, prediction = "constant-acceleration";
  std::size_t primitives = 30;
  std::uint64_t clutter_seed = 1;
  std::vector<std::filesystem::path> plugin_path;
  std::filesystem::path output;
  bool json = false;
};

void set_swing(const PlanFlags& flags, sweep::SphereOnPath& sphere) {
  const auto numbers = number_list("--swing", flags.swing, 2);
  for (const double x : numbers)
    if (!(x > 0.0))
      throw Error(ErrorCode::usage,
                  fmt::format("--swing {}: {}, expected two numbers above 0", flags.swing, x));
  sphere.swing_m = numbers[0];
  sphere.swing_period_s = numbers[1];
  sphere.prediction = sweep::prediction_from(flags.prediction, "--prediction");
}

int sweep_plan(const PlanFlags& flags) {
  sweep::PlanOptions options = flags.plan;
  for (const auto& goal : flags.goals)
    options.goals.push_back(sweep::goal_type_from(goal, "--goal"));
  options.problem.mark = scene::mark_from(flags.mark);
  scene::Clutter& clutter = options.clutter.clutter;
  clutter.count = flags.primitives;
  clutter.seed = options.clutter.draw.seed = options.gains.seed = flags.clutter_seed;
  const auto sizes = number_list("--sizes", flags.sizes, 2),
             b = number_list("--bounds", flags.bounds, 6);
  clutter.size_min_m = sizes[0];
  clutter.size_max_m = sizes[1];
  clutter.bounds = {{b[0], b[1], b[2]}, {b[3], b[4], b[5]}};
  for (const auto& text : flags.keep_out) {
    const auto k = number_list("--keep-out", text, 4);
    clutter.keep_out.push_back({{k[0], k[1], k[2]}, k[3]});
  }
  if (clutter.keep_out.empty()) clutter.keep_out.push_back({{0.0, 0.0, 0.2}, 0.35});
  std::optional<Progress> progress(std::in_place, "scenes planned");
  options.on_scene = [&progress](std::size_t done, std::size_t all) {
    progress->show(static_cast<double>(done), static_cast<double>(all));
  };
  std::vector<std::string> notes;  // printed after the progress line
  options.on_note = [&notes](const std::string& text) { notes.push_back(text); };
  if (flags.sphere_m) {
    sweep::SphereOnPath& sphere = options.sphere_on_path.emplace();
    sphere.radius_m = *flags.sphere_m;
    sphere.visible_within_m = flags.visible_m;
    sphere.seed = flags.clutter_seed;
    if (!flags.swing.empty()) set_swing(flags, sphere);
  }
  options.plugin_directories = plugin_path(flags.plugin_path);
  const sweep::Plan plan = sweep::make_plan(flags.output, options);
  progress.reset();
  for (const auto& text : notes) note(text);
  const auto feasible = static_cast<std::size_t>(std::count_if(
      plan.scenes.begin(), plan.scenes.end(), [](const auto& scene) { return scene.feasible; }));
  if (flags.json)
    print_json({{"file", sweep::plan_file(flags.output).string()},
                {"scenes", plan.scenes.size()},
                {"feasible", feasible},
                {"runs", plan.runs.size()},
                {"sha256", plan.sha256}});
  else
    report(fmt::format("{}: {} runs of {} scenes, {} of them feasible\n",
                       sweep::plan_file(flags.output).string(), plan.runs.size(),
                       plan.scenes.size(), feasible));
  return 0;
}

void add_generated_scenes(CLI::App& command, PlanFlags& flags) {
  auto& plan = flags.plan;
  command.add_option("--base", plan.base, "scene whose arm --clutter and --gain-sets use")
      ->type_name("SCENE.json");
  command.add_option("--clutter", plan.clutter.maps, "number of maps with random clutter")
      ->type_name("N")
      ->check(CLI::Range(1L, 100'000L));
  command.add_option("--pairs", plan.clutter.pairs, "pairs of start and goal per clutter map")
      ->type_name("K")
      ->capture_default_str()
      ->check(CLI::Range(1L, 100'000L));
  command.add_option("--primitives", flags.primitives, "obstacles per clutter map")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(1L, 10'000L));
  command.add_option("--sizes", flags.sizes, "smallest and largest edge of a random primitive [m]")
      ->type_name("A,B")
      ->capture_default_str();
  command.add_option("--bounds", flags.bounds, "lower and upper corner of the clutter [m]")
      ->type_name("X,Y,Z,X,Y,Z")
      ->capture_default_str();
  command
      .add_option("--keep-out", flags.keep_out,
                  "centre and radius of a ball that stays free of clutter [m]; may be repeated "
                  "(default 0,0,0.2,0.35)")
      ->type_name("X,Y,Z,R")
      ->allow_extra_args(false);
  command.add_option("--gain-sets", plan.gains.sets, "number of random gain sets for example 5.2")
      ->type_name("N")
      ->check(CLI::Range(1L, 1'000'000L));
  command
      .add_option("--draw-seed", flags.clutter_seed,
                  "seed of clutter (of the first map), pairs, gains and spheres")
      ->type_name("S")
      ->capture_default_str()
      ->check(unsigned_range());
}

void add_run_options(CLI::App& command, PlanFlags& flags) {
  command
      .add_option(
          "--planner", flags.plan.planners,
          "planner, with parameters as in hybrid:escape=none,margin_m=0.01, with a guide as "
          "in hybrid+rrt-connect, or python:FILE:CLASS; may be repeated (default the scene's)")
      ->type_name("NAME")
      ->allow_extra_args(false);
  add_set_option(command, flags.plan.set,
                 "set one value of all scenes, e.g. /step_s=0.002; may be repeated");
  command
      .add_option("--vary", flags.plan.vary,
                  "plan a run for each of these values; if repeated, for each combination")
      ->type_name("/json/pointer=V,V")
      ->allow_extra_args(false);
  command.add_option("--seeds", flags.plan.seeds, "plan a run for each of these seeds")
      ->type_name("S,S")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->default_str("1")
      ->check(unsigned_range());
  command
      .add_option("--duration", flags.plan.duration_s,
                  "longest simulated time of a run [s] (default the scene's)")
      ->type_name("T")
      ->check(CLI::PositiveNumber);
}

// The goals of problems, and a sphere on the way to them.
void add_goal_options(CLI::App& command, PlanFlags& flags) {
  auto* goal = restrict_values(
      command.add_option("--goal", flags.goals,
                         "kind of goal that problems get; may be repeated (default joint)"),
      {"joint", "position", "pose"});
  goal->type_name("KIND")->allow_extra_args(false);
  auto* sphere = command.add_option(
      "--sphere-on-path", flags.sphere_m,
      "take the path that hybrid finds as the goal of a problem, and place a sphere "
      "of this radius on it [m]; problems without a path are left out");
  sphere->type_name("R")->check(CLI::PositiveNumber)->excludes(goal);
  command
      .add_option(
          "--visible-within", flags.visible_m,
          "distance from the arm at which the planner first sees that sphere [m] (default any)")
      ->type_name("D")
      ->check(CLI::PositiveNumber)
      ->needs(sphere);
  auto* swing = command.add_option(
      "--swing", flags.swing,
      "let that sphere swing across the path, by A [m] to both sides with the period T [s]");
  swing->type_name("A,T")->needs(sphere);
  restrict_values(
      command.add_option("--prediction", flags.prediction,
                         "what planners know of its future (default constant-acceleration)"),
      {"path", "constant-acceleration", "constant-velocity", "speed-bound"})
      ->type_name("KIND")
      ->needs(swing);
}

void add_problem_options(CLI::App& command, PlanFlags& flags) {
  command.add_option("--robot", flags.plan.problem.robot, "robot file of the problems")
      ->type_name("FILE");
  command.add_option("--spheres", flags.plan.problem.spheres, "collision spheres of the robot")
      ->type_name("FILE.json");
  command.add_option("--tip", flags.plan.problem.tip, "tip link of the robot")->type_name("LINK");
  command
      .add_option("--resolution", flags.plan.problem.resolution_m,
                  "edge of a voxel in generated maps [m]")
      ->type_name("R")
      ->capture_default_str();
  restrict_values(
      command.add_option("--mark", flags.mark,
                         "mark voxels that a primitive touches, or whose centre it contains "
                         "(default touch)"),
      {"touch", "centre"});
}

}  // namespace

void add_sweep_plan(CLI::App& sweep, int& exit_code) {
  auto* command = add_command(
      sweep, "plan",
      "Plan a sweep: a run per combination of scene, planner, value and seed. Scenes come from "
      "files, "
      "MotionBenchMaker problems, random clutter or random gain sets",
      "hamelin sweep plan problems/*.json --robot arm.urdf --resolution 0.01 --goal pose -o tries\n"
      "hamelin sweep plan --clutter 20 --pairs 5 --base data/scenes/clutter.json -o tries\n"
      "hamelin sweep plan --gain-sets 50 --base data/scenes/paper_52_apf.json -o gains");
  const auto flags = std::make_shared<PlanFlags>();
  command->add_option("files", flags->plan.files, "MotionBenchMaker problems and scene files")
      ->type_name("FILE...");
  command->add_option("-o,--output", flags->output, "directory to write the plan and its scenes to")
      ->required()
      ->type_name("DIR");
  add_run_options(*command, *flags);
  add_goal_options(*command, *flags);
  add_problem_options(*command, *flags);
  add_generated_scenes(*command, *flags);
  add_plugin_path_option(*command, flags->plugin_path);
  command->add_flag("--json", flags->json, "print a summary of the plan as JSON");
  command->callback([flags, &exit_code] { exit_code = sweep_plan(*flags); });
}

}  // namespace hamelin::app
