#include <fmt/format.h>
#include <unistd.h>

#include <memory>
#include <thread>

#include "bench_explain.hpp"
#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/bench/draw.hpp"
#include "hamelin/bench/families.hpp"
#include "hamelin/bench/moving_scene.hpp"
#include "hamelin/bench/results.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/log/result.hpp"
#include "hamelin/sweep/ablation.hpp"
#include "hamelin/sweep/make_plan.hpp"
#include "hamelin/sweep/run_sweep.hpp"
#include "output.hpp"
#include "sweep.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

namespace fs = std::filesystem;

struct SetOptions {
  std::optional<fs::path> set;
  bench::Selection selection;
  fs::path output;
  bool json = false;
};

struct BenchRunOptions : SetOptions {
  std::vector<std::string> planners, assignments, ablations;
  bool expect_gain = false;
  std::optional<std::string> goal;
  std::optional<double> duration_s;
  std::vector<std::string> predictions;
  bool explain = false;
  std::size_t jobs = 1;
  double timeout_s = 600.0;
  bool markdown = false;
  std::vector<fs::path> plugin_path;
};

struct TableOptions {
  std::optional<fs::path> set;
  fs::path directory;
  bool markdown = false, json = false;
};

struct DrawFlags {
  bench::DrawOptions draw;
  bool moving = false;
  fs::path output;
};

// A set that ships, by its name, or a file.
fs::path set_file(const std::optional<fs::path>& given) {
  fs::path name = given.value_or("v1");
  if (name.has_extension() || name.has_parent_path()) return name;
  return prefix().value_or("/") / "share" / "hamelin" / "bench" / (name.string() + ".json");
}

bool is_moving(const bench::ProblemSet& set) {
  return bench::is_moving(set.problems.front().family);
}

std::string describe(const bench::ProblemSet& set, std::size_t count) {
  return fmt::format("{}, {} of {} problems, SHA-256 {}", set.name, count, set.problems.size(),
                     set.sha256);
}

int bench_make(const SetOptions& options) {
  const fs::path file = set_file(options.set);
  const bench::ProblemSet set = bench::read_problem_set(file);
  const auto problems = bench::select(set, options.selection);
  if (is_moving(set))
    (void)bench::write_moving_scenes(set, problems, {std::nullopt}, options.output, file.string());
  else
    (void)bench::write_problems(problems, options.output, file.string());
  if (options.json)
    print_json({{"directory", options.output.string()},
                {"set", set.name},
                {"sha256", set.sha256},
                {"problems", problems.size()}});
  else
    report(fmt::format("{}: {}\n", options.output.string(), describe(set, problems.size())));
  return 0;
}

// The problems of a set with maps, each with a goal of the chosen kind.
void add_problems(sweep::PlanOptions& plan, const BenchRunOptions& options, const fs::path& file,
                  const bench::ProblemSet& set, const std::vector<bench::Problem>& problems) {
  constexpr double longest_s = 20.0;
  if (!options.predictions.empty())
    throw Error(ErrorCode::usage, "--prediction: has no effect, as no obstacle of the set moves");
  plan.problem.robot = set.robot.robot;
  plan.problem.spheres = set.robot.spheres;
  plan.problem.tip = set.robot.tip;
  plan.problem.resolution_m = set.resolution_m;
  plan.goals = {sweep::goal_type_from(options.goal.value_or("joint"), "--goal")};
  plan.duration_s = options.duration_s.value_or(longest_s);
  plan.files = bench::write_problems(problems, options.output / "problems", file.string());
}

