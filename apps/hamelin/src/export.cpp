#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/log/trajectory.hpp"
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

int export_motion(const ExportOptions& options) {
  std::filesystem::path target;
  if (options.output) target = output_target(*options.output, {options.file});
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

}  // namespace

void add_export(CLI::App& app, int& exit_code) {
  auto* command =
      add_command(app, "export", "Write the motion in a log as CSV or as a ROS 2 JointTrajectory",
                  "hamelin export shelf.jsonl -o shelf.csv\n"
                  "hamelin export shelf.jsonl --format ros --rate 100 -o shelf-trajectory.json");
  const auto options = std::make_shared<ExportOptions>();
  command->add_option("log", options->file, "log file, plain or zstd")
      ->required()
      ->type_name("LOG");
  restrict_values(
      command
          ->add_option("--format", options->format,
                       "csv, or ros for the fields of trajectory_msgs/msg/JointTrajectory")
          ->type_name("NAME")
          ->capture_default_str(),
      {"csv", "ros"});
  command
      ->add_option("--rate", options->rate_hz,
                   "interpolate to this number of points per second (default: every logged tick)")
      ->type_name("HZ");
  command->add_option("-o,--output", options->output, "file to write (default: standard output)")
      ->type_name("FILE");
  command->callback([options, &exit_code] { exit_code = export_motion(*options); });
}

}  // namespace hamelin::app
