#include "hamelin/report/report.hpp"

#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "document.hpp"
#include "hamelin/core/error.hpp"
#include "output.hpp"
#include "page.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

namespace fs = std::filesystem;

struct ReportOptions {
  std::vector<fs::path> logs;
  fs::path output;
  report::Options page;
  bool json = false;
};

Json json_of(const report::RunSummary& run) {
  return {{"name", run.name},     {"log", run.log.string()}, {"outcome", run.outcome},
          {"time_s", run.time_s}, {"ticks", run.ticks},      {"frames", run.frames},
          {"notes", run.notes}};
}

// Measurements of `hamelin accuracy` have a page template of their own.
int make_accuracy_page(const ReportOptions& options, const fs::path& target) {
  const DocumentPage page = page_of(Kind::accuracy);
  if (page.make == nullptr) throw Error(ErrorCode::usage, absence_of("accuracy"));
  const fs::path template_file = page_template(page.page_template);
  const std::size_t size = write_page(template_file, page.make(options.logs), target),
                    measurements = options.logs.size();
  if (options.json)
    print_json(
        {{"page", options.output.string()}, {"bytes", size}, {"measurements", measurements}});
  else
    report(fmt::format("wrote {} ({:.2f} MB)\n", options.output.string(),
                       1e-6 * static_cast<double>(size)));
  return 0;
}

bool is_measurement(const fs::path& file) {
  return file.extension() == ".json" && kind_of(file) == Kind::accuracy;
}

int make_report(const ReportOptions& options) {
  const fs::path target = output_target(options.output, options.logs);
  if (is_measurement(options.logs.front())) return make_accuracy_page(options, target);
  const fs::path template_file = page_template("page");
  report::Data data;
  {
    const Phase phase("reading the logs");
    data = report::make_data(options.logs, options.page);
  }
  const std::size_t size = write_page(template_file, data.bytes, target);
  Json summary{{"page", options.output.string()}, {"bytes", size}, {"runs", Json::array()}};
  for (const auto& run : data.runs) {
    summary["runs"].push_back(json_of(run));
    for (const auto& text : run.notes) note(fmt::format("{}: {}", run.log.string(), text));
    if (!options.json)
      report(fmt::format("{}: {} at {:.6g} s, {} ticks, drawn at {}\n", run.name, run.outcome,
                         run.time_s, run.ticks, run.frames));
  }
  if (options.json)
    print_json(summary);
  else
    report(fmt::format("wrote {} ({:.2f} MB)\n", options.output.string(),
                       1e-6 * static_cast<double>(size)));
  return 0;
}

void add_report(CLI::App& app, int& exit_code) {
  auto* command =
      add_command(app, "report",
                  "Make an HTML page of logs that replays the arm in its map, with plots. The page "
                  "opens offline. "
                  "Measurements of `hamelin accuracy` give a page that plots speed against error",
                  "hamelin report shelf.jsonl -o shelf.html\n"
                  "hamelin report apf.jsonl gyro.jsonl hybrid.jsonl -o compared.html\n"
                  "hamelin report accuracy.json -o accuracy.html");
  const auto options = std::make_shared<ReportOptions>();
  command
      ->add_option(
          "logs", options->logs,
          "log files, plain or zstd, shown side by side; or measurements of `hamelin accuracy`")
      ->required()
      ->type_name("LOG...");
  command->add_option("-o,--output", options->output, "HTML page to write")
      ->required()
      ->type_name("PAGE.html");
  command->add_option("--frames", options->page.frames_max, "largest number of arm poses per run")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(2L, 100000L));
  command->add_flag("--json", options->json, "print a summary of the page as JSON");
  command->callback([options, &exit_code] { exit_code = make_report(*options); });
}

const RegisteredCommand registered_report("report", add_report);

}  // namespace

}  // namespace hamelin::app
