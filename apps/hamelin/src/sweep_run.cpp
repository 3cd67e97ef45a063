#include <fmt/format.h>

#include <memory>
#include <thread>

#include "command_line.hpp"
#include "hamelin/sweep/judged_run.hpp"
#include "hamelin/sweep/records.hpp"
#include "hamelin/sweep/run_sweep.hpp"
#include "plants.hpp"
#include "scene_flags.hpp"
#include "sweep.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

namespace fs = std::filesystem;

struct SweepRunOptions {
  fs::path directory;
  sweep::RunOptions sweep;
  std::string shard;
  std::vector<fs::path> plugin_path;
};

struct OneOptions {
  fs::path file;
  SceneFlags flags;
  std::vector<fs::path> plugin_path;
};

int sweep_run(const SweepRunOptions& options) {
  sweep::RunOptions sweep = options.sweep;
  run_in_forks(sweep, options.plugin_path);
  if (!options.shard.empty()) sweep.shard = sweep::parse_shard(options.shard, "--shard");
  sweep.stop = &stop_on_signals();
  sweep::RunOutcome outcome;
  {
    const Phase phase("the sweep");
    Progress progress("runs");
    sweep.on_done = [&progress](std::size_t done, std::size_t all) {
      progress.show(static_cast<double>(done), static_cast<double>(all));
    };
    outcome = sweep::run_sweep(options.directory, sweep);
  }
  if (outcome.dropped_truncated_line)
    note(fmt::format("{}: the last line was cut; its run is repeated",
                     (sweep.shard ? sweep::records_file(options.directory, *sweep.shard)
                                  : sweep::records_file(options.directory))
                         .string()));
  const std::size_t left = outcome.planned - outcome.recorded - outcome.run;
  report(fmt::format(
      "{}: {} runs recorded now, {} before, {} left{}\n", options.directory.string(), outcome.run,
      outcome.recorded, left,
      outcome.crashed > 0 ? fmt::format("; {} crashed", outcome.crashed) : std::string()));
  return outcome.stopped ? log::exit_code(log::Outcome::interrupted) : 0;
}

int sweep_one(const OneOptions& options) {
  const scene::Scene scene = read_scene(options.file, options.flags);
  simulation::Watch watch;
  watch.argv = command_line();
  watch.stop = &stop_on_signals();
  const HangGuard guard;
  fmt::print("{}\n", sweep::to_line(sweep::run_under_judge(scene, plugin_path(options.plugin_path),
                                                           watch, plant_factory())));
  return 0;
}

// Executes the command line `hamelin sweep one …`. It defines no other command, because each run
// would spend time on that.
int call_sweep_one(const std::vector<std::string>& command) {
  set_command_line(command);
  CLI::App sweep;
  int exit_code = 0;
  add_sweep_one(sweep, exit_code);
  std::vector<std::string> words(command.rbegin(), command.rend() - 2);  // the last first
  sweep.parse(std::move(words));
  return exit_code;
}

}  // namespace

void run_in_forks(sweep::RunOptions& options, const std::vector<fs::path>& plugin_directories) {
  options.command = {"hamelin", "sweep", "one"};
  for (const auto& directory : plugin_directories) {
    options.command.emplace_back("--plugin-path");
    options.command.push_back(directory.string());
  }
  options.main = [](const std::vector<std::string>& command) {
    set_verbosity(Verbosity::normal);
    return guarded([&command] { return call_sweep_one(command); });
  };
  options.plugin_directories = plugin_path(plugin_directories);
}

void add_sweep_run(CLI::App& sweep, int& exit_code) {
  auto* command = add_command(
      sweep, "run",
      "Execute the plan of a sweep, one process per run, and record the results. Resumes where "
      "it stopped if it was interrupted or killed",
      "hamelin sweep run tries\n"
      "hamelin sweep run tries --only hybrid --limit 10 --jobs 1\n"
      "hamelin sweep run tries --shard 3/40");
  const auto options = std::make_shared<SweepRunOptions>();
  options->sweep.timeout_s = 600.0;
  options->sweep.jobs = std::max(1U, std::thread::hardware_concurrency());
  command->add_option("directory", options->directory, "directory written by `hamelin sweep plan`")
      ->required()
      ->type_name("DIR");
  command
      ->add_option("--jobs", options->sweep.jobs,
                   "number of parallel processes (default one per core)")
      ->type_name("N")
      ->check(CLI::Range(1L, 1024L));
  command
      ->add_option("--only", options->sweep.only, "execute only runs whose id contains this text")
      ->type_name("TEXT");
  command
      ->add_option(
          "--shard", options->shard,
          "execute only part I of N parts of the plan, and record it in a file of its own; "
          "parts may run at the same time on machines that share the directory")
      ->type_name("I/N");
  command->add_option("--limit", options->sweep.limit, "largest number of runs to execute now")
      ->type_name("N")
      ->check(unsigned_range());
  command
      ->add_option("--timeout", options->sweep.timeout_s,
                   "wall-clock time after which a run is killed and recorded as crashed [s]")
      ->type_name("SECONDS")
      ->default_str("600")
      ->check(CLI::PositiveNumber);
  command->add_flag("--fresh", options->sweep.fresh, "delete the existing records and start again")
      ->excludes("--shard");
  add_plugin_path_option(*command, options->plugin_path);
  command->callback([options, &exit_code] { exit_code = sweep_run(*options); });
}

void add_sweep_one(CLI::App& sweep, int& exit_code) {
  auto* command = add_command(sweep, "one", "Run a scene under the judge and print a line of JSON",
                              "hamelin sweep one data/scenes/shelf.json\n"
                              "hamelin sweep one data/scenes/shelf.json --planner apf --seed 2");
  command->group("");
  const auto options = std::make_shared<OneOptions>();
  command->add_option("scene", options->file, "scene file")->required()->type_name("SCENE.json");
  command->add_option("--planner", options->flags.planner, "planner plugin, by name or path")
      ->type_name("NAME|PATH");
  add_set_option(*command, options->flags.set, "set one value of the scene; may be repeated");
  command->add_option("--seed", options->flags.seed, "seed of all random numbers")
      ->type_name("S")
      ->check(unsigned_range());
  add_plugin_path_option(*command, options->plugin_path);
  command->callback([options, &exit_code] { exit_code = sweep_one(*options); });
}

}  // namespace hamelin::app
