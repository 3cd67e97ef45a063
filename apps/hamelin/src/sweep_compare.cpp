#include <fmt/format.h>

#include <limits>
#include <memory>

#include "command_line.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/report/report.hpp"
#include "hamelin/sweep/compare.hpp"
#include "hamelin/sweep/page.hpp"
#include "hamelin/sweep/records.hpp"
#include "output.hpp"
#include "page.hpp"
#include "sweep.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

namespace fs = std::filesystem;

struct CompareCommand {
  std::vector<fs::path> directories;
  sweep::CompareOptions compare;
  bool label_given = false;
  std::optional<fs::path> output, page;
  bool json = false;
};

std::vector<sweep::Comparison> comparisons_of(const CompareCommand& options,
                                              const std::vector<sweep::MergedRun>& runs) {
  const auto& directories = options.directories;
  if (directories.size() == 1)
    return sweep::compare_values(runs, options.compare, std::numeric_limits<std::size_t>::max());
  return {sweep::compare_sweeps(runs, directories[0], directories[1], options.compare)};
}

int sweep_compare(const CompareCommand& options) {
  const auto& directories = options.directories;
  if (directories.size() > 1 && options.label_given)
    throw Error(ErrorCode::usage,
                "--label: compares the runs of one sweep, expected one directory");
  if (directories.size() > 1 && same_file(directories[0], directories[1]))
    throw Error(ErrorCode::usage, fmt::format("{}: is given twice, expected two different sweeps",
                                              directories[0].string()));
  std::vector<fs::path> inputs;
  for (const auto& directory : directories) {
    inputs.push_back(sweep::plan_file(directory));
    for (auto& file : sweep::record_files(directory)) inputs.push_back(std::move(file));
  }
  std::optional<fs::path> output, page, template_file;
  if (options.output) output = output_target(*options.output, inputs);
  if (options.page) page = output_target(*options.page, inputs);
  if (page) template_file = page_template("sweep");
  const sweep::Merged merged = sweep::merge(sweep::read_sweeps_apart(directories), {"planner"});
  const auto comparisons = comparisons_of(options, merged.sweeps.runs);
  const Json document = sweep::to_json(comparisons);
  if (output) write_file_atomically(*output, document.dump(2) + "\n");
  if (page) {
    sweep::PageExtras extras;
    if (directories.size() > 1) extras.comparisons.emplace_back("Sweeps", comparisons);
    for (auto& more : sweep::comparisons_of_page(merged.sweeps))
      extras.comparisons.push_back(std::move(more));
    write_page(*template_file, report::pack(sweep::page_json(merged, extras)), *page);
  }
  for (const auto& text : merged.notes) note(text);
  if (options.json)
    print_json(document);
  else if (comparisons.empty())
    report("nothing to compare: no two values of the label have runs of the same scenes\n");
  else
    report(sweep::to_text(comparisons));
  return 0;
}

}  // namespace

void add_sweep_compare(CLI::App& sweep, int& exit_code) {
  auto* command = add_command(
      sweep, "compare",
      "Compare two sweeps, or the planners of one, by paired tests: McNemar's exact test of "
      "success, and Wilcoxon's signed-rank test of the arrival times",
      "hamelin sweep compare tries\n"
      "hamelin sweep compare before after --page compared.html\n"
      "hamelin sweep compare tries --label values --json");
  const auto options = std::make_shared<CompareCommand>();
  command
      ->add_option("directories", options->directories,
                   "two sweeps, whose runs with the same labels are paired, or one")
      ->required()
      ->type_name("DIR...")
      ->expected(1, 2);
  auto* label = command
                    ->add_option("--label", options->compare.label,
                                 "with one sweep: label whose values are compared with each other")
                    ->type_name("LABEL")
                    ->capture_default_str();
  command
      ->add_option(
          "--ignore", options->compare.ignore,
          "labels in which the runs of a pair may differ; with two sweeps also planner, if "
          "each has runs of one planner only")
      ->type_name("LABEL,LABEL")
      ->delimiter(',')
      ->allow_extra_args(false);
  command->add_option("-o,--output", options->output, "write the comparisons as JSON")
      ->type_name("COMPARISON.json");
  command->add_option("--page", options->page, "write an HTML page of both sweeps")
      ->type_name("PAGE.html");
  command->add_flag("--json", options->json, "print the comparisons as JSON");
  command->callback([options, label, &exit_code] {
    options->label_given = label->count() > 0;
    exit_code = sweep_compare(*options);
  });
}

}  // namespace hamelin::app
