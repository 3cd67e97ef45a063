#include <fmt/format.h>
#include <unistd.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/atomic_file.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/log/trajectory.hpp"
#include "hamelin/mcap/export.hpp"
#include "output.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct ExportOptions {
  std::filesystem::path file;
  std::string format = "csv";
  std::optional<double> rate_hz;
  std::optional<std::filesystem::path> output;
};

int export_motion(const ExportOptions& options, const std::filesystem::path& target) {
  log::Trajectory trajectory = log::read_trajectory(options.file);
  if (options.rate_hz) trajectory = log::resampled(trajectory, *options.rate_hz);
  const std::string text = options.format == "csv"
                               ? log::to_csv(trajectory)
                               : log::to_joint_trajectory(trajectory).dump(1) + "\n";
  if (!options.output) {
    fmt::print("{}", text);
    return 0;
  }
  write_file_atomically(target, text);
  const auto& points = trajectory.points;
  note(fmt::format("{}: {} points, {} joints, {:.6g} s", options.output->string(), points.size(),
                   trajectory.joints.size(), points.back().time_s - points.front().time_s));
  return 0;
}

// Standard output gets all bytes at the end, so that nothing is written if the log is refused.
mcap::ExportSummary write_mcap(const ExportOptions& options, const std::filesystem::path& target) {
  if (!options.output) {
    std::string bytes;
    auto summary = mcap::export_log(options.file, options.rate_hz,
                                    [&](std::string_view more) { bytes += more; });
    fmt::print("{}", bytes);
    return summary;
  }
  AtomicFile file(target);
  auto summary = mcap::export_log(options.file, options.rate_hz,
                                  [&](std::string_view more) { file.append(more); });
  file.commit();
  return summary;
}

int export_mcap(const ExportOptions& options, const std::filesystem::path& target) {
  if (!options.output && ::isatty(STDOUT_FILENO) != 0)
    throw Error(
        ErrorCode::usage,
        "--format mcap: is binary and standard output is a terminal, expected --output FILE");
  const mcap::ExportSummary summary = write_mcap(options, target);
  for (const std::string& text : summary.notes) note(text);
  if (options.output)
    note(fmt::format("{}: {} samples, {} messages, {:.6g} s", options.output->string(),
                     summary.samples, summary.messages, summary.end_s - summary.begin_s));
  return 0;
}

int export_log(const ExportOptions& options) {
  std::filesystem::path target;
  if (options.output) target = output_target(*options.output, {options.file});
  return options.format == "mcap" ? export_mcap(options, target) : export_motion(options, target);
}

void add_export(CLI::App& app, int& exit_code) {
  auto* command =
      add_command(app, "export", "Write the motion in a log as CSV, ROS 2 JointTrajectory or MCAP",
                  "hamelin export shelf.jsonl -o shelf.csv\n"
                  "hamelin export shelf.jsonl --format ros --rate 100 -o shelf-trajectory.json\n"
                  "hamelin export shelf.jsonl --format mcap --rate 50 -o shelf.mcap");
  const auto options = std::make_shared<ExportOptions>();
  command->add_option("log", options->file, "log file, plain or zstd")
      ->required()
      ->type_name("LOG");
  restrict_values(
      command
          ->add_option("--format", options->format,
                       "csv; ros for the fields of trajectory_msgs/msg/JointTrajectory; mcap for "
                       "viewers such as Foxglove, with the arm, its map, obstacles and goals")
          ->type_name("NAME")
          ->capture_default_str(),
      {"csv", "ros", "mcap"});
  command
      ->add_option("--rate", options->rate_hz,
                   "interpolate to this number of points per second (default: every logged tick)")
      ->type_name("HZ");
  command->add_option("-o,--output", options->output, "file to write (default: standard output)")
      ->type_name("FILE");
  command->callback([options, &exit_code] { exit_code = export_log(*options); });
}

const RegisteredCommand registered_export("export", add_export);

}  // namespace

}  // namespace hamelin::app
