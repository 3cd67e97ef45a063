#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/atomic_file.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/report/report.hpp"
#include "hamelin/sweep/csv.hpp"
#include "hamelin/sweep/page.hpp"
#include "hamelin/sweep/records.hpp"
#include "output.hpp"
#include "page.hpp"
#include "sweep.hpp"
#include "sweep_replays.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

namespace fs = std::filesystem;

struct MergeOptions {
  std::vector<fs::path> directories;
  std::vector<std::string> by{"goal", "planner"};
  std::optional<fs::path> output, page, csv, records;
  std::size_t replay = 0;
  std::vector<fs::path> plugin_path;
  bool json = false, without_timing = false;
};

int sweep_merge(const MergeOptions& options) {
  std::vector<fs::path> inputs;
  for (const auto& directory : options.directories) {
    inputs.push_back(sweep::plan_file(directory));
    for (auto& file : sweep::record_files(directory)) inputs.push_back(std::move(file));
  }
  if (options.replay > 0 && !options.page)
    throw Error(ErrorCode::usage, "--replay: has no effect without --page");
  std::optional<fs::path> output, page, csv, records, template_file;
  if (options.output) output = output_target(*options.output, inputs);
  if (options.page) page = output_target(*options.page, inputs);
  if (options.csv) csv = output_target(*options.csv, inputs);
  if (page) template_file = page_template("sweep");
  if (options.records) records = output_target(*options.records, inputs);
  const bool timing = !options.without_timing;
  const sweep::Merged merged =
      sweep::merge(sweep::read_sweeps(options.directories, timing), options.by);
  const Json summary = sweep::to_json(merged);
  if (output) write_file_atomically(*output, summary.dump(2) + "\n");
  if (csv) {
    AtomicFile out(*csv);
    sweep::write_csv(merged.sweeps, [&out](std::string_view line) { out.append(line); });
    out.commit();
  }
  if (page) {
    sweep::PageExtras extras;
    extras.replays = write_replays(merged, {options.replay, *page, options.plugin_path});
    extras.comparisons = sweep::comparisons_of_page(merged.sweeps);
    write_page(*template_file, report::pack(sweep::page_json(merged, extras)), *page);
  }
  if (records) sweep::write_records(merged.sweeps, *records, timing);
  for (const auto& text : merged.notes) note(text);
  if (options.json)
    print_json(summary);
  else
    report(sweep::to_table(merged));
  return 0;
}

}  // namespace

void add_sweep_merge(CLI::App& sweep, int& exit_code) {
  auto* command =
      add_command(sweep, "merge",
                  "Summarise the records of sweeps, of all shards: success with 95 % intervals, "
                  "contacts, times",
                  "hamelin sweep merge tries more --by family,goal,planner -o summary.json\n"
                  "hamelin sweep merge tries --page tries.html --replay 2 --csv tries.csv\n"
                  "hamelin sweep merge tries --without-timing --records tries.jsonl");
  const auto options = std::make_shared<MergeOptions>();
  command
      ->add_option("directories", options->directories, "sweep directories, with plan and records")
      ->required()
      ->type_name("DIR...");
  command
      ->add_option(
          "--by", options->by,
          "labels to group by: family, problem, goal, map, planner, values, seed, gains, sphere")
      ->type_name("LABEL,LABEL")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->default_str("goal,planner");
  command->add_option("-o,--output", options->output, "write the summary as JSON")
      ->type_name("SUMMARY.json");
  command
      ->add_option(
          "--page", options->page,
          "write an HTML page with success, times, failures, comparisons of planners, maps "
          "of varied values, and all runs")
      ->type_name("PAGE.html");
  command
      ->add_option(
          "--replay", options->replay,
          "with --page: repeat the first N failed runs of each class of failures and planner, and "
          "link their replayed scenes, in the folder PAGE-runs")
      ->type_name("N")
      ->check(CLI::Range(1L, 1000L));
  command->add_option("--csv", options->csv, "write one line per run as CSV")
      ->type_name("RUNS.csv");
  command
      ->add_option("--plugin-path", options->plugin_path,
                   "with --replay: directory to search first for planners; may be repeated")
      ->type_name("DIR")
      ->allow_extra_args(false);
  command
      ->add_option("--records", options->records,
                   "write the records in the order of the plan; the bytes do not depend on shards")
      ->type_name("RECORDS.jsonl");
  command->add_flag("--without-timing", options->without_timing,
                    "leave out what depends on the machine, so that repeated studies give equal "
                    "bytes");
  command->add_flag("--json", options->json, "print the summary as JSON");
  command->callback([options, &exit_code] { exit_code = sweep_merge(*options); });
}

}  // namespace hamelin::app
