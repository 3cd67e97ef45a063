#pragma once
#include <filesystem>
#include <vector>

/// Files that commands make.
namespace hamelin::app {

/// Whether both names are one file, links followed.
[[nodiscard]] bool same_file(const std::filesystem::path& a, const std::filesystem::path& b);

/// Checks, before long work begins, that a file can be written and is none of the inputs.
/// @throws Error usage or io
void check_output(const std::filesystem::path& file, const std::vector<std::filesystem::path>& inputs);

/// The same for a file that will be renamed into place: only a regular file may stand there.
/// @return where to write it: a link is followed
[[nodiscard]] std::filesystem::path output_target(const std::filesystem::path& file,
                                                  const std::vector<std::filesystem::path>& inputs);

}  // namespace hamelin::app
