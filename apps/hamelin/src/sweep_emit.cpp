#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "command_line.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/sweep/archive.hpp"
#include "hamelin/sweep/emit.hpp"
#include "hamelin/sweep/plan.hpp"
#include "hamelin/sweep/shard.hpp"
#include "output.hpp"
#include "sweep.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

namespace fs = std::filesystem;

// Default number of shards: few enough for the usual limit of job arrays, 1000.
constexpr std::size_t shards_default = 100;

struct EmitOptions {
  sweep::ScriptOptions script;
  std::optional<std::size_t> shards;
  bool slurm = false, parallel = false, transfer = false;
  std::optional<std::string> time_limit, logins, program;
  std::optional<fs::path> output;
};

// The hosts of GNU parallel, to which the archive is written if they share no directory.
std::optional<sweep::Hosts> hosts_of(const EmitOptions& options) {
  if (!options.logins) return {};
  sweep::Hosts hosts;
  hosts.logins = *options.logins;
  if (options.transfer)
    hosts.archived_directory =
        sweep::pack(options.script.directory, options.script.directory / sweep::archive_name)
            .directory;
  return hosts;
}

int sweep_emit(EmitOptions options) {
  const sweep::Plan plan = sweep::read_plan(options.script.directory);
  if (options.output)
    (void)output_target(*options.output, {sweep::plan_file(options.script.directory)});
  options.script.shards =
      options.shards.value_or(std::clamp<std::size_t>(plan.runs.size(), 1, shards_default));
  // Hosts that share a directory have this program where it is here.
  std::error_code ec;
  const fs::path self = fs::read_symlink("/proc/self/exe", ec);
  options.script.program =
      options.program.value_or(options.transfer || ec ? "hamelin" : self.string());
  const std::string script = options.slurm
                                 ? sweep::slurm_script(options.script, options.time_limit)
                                 : sweep::parallel_script(options.script, hosts_of(options));
  if (!options.output) {
    report(script);
    return 0;
  }
  write_file_atomically(*options.output, script);
  fs::permissions(*options.output,
                  fs::perms::owner_exec | fs::perms::group_exec | fs::perms::others_exec,
                  fs::perm_options::add);
  note(fmt::format("{}: {} runs, {} shards; execute it with `{}`, then `hamelin sweep merge {}`",
                   options.output->string(), plan.runs.size(), options.script.shards,
                   (options.slurm ? "sbatch " : "bash ") + options.output->string(),
                   options.script.directory.string()));
  return 0;
}

void add_hosts(CLI::App& command, EmitOptions& options, CLI::Option* parallel) {
  auto* login = command.add_option("--sshlogin", options.logins,
                                   "hosts on which GNU parallel executes shards over ssh, as its "
                                   "option of that name takes them");
  login->type_name("HOSTS")->needs(parallel);
  command
      .add_flag(
          "--transfer", options.transfer,
          "send the sweep to the hosts as an archive and bring the records back, because they "
          "do not share its directory")
      ->needs(login);
}

}  // namespace

void add_sweep_emit(CLI::App& sweep, int& exit_code) {
  auto* command = add_command(
      sweep, "emit",
      "Write a script that executes the shards of a sweep by Slurm or GNU parallel. Repeating the "
      "script is safe: runs that have a record are skipped",
      "hamelin sweep emit tries --slurm --shards 40 --time 01:00:00 -o tries.sbatch\n"
      "hamelin sweep emit tries --parallel -o tries.sh\n"
      "hamelin sweep emit tries --parallel --sshlogin node1,node2 --transfer -o tries.sh");
  const auto options = std::make_shared<EmitOptions>();
  command
      ->add_option("directory", options->script.directory,
                   "directory written by `hamelin sweep plan`")
      ->required()
      ->type_name("DIR");
  auto* slurm = command->add_flag("--slurm", options->slurm, "write a job array for sbatch");
  auto* parallel =
      command->add_flag("--parallel", options->parallel, "write a shell script for GNU parallel");
  slurm->excludes(parallel);
  command
      ->add_option("--shards", options->shards,
                   "number of shards (default one per run, at most 100)")
      ->type_name("N")
      ->check(CLI::Range(std::size_t{1}, sweep::shards_max));
  command->add_option("--jobs", options->script.jobs, "parallel processes of each shard")
      ->type_name("J")
      ->capture_default_str()
      ->check(CLI::Range(1L, 1024L));
  command
      ->add_option("--time", options->time_limit,
                   "time limit of each task of Slurm, which queues itself again when it is reached")
      ->type_name("HH:MM:SS")
      ->needs(slurm);
  add_hosts(*command, *options, parallel);
  command
      ->add_option("--program", options->program,
                   "path of hamelin where the script runs (default this program's; with --transfer "
                   "`hamelin`)")
      ->type_name("PATH");
  add_plugin_path_option(*command, options->script.plugin_path);
  command->add_option("-o,--output", options->output, "file to write (default standard output)")
      ->type_name("FILE");
  command->callback([options, &exit_code] {
    if (options->slurm == options->parallel)
      throw Error(ErrorCode::usage, "no engine given, expected --slurm or --parallel");
    exit_code = sweep_emit(*options);
  });
}

}  // namespace hamelin::app
