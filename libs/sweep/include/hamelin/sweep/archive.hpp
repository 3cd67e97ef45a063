#pragma once
#include <cstddef>
#include <filesystem>

/// A sweep as one file, to be executed on machines that do not share a file system: a tar archive
/// compressed by zstd, with the plan and each file that its runs read. Its first file,
/// hamelin-archive.json (hamelin.archive/1), has the SHA-256 of all others.
namespace hamelin::sweep {

struct Archived {
  std::filesystem::path directory;  ///< of the sweep, relative to the folder of the archive
  std::size_t files = 0;
};

/// Writes the archive of a sweep, without its records. The same sweep gives the same bytes.
/// Planners are not part of it: each machine has its own, whose SHA-256 the plan holds.
/// @throws Error io; invalid for files that have changed since they were planned, for a scene or
///         plan that names an absolute path, and for a planner named by its path
Archived pack(const std::filesystem::path& directory, const std::filesystem::path& file);

/// Makes the folder `output` with the files of an archive, all of them or, on any error, none. Does
/// nothing if the folder holds the same archive already; several processes may unpack at the same
/// time.
/// @throws Error io; invalid for a file that is not such an archive, is cut or damaged, or names
///         paths outside of its folder; usage if the folder exists with other content
Archived unpack(const std::filesystem::path& file, const std::filesystem::path& output);

}  // namespace hamelin::sweep
