#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/report/report.hpp"
#include "hamelin/sweep/merge.hpp"
#include "output.hpp"
#include "page.hpp"
#include "sweep.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

namespace fs = std::filesystem;

struct MergeOptions {
  std::vector<fs::path> directories;
  std::vector<std::string> by{"goal", "planner"};
  std::optional<fs::path> output, page;
  bool json = false;
};

int sweep_merge(const MergeOptions& options) {
  std::vector<fs::path> inputs;
  for (const auto& directory : options.directories) {
    inputs.push_back(sweep::plan_file(directory));
    inputs.push_back(sweep::records_file(directory));
  }
  std::optional<fs::path> output, page, template_file;
  if (options.output) output = output_target(*options.output, inputs);
  if (options.page) page = output_target(*options.page, inputs);
  if (page) template_file = page_template("sweep");
  const sweep::Merged merged = sweep::merge(options.directories, options.by);
  const Json summary = sweep::to_json(merged);
  if (output) write_file_atomically(*output, summary.dump(2) + "\n");
  if (page) write_page(*template_file, report::pack(sweep::page_json(merged)), *page);
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
                  "Summarise the records of sweeps: success with 95 % intervals, contacts, times",
                  "hamelin sweep merge tries\n"
                  "hamelin sweep merge tries more --by family,goal,planner -o summary.json\n"
                  "hamelin sweep merge tries --page tries.html --json");
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
      ->add_option("--page", options->page,
                   "write an HTML page with table, gain map and all failed runs")
      ->type_name("PAGE.html");
  command->add_flag("--json", options->json, "print the summary as JSON");
  command->callback([options, &exit_code] { exit_code = sweep_merge(*options); });
}

}  // namespace hamelin::app