// The scenes of a set whose obstacles move, once per prediction.
void add_moving_scenes(sweep::PlanOptions& plan, const BenchRunOptions& options,
                       const fs::path& file, const bench::ProblemSet& set,
                       const std::vector<bench::Problem>& problems) {
  if (options.goal)
    throw Error(ErrorCode::usage,
                "--goal: has no effect, as problems with moving obstacles have joint goals");
  std::vector<bench::PredictionChoice> predictions;
  for (const auto& name : options.predictions)
    predictions.push_back(name == bench::describe(bench::PredictionChoice{})
                              ? bench::PredictionChoice{}
                              : sweep::prediction_from(name, "--prediction"));
  if (predictions.empty()) predictions = {std::nullopt};
  plan.files = bench::write_moving_scenes(set, problems, predictions, options.output / "problems",
                                          file.string());
  for (std::size_t i = 0; i < plan.files.size(); ++i)
    plan.labels[plan.files[i].stem().string()] =
        bench::labels(problems[i % problems.size()], predictions[i / problems.size()]);
  plan.duration_s = options.duration_s;
}

void plan_benchmark(const BenchRunOptions& options, const fs::path& file,
                    const bench::ProblemSet& set, const std::vector<bench::Problem>& problems) {
  sweep::PlanOptions plan;
  plan.planners = options.planners;
  plan.set = options.assignments;
  plan.plugin_directories = plugin_path(options.plugin_path);
  if (!options.ablations.empty() && plan.planners.empty()) plan.planners = {"hybrid"};
  sweep::add_ablations(plan, options.ablations);
  const auto add = is_moving(set) ? &add_moving_scenes : &add_problems;
  add(plan, options, file, set, problems);
  Progress progress("problems made");
  plan.on_scene = [&progress](std::size_t done, std::size_t all) {
    progress.show(static_cast<double>(done), static_cast<double>(all));
  };
  const sweep::Plan made = sweep::make_plan(options.output, plan);
  if (!is_moving(set)) bench::check_maps(problems, made, file.string());
}

sweep::RunOutcome run_benchmark(const BenchRunOptions& options) {
  sweep::RunOptions sweep;
  run_in_forks(sweep, options.plugin_path);
  sweep.jobs = options.jobs;
  sweep.timeout_s = options.timeout_s;
  sweep.stop = &stop_on_signals();
  Progress progress("runs");
  sweep.on_done = [&progress](std::size_t done, std::size_t all) {
    progress.show(static_cast<double>(done), static_cast<double>(all));
  };
  return sweep::run_sweep(options.output, sweep);
}

bench::Results write_results(const fs::path& directory, const bench::ProblemSet& set, bool markdown,
                             bool json) {
  bench::Results results = bench::read_results(directory, set);
  const Json document = bench::to_json(results);
  const fs::path target = directory / "benchmark.json";
  write_file_atomically(target, document.dump(2) + "\n");
  for (const auto& text : results.by_family.notes) note(text);
  for (const auto& text : bench::parts_without_effect(results)) note(text);
  if (json)
    print_json(document);
  else
    report(fmt::format("{}\n{}: {}\n", bench::to_table(results, markdown), target.string(),
                       describe(set, results.problems.size())));
  return results;
}

int bench_table(const TableOptions& options) {
  (void)write_results(options.directory, bench::read_problem_set(set_file(options.set)),
                      options.markdown, options.json);
  return 0;
}

int bench_run(const BenchRunOptions& options) {
  if (options.expect_gain && options.ablations.empty())
    throw Error(ErrorCode::usage, "--expect-gain: has no effect without --ablate");
  const fs::path file = set_file(options.set);
  const bench::ProblemSet set = bench::read_problem_set(file);
  if (options.explain && !is_moving(set))
    throw Error(ErrorCode::usage, "--explain: has no effect, as no obstacle of the set moves");
  const auto problems = bench::select(set, options.selection);
  plan_benchmark(options, file, set, problems);
  const sweep::RunOutcome outcome = run_benchmark(options);
  if (options.explain)
    explain_contacts(bench::read_results(options.output, set), options.output, options.plugin_path);
  const auto results = write_results(options.output, set, options.markdown, options.json);
  if (outcome.stopped) return log::exit_code(log::Outcome::interrupted);
  if (!options.expect_gain) return 0;
  const auto harmful = bench::harmful_parts(results);
  for (const auto& line : harmful) error_line(line);
  return harmful.empty() ? 0 : 1;
}

