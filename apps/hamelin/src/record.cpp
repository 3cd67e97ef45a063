#include "record.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "command_line.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "output.hpp"
#include "summary.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace fs = std::filesystem;

namespace {

// A log that may grow larger than this is announced before the run begins.
constexpr double large_log_bytes = 50e6;

std::string bytes(double count) {
  return count >= 1e9 ? fmt::format("{:.1f} GB", 1e-9 * count)
                      : fmt::format("{:.0f} MB", std::max(1.0, 1e-6 * count));
}

// Notes the expected size of the log if it is large or exceeds the free space.
void announce_size(const log::RunLog& run_log, double ticks, int dof) {
  const double size = log::estimated_bytes(dof, ticks, run_log.compressed());
  std::error_code ec;
  const auto space = fs::space(fs::absolute(run_log.file(), ec).parent_path(), ec);
  const double room = ec ? size : static_cast<double>(space.available);
  const std::string estimate =
      fmt::format("{}: may grow to about {}", run_log.file().string(), bytes(size));
  const char* remedy = run_log.compressed()
                           ? "--every K makes it smaller"
                           : "--every K or a name that ends in .zst makes it smaller";
  if (size > room)
    note(fmt::format("{}, but only {} are free; {}", estimate, bytes(room), remedy));
  else if (size > large_log_bytes)
    note(fmt::format("{}; {}", estimate, remedy));
  else
    detail(estimate);
}

}  // namespace

void add_record_options(CLI::App& command, RecordOptions& options) {
  command
      .add_option("--every", options.every,
                  "log one tick every K steps, and always the first and the last")
      ->type_name("K")
      ->capture_default_str()
      ->check(CLI::Range(1L, 1'000'000'000L));
  command
      .add_option("--log", options.log,
                  "write the run to a JSON Lines file; compressed if its name ends in .zst")
      ->type_name("OUT.jsonl");
  command.add_option("--result", options.result, "write the result to a JSON file")
      ->type_name("OUT.json");
  command.add_flag("--json", options.json, "print the result as JSON instead of a summary");
}

int record(const RecordOptions& options, const std::vector<fs::path>& inputs,
           const std::function<log::Result(const simulation::Watch&)>& simulate) {
  if (options.log && options.result && same_file(*options.log, *options.result))
    throw Error(ErrorCode::usage,
                fmt::format("--log and --result are both {}, expected different paths",
                            options.log->string()));
  std::optional<fs::path> result_file;
  if (options.result) result_file = output_target(*options.result, inputs);
  std::optional<log::RunLog> run_log;
  if (options.log) {
    check_output(*options.log, inputs);
    run_log.emplace(*options.log);
  }

  simulation::Watch watch;
  watch.log = run_log ? &*run_log : nullptr;
  watch.every = options.every;
  watch.argv = command_line();
  watch.stop = &stop_on_signals();
  watch.diagnostics = diagnostics();
  if (run_log)
    watch.announce = [&run_log](double ticks, int dof) { announce_size(*run_log, ticks, dof); };
  log::Result result;
  {
    const Phase phase("running");
    Progress progress;
    watch.progress = [&progress](double time_s, double duration_s) {
      progress.show(time_s, duration_s);
    };
    const HangGuard guard;
    result = simulate(watch);
  }
  const Json document = log::to_json(result);
  const std::string text = document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  if (result_file) write_file_atomically(*result_file, text);
  if (options.json) {
    fmt::print("{}", text);
  } else {
    std::vector<fs::path> written;
    if (options.log) written.push_back(*options.log);
    if (options.result) written.push_back(*options.result);
    report(summary(document, written));
  }
  const int code = log::exit_code(result.outcome);
  if (code == 2 || code == 3)
    error_line(
        fmt::format("{}: {}: {}", result.scene, log::to_string(result.outcome), result.cause));
  return code;
}

}  // namespace hamelin::app
