#pragma once
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace hamelin::sweep {

/// How a script executes a plan in shards.
struct ScriptOptions {
  std::filesystem::path directory;  ///< of the sweep
  std::size_t shards = 1;
  std::size_t jobs = 1;             ///< processes of a shard; CPUs of a task of Slurm
  std::string program = "hamelin";  ///< where the script runs
  std::vector<std::filesystem::path> plugin_path;
};

/// A script for `sbatch`: a job array with one task per shard. A task that is preempted or loses
/// its node is queued again by Slurm; one that reaches its time limit queues itself again.
/// @param time_limit of a task, as Slurm writes it ("02:00:00"); none: the limit of the partition
/// @throws Error usage for a time limit of another form
[[nodiscard]] std::string slurm_script(const ScriptOptions& options,
                                       const std::optional<std::string>& time_limit);

/// Where GNU parallel executes shards, if not on the own machine only.
struct Hosts {
  std::string logins;  ///< as `--sshlogin` takes them: "8/node1,node2"
  /// The directory of the sweep in `archive_name`, which is then sent to each host and unpacked
  /// there, and the records are brought back; none: the hosts share the directory.
  std::optional<std::filesystem::path> archived_directory;
};

/// The archive that is sent to hosts, in the directory of the sweep.
inline constexpr const char* archive_name = "sweep.tar.zst";

/// A shell script that executes the shards by GNU parallel, as many at a time as there are cores
/// over `jobs`.
[[nodiscard]] std::string parallel_script(const ScriptOptions& options,
                                          const std::optional<Hosts>& hosts);

}  // namespace hamelin::sweep
