#include "hamelin/sweep/emit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/sweep/plan.hpp"
#include "shell.hpp"

namespace hamelin::sweep {

namespace {

namespace fs = std::filesystem;

// A job of Slurm is warned so long before its time limit [s]; runs in progress are then ended.
constexpr int warning_s = 60;

// The command that executes a shard. `shard` is a word of the shell.
std::string shard_command(const ScriptOptions& options, const std::string& directory,
                          const std::string& shard) {
  std::string command =
      fmt::format("{} --quiet sweep run {} --shard {}/{} --jobs {}", shell_word(options.program),
                  directory, shard, options.shards, options.jobs);
  for (const auto& folder : options.plugin_path)
    command += fmt::format(" --plugin-path {}", shell_word(fs::absolute(folder).string()));
  return command;
}

// A name for the jobs that a scheduler lists.
std::string job_name(const fs::path& directory) {
  std::string name = fs::absolute(directory).lexically_normal().filename().string();
  if (name.empty()) name = fs::absolute(directory).parent_path().filename().string();
  for (char& c : name)
    if (shell_word(std::string(1, c)) != std::string(1, c) || c == '/' || c == '%') c = '-';
  return name;
}

void check_time_limit(std::string_view text) {
  const bool plain =
      !text.empty() && text.find_first_not_of("0123456789:-") == std::string_view::npos;
  if (!plain)
    throw Error(ErrorCode::usage,
                fmt::format("--time: '{}' is not a time limit of Slurm, expected minutes, "
                            "HH:MM:SS or D-HH:MM:SS",
                            text));
}

}  // namespace

std::string slurm_script(const ScriptOptions& options,
                         const std::optional<std::string>& time_limit) {
  if (time_limit) check_time_limit(*time_limit);
  const std::string directory = fs::absolute(options.directory).lexically_normal().string();
  std::string script = fmt::format(
      R"(#!/bin/bash
# Executes a sweep of hamelin in {0} shards: sbatch FILE. Submitting it again is safe, because runs
# that have a record are skipped. Afterwards: hamelin sweep merge DIR
#SBATCH --job-name={1}
#SBATCH --array=1-{0}
#SBATCH --ntasks=1
#SBATCH --cpus-per-task={2}
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output={3}/slurm-%a.log
)",
      options.shards, job_name(options.directory), options.jobs, directory);
  if (time_limit)
    script +=
        fmt::format("#SBATCH --time={}\n#SBATCH --signal=B:USR1@{}\n", *time_limit, warning_s);
  if (time_limit)
    script += R"(
# Slurm sends SIGUSR1 before the time limit: end the runs, and queue this task again.
run=
trap '[ -z "$run" ] || { kill -TERM "$run"; wait "$run"; }; scontrol requeue "$SLURM_JOB_ID"; exit 130' USR1
)";
  script += fmt::format(R"(
{} &
run=$!
)",
                        shard_command(options, shell_word(directory),
                                      "\"${SLURM_ARRAY_TASK_ID:?is not set, expected sbatch}\""));
  return script + "wait \"$run\"\n";
}

std::string parallel_script(const ScriptOptions& options, const std::optional<Hosts>& hosts) {
  const std::string directory = fs::absolute(options.directory).lexically_normal().string();
  std::string words = "parallel --will-cite --line-buffer --tagstring 'shard {}'";
  words += fmt::format(" --jobs {}%", std::max<std::size_t>(1, 100 / options.jobs));
  if (hosts) words += fmt::format(" --sshlogin {}", shell_word(hosts->logins));
  std::string command;
  if (hosts && hosts->archived_directory) {
    // Hosts keep the folder: what they have recorded is not lost if the connection is.
    const std::string work =
        "hamelin-" + sha256_of_file(plan_file(options.directory)).substr(0, 16);
    const std::string records = fmt::format("records-{{}}-of-{}.jsonl", options.shards);
    const std::string there = shell_word(("sweep" / *hosts->archived_directory).string());
    words += fmt::format(" --workdir {} --basefile {} --return {}", work, archive_name, records);
    command = fmt::format(
        "{0} --quiet sweep unpack {1} -o sweep && {{ {2}; code=$?; cp {3}/{4} .; exit $code; }}",
        shell_word(options.program), archive_name, shard_command(options, there, "{}"), there,
        records);
  } else {
    command = shard_command(options, shell_word(directory), "{}");
  }
  return fmt::format(
      R"(#!/bin/bash
# Executes a sweep of hamelin in {0} shards with GNU parallel. Repeating it is safe, because runs
# that have a record are skipped. Afterwards: hamelin sweep merge DIR
set -euo pipefail
cd {1}
seq {0} | {2} {3}
)",
      options.shards, shell_word(directory), words, shell_word(command));
}

}  // namespace hamelin::sweep
