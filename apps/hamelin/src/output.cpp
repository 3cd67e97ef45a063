#include "output.hpp"

#include <fmt/format.h>

#include "hamelin/core/error.hpp"
#include "hamelin/log/run_log.hpp"

namespace hamelin::app {

namespace fs = std::filesystem;

bool same_file(const fs::path& a, const fs::path& b) {
  std::error_code ec;
  return fs::weakly_canonical(a, ec) == fs::weakly_canonical(b, ec);
}

void check_output(const fs::path& file, const std::vector<fs::path>& inputs) {
  for (const auto& input : inputs)
    if (same_file(file, input))
      throw Error(
          ErrorCode::usage,
          fmt::format("{}: is an input, expected another path for the output", file.string()));
  log::check_writable(file);
}

fs::path output_target(const fs::path& file, const std::vector<fs::path>& inputs) {
  std::error_code ec;
  fs::path target = fs::is_symlink(file, ec) ? fs::weakly_canonical(file, ec) : file;
  if (fs::exists(target, ec) && !fs::is_regular_file(target, ec))
    throw Error(
        ErrorCode::io,
        fmt::format("{}: is not a regular file, expected a path for the output", file.string()));
  check_output(target, inputs);
  return target;
}

}  // namespace hamelin::app
