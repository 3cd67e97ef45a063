#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/log/run_log.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/scene/robot_info.hpp"
#include "robot_commands.hpp"
#include "robot_notes.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct RobotInfoOptions {
  std::filesystem::path file;
  std::optional<std::string> tip;
  std::optional<std::filesystem::path> spheres, srdf;
  bool strict = false, json = false;
};

std::string cell(const Json& value) {
  return value.is_null() ? "-" : fmt::format("{:.4g}", value.get<double>());
}

// The names of all frames, by the link that they move with.
std::string frames_text(const Json& frames) {
  std::vector<std::string> names;
  for (const auto& frame : frames) {
    const std::string name = frame["name"].get<std::string>();
    const Json& link = frame["link"];
    if (link.is_null())
      names.push_back(name + " (does not move)");
    else if (link == name)
      names.push_back(name);
    else
      names.push_back(fmt::format("{} (on {})", name, link.get<std::string>()));
  }
  return fmt::format("frames: {}\n", fmt::join(names, ", "));
}

void print_table(const Json& robot) {
  fmt::print("{}: {}, {} joints, {}, {:.4g} kg, tip '{}' on link '{}', reach at most {:.3g} m\n",
             robot["file"].get<std::string>(), robot["name"].get<std::string>(),
             robot["dof"].get<int>(),
             robot["planar"].get<bool>() ? "planar: runs in SE(2)" : "spatial: runs in SE(3)",
             robot["mass_kg"].get<double>(), robot["tip"].get<std::string>(),
             robot["tip_link"].get<std::string>(), robot["reach_m"].get<double>());
  constexpr const char* row =
      "{:<20} {:<20} {:<9} {:>9} {:>9} {:>8} {:>8} {:>8} {:>8} {:>7} {:>8}\n";
  fmt::print(row, "joint", "link", "type", "lower", "upper", "speed", "effort", "damping", "mass",
             "spheres", "capsules");
  for (const auto& link : robot["links"])
    fmt::print(row, link["joint"].get<std::string>(), link["name"].get<std::string>(),
               link["type"].get<std::string>(), cell(link["lower"]), cell(link["upper"]),
               cell(link["velocity_max"]), cell(link["effort_max"]), cell(link["damping"]),
               cell(link["mass_kg"]), link["spheres"].get<std::size_t>(),
               link["capsules"].get<std::size_t>());
  fmt::print("units: rad, m, kg, s, N, Nm; a dash means none\n");
  fmt::print("{}", frames_text(robot["frames"]));
  if (robot["spheres"] == 0 && robot["capsules"] == 0)
    fmt::print(
        "no collision spheres or capsules: collisions are not checked; add <collision><sphere> or "
        "use --spheres\n");
  fmt::print(
      "base: {} spheres, {} capsules; self-collision: {} parts, {} pairs that may not touch, {} "
      "listed as disabled\n",
      robot["base_spheres"].get<std::size_t>(), robot["base_capsules"].get<std::size_t>(),
      robot["self_collision_parts"].get<std::size_t>(),
      robot["self_collision_pairs"].get<std::size_t>(),
      robot["self_collision_disabled"].get<std::size_t>());
  fmt::print("{}", notes_text(robot["notes"], robot["warnings"]));
}

void print_robot_info(const RobotInfoOptions& options) {
  const model::Model model(description::read_robot(
      options.file, {options.tip, options.spheres, options.srdf, options.strict}));
  Json robot{{"file", options.file.string()}};
  robot.update(scene::robot_info(model));
  if (options.json)
    print_json(robot);
  else
    print_table(robot);
}

struct ChainFlags {
  model::ChainOptions chain;
  std::filesystem::path output;
  bool json = false;
};

void make_chain(const ChainFlags& flags) {
  const model::Robot robot = model::make_chain(flags.chain);
  write_file_atomically(flags.output, description::robot_to_json(robot).dump(1) + "\n");
  if (flags.json)
    print_json({{"file", flags.output.string()}, {"dof", robot.dof()}});
  else
    report(fmt::format("{}: {} joints\n", flags.output.string(), robot.dof()));
}

void add_robot_info(CLI::App& robot, int& exit_code) {
  auto* command = add_command(
      robot, "info",
      "Print the joints, limits, masses and collision shapes of a robot. Notes say what its reader "
      "lumped, locked or "
      "skipped",
      "hamelin robot info data/robots/arm7.urdf\n"
      "hamelin robot info data/robots/arm7.urdf --spheres data/robots/arm7.spheres.json --json");
  const auto options = std::make_shared<RobotInfoOptions>();
  command->add_option("file", options->file, "robot file, .urdf or JSON")
      ->required()
      ->type_name("FILE");
  command->add_option("--tip", options->tip, "tip link (default for a URDF: its only leaf)")
      ->type_name("LINK");
  command
      ->add_option("--spheres", options->spheres, "sidecar file with collision spheres or capsules")
      ->type_name("FILE");
  command->add_option("--srdf", options->srdf, "SRDF file with pairs of links that may touch")
      ->type_name("FILE.srdf");
  command->add_flag("--strict", options->strict, strict_help);
  command->add_flag("--json", options->json, "print JSON");
  command->callback([options, &exit_code] {
    print_robot_info(*options);
    exit_code = 0;
  });
}

void add_make_chain(CLI::App& robot, int& exit_code) {
  auto* command =
      add_command(robot, "make-chain", "Make a robot file of a chain of equal links along +y",
                  "hamelin robot make-chain --links 7 --axes x,z,x -o chain7.json\n"
                  "hamelin robot make-chain --links 3 --axes z --length 0.3 --mass 2 --radius 0.05 "
                  "-o planar.json");
  const auto flags = std::make_shared<ChainFlags>();
  auto& chain = flags->chain;
  command->add_option("--links", chain.links, "number of links")
      ->type_name("N")
      ->capture_default_str();
  command->add_option("--axes", chain.axes, "joint axes, one per link, repeated cyclically")
      ->type_name("x,y,z")
      ->capture_default_str();
  command->add_option("--length", chain.length_m, "length of each link [m]")
      ->type_name("L")
      ->capture_default_str();
  command->add_option("--mass", chain.mass_kg, "mass of each link [kg]")
      ->type_name("M")
      ->capture_default_str();
  command->add_option("--radius", chain.radius_m, "radius of each link [m]")
      ->type_name("R")
      ->capture_default_str();
  command->add_option("-o,--output", flags->output, "robot file to write")
      ->required()
      ->type_name("FILE");
  command->add_flag("--json", flags->json, "print a summary of the file as JSON");
  command->callback([flags, &exit_code] {
    make_chain(*flags);
    exit_code = 0;
  });
}

void add_robot(CLI::App& app, int& exit_code) {
  auto* robot = add_command(app, "robot", "Inspect, check, identify and make robots",
                            "hamelin robot fit arm.urdf -o arm.spheres.json\n"
                            "hamelin robot check arm.urdf --spheres arm.spheres.json\n"
                            "hamelin robot make-chain --links 7 --axes x,z,x -o chain7.json");
  robot->require_subcommand(1);
  add_robot_info(*robot, exit_code);
  add_robot_fit(*robot, exit_code);
  add_robot_check(*robot, exit_code);
  add_robot_identify(*robot, exit_code);
  add_make_chain(*robot, exit_code);
}

const RegisteredCommand registered_robot("robot", add_robot);

}  // namespace

}  // namespace hamelin::app