/// A directory for temporary files, removed at the end.
class ScratchDirectory {
 public:
  ScratchDirectory() {
    std::string path = (fs::temp_directory_path() / "hamelin-bench-XXXXXX").string();
    if (::mkdtemp(path.data()) == nullptr)
      throw Error(ErrorCode::io, fmt::format("{}: cannot be created", path));
    path_ = path;
  }
  ~ScratchDirectory() {
    std::error_code ec;
    fs::remove_all(path_, ec);
  }
  ScratchDirectory(const ScratchDirectory&) = delete;
  ScratchDirectory& operator=(const ScratchDirectory&) = delete;
  [[nodiscard]] const fs::path& path() const noexcept { return path_; }

 private:
  fs::path path_;
};

std::string left_out(const bench::DrawCounts& drawn, bool moving) {
  if (moving)
    return fmt::format("{} had no start or goal, {} no room for the obstacles",
                       drawn.no_start_or_goal, drawn.no_room);
  return fmt::format(
      "{} had no start or goal, {} a free straight motion, {} no path that was found",
      drawn.no_start_or_goal, drawn.straight_is_free, drawn.path_unknown);
}

int bench_draw(const DrawFlags& flags) {
  bench::DrawOptions options = flags.draw;
  const fs::path target = output_target(flags.output, {options.robot.robot, options.robot.spheres});
  const ScratchDirectory scratch;
  options.scratch = scratch.path();
  bench::ProblemSet set;
  {
    Progress progress("problems drawn");
    options.on_problem = [&progress](std::size_t done, std::size_t all) {
      progress.show(static_cast<double>(done), static_cast<double>(all));
    };
    set = flags.moving ? bench::draw_moving_set(options) : bench::draw_problem_set(options);
  }
  const std::string text = bench::to_text(set, target.parent_path());
  write_file_atomically(target, text);
  report(fmt::format("{}: {} problems of {} candidates; {}\nSHA-256 {}\n", target.string(),
                     set.problems.size(), set.drawn.candidates, left_out(set.drawn, flags.moving),
                     sha256_hex(text)));
  return 0;
}

std::vector<std::string> all_families() {
  std::vector<std::string> all = bench::families();
  const auto& moving = bench::moving_families();
  all.insert(all.end(), moving.begin(), moving.end());
  return all;
}

void add_families(CLI::App& command, std::vector<std::string>& chosen) {
  restrict_values(command.add_option("--family", chosen, "families to use (default all)"),
                  all_families())
      ->type_name("NAME,NAME")
      ->delimiter(',')
      ->allow_extra_args(false);
}

void add_problems_option(CLI::App& command, std::optional<fs::path>& set) {
  command
      .add_option("--problems", set,
                  "problem set: a file, or one of those that ship, v1 (the default) and moving")
      ->type_name("SET");
}

