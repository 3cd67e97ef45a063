#include "hamelin/simulation/replay.hpp"

#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "document.hpp"
#include "hamelin/core/error.hpp"
#include "plants.hpp"
#include "record.hpp"
#include "scene_flags.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

// With another build or processor, rounding differs from the first step on. Smooth motion carries
// the difference along, far below this, until a decision of the planner depends on it: from then on
// the runs are two different runs of the scene (docs/logs.md).
constexpr double tolerance_other_build = 1e-6;

struct ReplayOptions {
  std::filesystem::path file;
  bool verify = false;
  std::optional<double> tolerance;
  std::vector<std::filesystem::path> plugin_path;
  RecordOptions record;
};

Json difference_json(const std::optional<simulation::Verdict::Difference>& difference) {
  if (!difference) return nullptr;
  Json json = {{"line", difference->line},
               {"type", difference->type},
               {"k", nullptr},
               {"time_s", nullptr},
               {"field", difference->field},
               {"logged", difference->logged},
               {"replayed", difference->replayed},
               {"difference", nullptr}};
  if (difference->size) json["difference"] = *difference->size;
  if (difference->k) json["k"] = *difference->k;
  if (difference->time_s) json["time_s"] = *difference->time_s;
  return json;
}

std::string describe(const simulation::Verdict::Difference& d) {
  std::string place = fmt::format("line {}", d.line);
  if (d.k) place = fmt::format("tick {} ({:.6g} s), {}", *d.k, d.time_s.value_or(0.0), place);
  if (d.type != "tick") place += fmt::format(", {}", d.type);
  return fmt::format("{}{}: logged {}, replayed {}", place, d.field.empty() ? "" : ", " + d.field,
                     d.logged, d.replayed);
}

// What is known of two runs that differ.
std::string describe_branch(const simulation::Verdict& verdict, double tolerance) {
  const auto& branch = *verdict.beyond_tolerance;
  std::string text = fmt::format("differs: {}", describe(branch));
  if (branch.size) text += fmt::format(", by {:.2g}", *branch.size);
  text += !verdict.first_difference || verdict.largest == 0.0
              ? "; equal to the bit before"
              : fmt::format("; equal within {:g} before, largest difference {:.2g}", tolerance,
                            verdict.largest);
  if (!verdict.outcome_logged.empty() && !verdict.outcome_replayed.empty())
    text += fmt::format("; outcome logged {}, replayed {}", verdict.outcome_logged,
                        verdict.outcome_replayed);
  return text;
}

int verify(const ReplayOptions& options, const simulation::Recorded& recorded) {
  const double tolerance =
      options.tolerance.value_or(recorded.other_build.empty() ? 0.0 : tolerance_other_build);
  for (const auto& line : recorded.other_build)
    note(fmt::format("{}: {}", options.file.string(), line));
  if (!recorded.other_build.empty() && !options.tolerance)
    note(fmt::format(
        "another build or machine: a difference up to {:g} times max(1, |logged|) is accepted; the "
        "runs may differ from a decision on that depends on rounding",
        tolerance));
  simulation::Watch watch;
  watch.stop = &stop_on_signals();
  simulation::Verdict verdict;
  {
    Progress progress;
    watch.progress = [&progress](double time_s, double duration_s) {
      progress.show(time_s, duration_s);
    };
    const HangGuard guard;
    verdict = simulation::verify(recorded, options.file, tolerance,
                                 plugin_path(options.plugin_path), watch, plant_factory());
  }
  const bool equal = !verdict.beyond_tolerance && !verdict.stopped;
  if (options.record.json) {
    print_json({{"log", options.file.string()},
                {"equal", equal},
                {"to_the_bit", !verdict.first_difference && !verdict.stopped},
                {"tolerance", tolerance},
                {"finished", verdict.finished},
                {"lines", verdict.lines},
                {"ticks", verdict.ticks},
                {"largest_difference", verdict.largest},
                {"first_difference", difference_json(verdict.first_difference)},
                {"beyond_tolerance", difference_json(verdict.beyond_tolerance)},
                {"outcome_logged", verdict.outcome_logged},
                {"outcome_replayed", verdict.outcome_replayed},
                {"other_build", recorded.other_build}});
  } else {
    const std::string extent =
        fmt::format("{} lines, {} ticks{}", verdict.lines, verdict.ticks,
                    verdict.finished ? "" : ", up to the end of the unfinished log");
    std::string text;
    if (verdict.stopped)
      text = fmt::format("interrupted; no difference found in {}", extent);
    else if (verdict.beyond_tolerance)
      text = describe_branch(verdict, tolerance);
    else if (verdict.first_difference)
      text = fmt::format("equal within {:g} ({}); largest difference {:.2g}, the first at {}",
                         tolerance, extent, verdict.largest, describe(*verdict.first_difference));
    else
      text = fmt::format("equal to the bit ({})", extent);
    const Colour colour = equal ? Colour::good : verdict.stopped ? Colour::fair : Colour::bad;
    fmt::print("{}: {}\n", options.file.string(), coloured(text, colour));
  }
  return verdict.stopped ? 130 : equal ? 0 : 1;
}

int replay(const ReplayOptions& options) {
  if (const Kind kind = kind_of(options.file); kind != Kind::log)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: is a {}, expected a log", options.file.string(), to_string(kind)));
  if (options.verify) {
    if (options.record.log || options.record.result)
      throw Error(ErrorCode::usage,
                  "--verify: writes no files, expected neither --log nor --result with it");
    return verify(options, simulation::read_header(options.file, plugin_path(options.plugin_path)));
  }
  if (options.tolerance)
    throw Error(ErrorCode::usage, "--tolerance: has no effect without --verify");
  const auto recorded = simulation::read_header(options.file, plugin_path(options.plugin_path));
  std::vector<std::filesystem::path> inputs = files_of(recorded.scene);
  inputs.push_back(options.file);
  return record(options.record, inputs, [&](const simulation::Watch& watch) {
    return simulation::repeat(recorded, plugin_path(options.plugin_path), watch, plant_factory());
  });
}

void add_replay(CLI::App& app, int& exit_code) {
  auto* command = add_command(
      app, "replay", "Repeat the run that a log records, or verify the log by repeating it",
      "hamelin replay shelf.jsonl --verify\n"
      "hamelin replay shelf.jsonl --result again.json");
  const auto options = std::make_shared<ReplayOptions>();
  command->add_option("log", options->file, "log file, plain or zstd")
      ->required()
      ->type_name("LOG");
  command->add_flag(
      "--verify", options->verify,
      "compare every line with the log: bit for bit on the same build and "
      "instruction set, otherwise within 1e-6 up to the first decision that differs; "
      "exit code 0: equal so, 1: the line printed names the first tick and field that "
      "differ, and by how much");
  command
      ->add_option(
          "--tolerance", options->tolerance,
          "with --verify: numbers may differ by E times max(1, |logged|); 0 means bit for bit")
      ->type_name("E")
      ->check(CLI::Range(0.0, 1e300));
  add_plugin_path_option(*command, options->plugin_path);
  add_record_options(*command, options->record);
  command->callback([options, &exit_code] { exit_code = replay(*options); });
}

const RegisteredCommand registered_replay("replay", add_replay);

}  // namespace

}  // namespace hamelin::app
