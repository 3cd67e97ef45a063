#include "record.hpp"

#include <fmt/format.h>

#include "command_line.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/file.hpp"
#include "summary.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace fs = std::filesystem;

namespace {

bool same_file(const fs::path& a, const fs::path& b) {
  std::error_code ec;
  return fs::weakly_canonical(a, ec) == fs::weakly_canonical(b, ec);
}

// A result is renamed into place, so only a regular file may stand there, and a link is followed first.
fs::path result_target(const fs::path& file) {
  std::error_code ec;
  fs::path target = fs::is_symlink(file, ec) ? fs::weakly_canonical(file, ec) : file;
  if (fs::exists(target, ec) && !fs::is_regular_file(target, ec))
    throw Error(
        ErrorCode::io,
        fmt::format("{}: is no regular file, expected a path for the result; --json prints to stdout", file.string()));
  log::check_writable(target);
  return target;
}

}  // namespace

void add_record_options(CLI::App& command, RecordOptions& options) {
  command.add_option("--every", options.every, "log a tick every K steps; the first and the last always")
      ->type_name("K")
      ->capture_default_str()
      ->check(CLI::Range(1L, 1'000'000'000L));
  command.add_option("--log", options.log, "write the run to a JSON Lines file, line by line")->type_name("OUT.jsonl");
  command.add_option("--result", options.result, "write the result to a JSON file")->type_name("OUT.json");
  command.add_flag("--json", options.json, "print the result as JSON instead of a summary");
}

int record(const RecordOptions& options, const fs::path& input,
           const std::function<log::Result(const simulation::Watch&)>& simulate) {
  for (const auto& output : {options.log, options.result})
    if (output && same_file(*output, input))
      throw Error(ErrorCode::usage,
                  fmt::format("{}: is the input, expected another path for the output", output->string()));
  if (options.log && options.result && same_file(*options.log, *options.result))
    throw Error(ErrorCode::usage,
                fmt::format("--log and --result are both {}, expected two paths", options.log->string()));
  std::optional<fs::path> result_file;
  if (options.result) result_file = result_target(*options.result);
  std::optional<log::RunLog> run_log;
  if (options.log) run_log.emplace(*options.log);

  simulation::Watch watch;
  watch.log = run_log ? &*run_log : nullptr;
  watch.every = options.every;
  watch.stop = &stop_on_signals();
  log::Result result;
  {
    Progress progress;
    watch.progress = [&progress](double time_s, double duration_s) { progress.show(time_s, duration_s); };
    result = simulate(watch);
  }
  result.provenance["argv"] = command_line();
  const Json document = log::to_json(result);
  const std::string text = document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  if (result_file) write_file_aside(*result_file, text);
  if (options.json) {
    fmt::print("{}", text);
  } else {
    std::vector<fs::path> written;
    if (options.log) written.push_back(*options.log);
    if (options.result) written.push_back(*options.result);
    fmt::print("{}", summary(document, written));
  }
  const int code = log::exit_code(result.outcome);
  if (code == 2 || code == 3)
    error_line(fmt::format("{}: {}: {}", result.scene, log::to_string(result.outcome), result.cause));
  return code;
}

}  // namespace hamelin::app