void add_set_options(CLI::App& command, SetOptions& options) {
  add_problems_option(command, options.set);
  add_families(command, options.selection.families);
  command
      .add_option("--per-family", options.selection.per_family,
                  "use only the first N problems of each family (default all)")
      ->type_name("N")
      ->default_str("")
      ->check(CLI::Range(1L, 100'000L));
  command
      .add_option("--per-cell", options.selection.per_cell,
                  "where obstacles move: use only the first N problems of each number and speed "
                  "of obstacles (default all)")
      ->type_name("N")
      ->default_str("")
      ->check(CLI::Range(1L, 100'000L));
  command.add_flag("--json", options.json, "print the result as JSON");
}

void add_make(CLI::App& parent, int& exit_code) {
  auto* command = add_command(
      parent, "make",
      "Write the problems of a set as files: start, goal and primitives, or scenes where obstacles "
      "move. They are the same to the byte on every machine, which is checked",
      "hamelin bench make -o problems\n"
      "hamelin bench make --problems moving --per-cell 1 -o scenes\n"
      "hamelin bench make --family shelf,cage --per-family 2 -o problems");
  const auto options = std::make_shared<SetOptions>();
  command->add_option("-o,--output", options->output, "directory to write the problems to")
      ->required()
      ->type_name("DIR");
  add_set_options(*command, *options);
  command->callback([options, &exit_code] { exit_code = bench_make(*options); });
}

void add_planner_options(CLI::App& command, BenchRunOptions& options) {
  command
      .add_option("--planner", options.planners,
                  "planner, with parameters as in hybrid:escape=none, with a guide as in "
                  "hybrid+rrt-connect, or python:FILE:CLASS; may be repeated (default hybrid)")
      ->type_name("NAME")
      ->allow_extra_args(false);
  command
      .add_option("--ablate", options.ablations,
                  "also run each planner without one part, and compare the two by paired tests: a "
                  "boolean parameter is negated, a number becomes 0, others need a value as in "
                  "escape=none; may be repeated")
      ->type_name("PARAMETER[=VALUE]")
      ->allow_extra_args(false);
  command.add_flag("--expect-gain", options.expect_gain,
                   "with --ablate: exit with code 1 if a planner solves significantly more "
                   "problems without a part (p < 0.05), and name the part");
}

void add_moving_options(CLI::App& command, BenchRunOptions& options) {
  restrict_values(
      command.add_option("--prediction", options.predictions,
                         "where obstacles move: what planners are told of their motion; may be "
                         "repeated, to compare (default as drawn)"),
      {"drawn", "path", "constant-acceleration", "constant-velocity", "speed-bound"})
      ->type_name("KIND")
      ->allow_extra_args(false);
  command.add_flag("--explain", options.explain,
                   "where obstacles move: also repeat each run that ends in contact, write its log "
                   "to DIR/contacts, and search whether the contact was avoidable, as `hamelin "
                   "explain` does");
}

void add_run_command(CLI::App& parent, int& exit_code) {
  auto* command = add_command(
      parent, "run",
      "Run planners with the problems of a set, print a table of the results and write them to "
      "DIR/benchmark.json. Resumes where it stopped if it was interrupted",
      "hamelin bench run --planner hybrid+rrt-connect --planner python:mine.py:Mine -o full\n"
      "hamelin bench run --ablate steering --ablate escape=none --per-family 2 -o parts\n"
      "hamelin bench run --problems moving --per-cell 1 --explain -o moving");
  const auto options = std::make_shared<BenchRunOptions>();
  command->add_option("-o,--output", options->output, "directory to write problems and records to")
      ->required()
      ->type_name("DIR");
  add_planner_options(*command, *options);
  command
      ->add_option("--set", options->assignments,
                   "set one value of all scenes, e.g. /step_s=0.002; may be repeated")
      ->type_name("/json/pointer=VALUE")
      ->allow_extra_args(false);
  restrict_values(command->add_option("--goal", options->goal,
                                      "kind of goal that the problems get (default joint)"),
                  {"joint", "position", "pose"})
      ->type_name("KIND");
  command
      ->add_option("--duration", options->duration_s,
                   "longest simulated time of a run [s] (default 20, or as the scenes say)")
      ->type_name("T")
      ->check(CLI::PositiveNumber);
  add_moving_options(*command, *options);
  options->jobs = std::max(1U, std::thread::hardware_concurrency());
  command
      ->add_option("--jobs", options->jobs, "number of parallel processes (default one per core)")
      ->type_name("N")
      ->check(CLI::Range(1L, 1024L));
  command
      ->add_option("--timeout", options->timeout_s,
                   "wall-clock time after which a run is killed and recorded as crashed [s]")
      ->type_name("SECONDS")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  command->add_flag("--markdown", options->markdown, "print the tables in Markdown");
  add_set_options(*command, *options);
  add_plugin_path_option(*command, options->plugin_path);
  command->callback([options, &exit_code] { exit_code = bench_run(*options); });
}

void add_table(CLI::App& parent, int& exit_code) {
  auto* command = add_command(
      parent, "table",
      "Print the tables of a benchmark that `hamelin bench run` or `hamelin sweep run` executed, "
      "and write its results to DIR/benchmark.json",
      "hamelin bench table results\n"
      "hamelin bench table results --markdown");
  const auto options = std::make_shared<TableOptions>();
  command->add_option("directory", options->directory, "directory of the benchmark")
      ->required()
      ->type_name("DIR");
  add_problems_option(*command, options->set);
  command->add_flag("--markdown", options->markdown, "print the tables in Markdown");
  command->add_flag("--json", options->json, "print the results as JSON");
  command->callback([options, &exit_code] { exit_code = bench_table(*options); });
}

void add_draw(CLI::App& parent, int& exit_code) {
  auto* command = add_command(
      parent, "draw",
      "Draw a new set of problems with other seeds or for another arm. Takes a problem only if a "
      "search finds a path",
      "hamelin bench draw --name mine-1 --robot arm.urdf --draw-seed 7 -o mine.json\n"
      "hamelin bench draw --name mine-2 --robot arm.urdf --family shelf,cage -o mine.json");
  const auto flags = std::make_shared<DrawFlags>();
  auto& draw = flags->draw;
  command->add_option("-o,--output", flags->output, "file to write the set to")
      ->required()
      ->type_name("SET.json");
  command->add_option("--name", draw.name, "name of the set")->required()->type_name("NAME");
  command->add_option("--robot", draw.robot.robot, "robot file")->required()->type_name("FILE");
  command->add_option("--spheres", draw.robot.spheres, "collision spheres of the robot")
      ->type_name("FILE.json");
  command->add_option("--tip", draw.robot.tip, "tip link of the robot")->type_name("LINK");
  add_families(*command, draw.families);
  command->add_flag("--moving", flags->moving,
                    "draw problems whose obstacles move, from the families cubes, people and "
                    "pendulums; --per-family is then the number per family, number of obstacles "
                    "and speed");
  command->add_option("--per-family", draw.per_family, "number of problems per family")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(1L, 1000L));
  command->add_option("--draw-seed", draw.seed, "seed of the set")
      ->type_name("S")
      ->capture_default_str()
      ->check(CLI::Range(0L, 1'000'000'000L));
  command->add_option("--resolution", draw.resolution_m, "edge of a voxel of the maps [m]")
      ->type_name("R")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  command
      ->add_option("--min-clearance", draw.clearance_m, "smallest clearance of start and goal [m]")
      ->type_name("D")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  command->callback([flags, &exit_code] { exit_code = bench_draw(*flags); });
}

void add_list(CLI::App& parent, int& exit_code) {
  auto* command =
      add_command(parent, "families", "List the families of clutter and of moving obstacles",
                  "hamelin bench families\nhamelin bench families --json");
  const auto json = std::make_shared<bool>(false);
  command->add_flag("--json", *json, "print the list as JSON");
  command->callback([json, &exit_code] {
    Json all = Json::object();
    std::string text;
    for (const auto& family : all_families()) {
      const auto description =
          bench::is_moving(family) ? bench::describe_movers(family) : bench::describe(family);
      all[family] = description;
      text += fmt::format("{:<12} {}\n", family, description);
    }
    if (*json)
      print_json(all);
    else
      report(text);
    exit_code = 0;
  });
}

void add_bench(CLI::App& app, int& exit_code) {
  auto* bench = add_command(app, "bench", "Compare planners on a published set of problems",
                            "hamelin bench run --planner hybrid --planner apf -o results\n"
                            "hamelin bench families\n"
                            "hamelin bench make -o problems");
  bench->require_subcommand(1);
  add_run_command(*bench, exit_code);
  add_table(*bench, exit_code);
  add_make(*bench, exit_code);
  add_list(*bench, exit_code);
  add_draw(*bench, exit_code);
}

const RegisteredCommand registered_bench("bench", add_bench);

}  // namespace

}  // namespace hamelin::app
