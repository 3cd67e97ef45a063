#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>

#include "command_line.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/description/srdf.hpp"
#include "hamelin/description/urdf_geometry.hpp"
#include "hamelin/fit/robot_fit.hpp"
#include "hamelin/fit/self_pairs.hpp"
#include "hamelin/io/file.hpp"
#include "output.hpp"
#include "robot_commands.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct RobotFitFlags {
  std::filesystem::path file;
  std::optional<std::filesystem::path> output, srdf, compare;
  std::optional<std::string> tip;
  fit::FitOptions fit;
  fit::SelfCheckOptions check;
  std::vector<std::string> packages;
  bool json = false;
};

void check_flags(RobotFitFlags& flags) {
  const auto check_length = [](const char* option, double value, bool zero_allowed) {
    if (!(value > 0.0 || (zero_allowed && value == 0.0)) || value > 10.0)
      throw Error(ErrorCode::usage,
                  fmt::format("{}: {} m, expected a length {} 0 and at most 10 m", option, value,
                              zero_allowed ? "of at least" : "above"));
  };
  check_length("--excess", flags.fit.cover.excess_m, false);
  check_length("--padding", flags.fit.padding_m, true);
  check_length("--tolerance", flags.fit.tolerance_m, false);
  for (const std::string& package : flags.packages) {
    const auto at = package.find('=');
    if (at == std::string::npos || at == 0 || at + 1 == package.size())
      throw Error(ErrorCode::usage, fmt::format("--package: '{}', expected NAME=DIR", package));
    flags.fit.meshes.packages.emplace_back(package.substr(0, at), package.substr(at + 1));
  }
  if (!flags.output && !flags.compare)
    throw Error(ErrorCode::usage,
                "robot fit: no output, expected -o OUT.spheres.json (or --compare FILE)");
}

std::string millimetres(double metres) {
  return std::isfinite(metres) ? fmt::format("{:.3g}", 1e3 * metres) : "all";
}

void print_table(const fit::RobotFit& fit, const std::string& title) {
  constexpr const char* row = "{:<24} {:>9} {:>7} {:>8} {:>10} {:>10} {:>10} {:>7}\n";
  std::string text = fmt::format("{}\n", title);
  const auto rounded = [](double value) { return fmt::format("{:.1f}", 1e3 * value); };
  text += fmt::format(row, "link", "triangles", "spheres", "capsules", "gap mm", "excess mm",
                      "mean mm", "volume");
  std::size_t balls = 0, triangles = 0;
  for (const auto& link : fit.links) {
    const auto n = static_cast<std::size_t>(std::count_if(
        link.shapes.begin(), link.shapes.end(), [](const fit::Shape& s) { return s.ball(); }));
    balls += n;
    triangles += link.triangles;
    text += fmt::format(row, link.name, link.triangles, n, link.shapes.size() - n,
                        millimetres(link.gap.bound_m), rounded(link.excess.max_m),
                        rounded(link.excess.mean_m),
                        fmt::format("{:.2f}", link.excess.volume_m3 / link.volume_m3));
  }
  text += fmt::format(row, "total", triangles, balls, fit.shapes() - balls,
                      millimetres(fit.gap_bound_m()), rounded(fit.excess_max_m()),
                      rounded(fit.excess_mean_m()), fmt::format("{:.2f}", fit.volume_ratio()));
  text += "gap: proven bound on how far the geometry sticks out of the shapes;\n";
  text +=
      "excess: how far the shapes stick out of the geometry; volume: of the shapes over that of "
      "the geometry\n";
  for (const auto& note : fit.notes) text += fmt::format("note: {}\n", note);
  report(text);
}

std::string describe(const fit::SelfPairs& self, int samples) {
  const auto count = [&](const char* reason) {
    return std::count_if(self.pairs.begin(), self.pairs.end(),
                         [&](const auto& pair) { return pair.reason == reason; });
  };
  std::string text = fmt::format(
      "self-collision: {} pairs of links never count as colliding: {} adjacent, {} in contact in "
      "at least {:.0f} % of "
      "{} random configurations, {} at rest",
      self.pairs.size(), count("Adjacent"), count("Always"), 100.0 * fit::always_share_min, samples,
      count("Default"));
  if (const auto given = count("SRDF"); given > 0) text += fmt::format(", {} of the SRDF", given);
  text += "\n";
  for (const auto& pair : self.pairs)
    text += fmt::format("  {} - {}: {}\n", pair.link_a, pair.link_b, pair.reason);
  for (const auto& note : self.notes) text += fmt::format("note: {}\n", note);
  return text;
}

Json to_json(const fit::SelfPairs& self, int samples) {
  Json pairs = Json::array();
  for (const auto& pair : self.pairs)
    pairs.push_back({{"links", {pair.link_a, pair.link_b}}, {"reason", pair.reason}});
  return {{"samples", samples}, {"pairs", pairs}, {"notes", self.notes}};
}

