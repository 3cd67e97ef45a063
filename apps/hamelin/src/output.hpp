#pragma once
#include <filesystem>
#include <vector>

/// Paths of the files that commands write.
namespace hamelin::app {

/// Whether both paths lead to the same file; links are followed.
[[nodiscard]] bool same_file(const std::filesystem::path& a, const std::filesystem::path& b);

/// Checks, before long work begins, that a file can be written and is not one of the inputs.
/// @throws Error usage or io
void check_output(const std::filesystem::path& file,
                  const std::vector<std::filesystem::path>& inputs);

/// The same for a file that is renamed into place, which may replace a regular file only.
/// @return the path to write to; links are followed
[[nodiscard]] std::filesystem::path output_target(const std::filesystem::path& file,
                                                  const std::vector<std::filesystem::path>& inputs);

}  // namespace hamelin::app