void compare(const RobotFitFlags& flags, Json& out) {
  const Phase phase("measuring the given shapes");
  const fit::RobotFit given = fit::measure_sidecar(flags.file, *flags.compare, flags.fit);
  if (flags.json)
    out["compare"] = fit::figures_json(given);
  else
    print_table(given, fmt::format("{}: {} given shapes", flags.compare->string(), given.shapes()));
}

void make_sidecar(const RobotFitFlags& flags, const std::filesystem::path& target, Json& out) {
  const fit::RobotFit fitted = [&] {
    const Phase phase("fitting");
    return fit::fit_robot(flags.file, flags.fit);
  }();
  const fit::SelfPairs self = [&] {
    const Phase phase("searching for pairs that always touch");
    return fit::sidecar_pairs(flags.file, fitted, flags.srdf, flags.tip, flags.check);
  }();
  const std::string note = fit::sidecar_note(fitted, flags.file, flags.fit.cover.capsules);
  write_file_atomically(target, fit::sidecar_json(fitted, note, self.names()).dump(1) + "\n");
  if (flags.json) {
    out["file"] = flags.output->string();
    out["fit"] = fit::figures_json(fitted);
    out["self_collision"] = to_json(self, flags.check.samples);
    return;
  }
  print_table(fitted, fmt::format("{}: {} shapes fitted", flags.output->string(), fitted.shapes()));
  report(describe(self, flags.check.samples));
}

void run(RobotFitFlags& flags) {
  check_flags(flags);
  std::filesystem::path target;
  if (flags.output) {
    std::vector<std::filesystem::path> inputs = {flags.file};
    if (flags.srdf) inputs.push_back(*flags.srdf);
    if (flags.compare) inputs.push_back(*flags.compare);
    target = output_target(*flags.output, inputs);
  }
  Json out{{"robot", flags.file.string()}};
  if (flags.compare) compare(flags, out);
  if (flags.output) make_sidecar(flags, target, out);
  if (flags.json) print_json(out);
}

void add_shape_options(CLI::App& command, RobotFitFlags& flags) {
  auto& fit = flags.fit;
  command
      .add_option("--excess", fit.cover.excess_m,
                  "largest distance by which a shape may stick out [m]")
      ->type_name("M")
      ->capture_default_str();
  command
      .add_option("--total", fit.total,
                  "largest number of shapes in total; sets --excess to the least possible")
      ->type_name("N")
      ->check(CLI::Range(1, 100'000));
  command
      .add_option("--spheres-per-link", fit.cover.count_max,
                  "largest number of shapes per link, even if they stick out farther")
      ->type_name("N")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command.add_flag("--capsules", fit.cover.capsules, "fit capsules instead of spheres");
  command.add_option("--padding", fit.padding_m, "length added to each radius [m]")
      ->type_name("M")
      ->capture_default_str();
}

void add_mesh_options(CLI::App& command, RobotFitFlags& flags) {
  auto& fit = flags.fit;
  command
      .add_option("--package", flags.packages,
                  "folder of a ROS package that mesh paths name; may be repeated")
      ->type_name("NAME=DIR")
      ->allow_extra_args(false);
  command
      .add_option("--meshes", fit.meshes.folders,
                  "folder to search for meshes, by their path and by shorter and shorter ends of "
                  "it; may be repeated")
      ->type_name("DIR")
      ->allow_extra_args(false);
  command.add_flag("--visual", fit.visual, "use <visual> of links without <collision>");
}

}  // namespace

void add_robot_fit(CLI::App& robot, int& exit_code) {
  auto* command = add_command(
      robot, "fit",
      "Make collision spheres or capsules that cover a URDF's collision geometry, measure them, "
      "and list the pairs of "
      "links that always touch",
      "hamelin robot fit arm.urdf --package arm_description=~/arm --total 50 -o arm.spheres.json\n"
      "hamelin robot fit arm.urdf --capsules --excess 0.03 --srdf arm.srdf -o arm.capsules.json\n"
      "hamelin robot fit arm.urdf --meshes meshes --compare by_hand.spheres.json --json");
  const auto flags = std::make_shared<RobotFitFlags>();
  command->add_option("file", flags->file, "robot file, .urdf")->required()->type_name("FILE.urdf");
  command
      ->add_option("-o,--output", flags->output,
                   "sidecar file to write, for --spheres and a scene's robot.spheres")
      ->type_name("FILE.json");
  add_shape_options(*command, *flags);
  add_mesh_options(*command, *flags);
  command->add_option("--srdf", flags->srdf, "SRDF file whose disabled pairs the sidecar lists too")
      ->type_name("FILE.srdf");
  command
      ->add_option("--tip", flags->tip,
                   "tip link, to find the pairs that always touch (default every leaf)")
      ->type_name("LINK");
  command
      ->add_option("--compare", flags->compare,
                   "also measure this sidecar against the geometry; -o is then optional")
      ->type_name("FILE.json");
  command->add_option("--tolerance", flags->fit.tolerance_m, "accuracy of the bound on a gap [m]")
      ->type_name("M")
      ->capture_default_str();
  command->add_flag("--json", flags->json, "print the figures as JSON");
  command->callback([flags, &exit_code] {
    run(*flags);
    exit_code = 0;
  });
}

}  // namespace hamelin::app
