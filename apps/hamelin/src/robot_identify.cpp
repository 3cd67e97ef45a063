#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "command_line.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/identification/identify.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/log/trajectory.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/simulation/replay.hpp"
#include "output.hpp"
#include "robot_commands.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

namespace fs = std::filesystem;
using identification::Identification;
using identification::Record;
using identification::TorqueTiming;

struct IdentifyFlags {
  fs::path log;
  std::optional<fs::path> robot, spheres, test, output;
  std::optional<std::string> tip, gravity;
  std::string torque = "auto";
  std::optional<double> window_s, friction_speed;
  long every = 1;
  bool json = false;
};

/// A motion that was recorded, and the robot where it happened.
struct Motion {
  model::Model model;
  Record record;
};

bool is_table(const fs::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension == ".csv";
}

// The robot of a log's header, unless --robot names another.
model::Model model_of_log(const IdentifyFlags& flags, const fs::path& file) {
  const log::TickReader reader(file);
  simulation::Recorded recorded = simulation::read_header(reader.header(), file);
  scene::RobotRef& robot = recorded.scene.robot;
  if (flags.robot) {
    robot = {*flags.robot, flags.tip, flags.spheres, std::nullopt};
  } else {
    for (const auto& changed : recorded.changed)
      if (changed.role == "robot" || changed.role == "spheres" || changed.role == "srdf")
        throw Error(ErrorCode::invalid, changed.text + "; --robot names another file");
    if (flags.tip) robot.tip = flags.tip;
    if (flags.spheres) robot.spheres = flags.spheres;
  }
  recorded.scene.model.payload.reset();  // the reader of the log refuses it
  return control::load_model(recorded.scene);
}

model::Model model_of_table(const IdentifyFlags& flags, const fs::path& file) {
  if (!flags.robot)
    throw Error(ErrorCode::usage,
                fmt::format("--robot: is missing, expected the robot of {}", file.string()));
  Eigen::Vector3d gravity(0.0, 0.0, -9.81);
  if (flags.gravity) {
    const std::vector<double> numbers = number_list("--gravity", *flags.gravity, 3);
    gravity = Eigen::Vector3d(numbers[0], numbers[1], numbers[2]);
  }
  return model::Model(description::read_robot(*flags.robot, {flags.tip, flags.spheres}), {},
                      gravity);
}

Motion read_motion(const IdentifyFlags& flags, const fs::path& file, TorqueTiming timing) {
  const Phase phase("reading " + file.string());
  if (is_table(file)) {
    model::Model model = model_of_table(flags, file);
    Record record = identification::read_csv(file, model.robot(), timing, flags.every);
    return {std::move(model), std::move(record)};
  }
  model::Model model = model_of_log(flags, file);
  Record record = identification::read_log(file, model.robot(), flags.every);
  return {std::move(model), std::move(record)};
}

identification::Options options_of(const IdentifyFlags& flags, const Record& record) {
  identification::Options options;
  options.windows.window_s = flags.window_s;
  options.windows.friction_speed =
      flags.friction_speed.value_or(record.friction_speed.value_or(scene::default_friction_speed));
  return options;
}

/// An identification, and how the torques of a table were read for it.
struct Found {
  Identification result;
  std::optional<TorqueTiming> timing;  ///< none: a log says it
};

Found identify(const IdentifyFlags& flags) {
  const auto with = [&](TorqueTiming timing) {
    const Motion motion = read_motion(flags, flags.log, timing);
    const Phase phase("identifying");
    return identification::identify(motion.model, motion.record, options_of(flags, motion.record));
  };
  if (!is_table(flags.log)) return {with(TorqueTiming::held), std::nullopt};
  if (flags.torque == "held") return {with(TorqueTiming::held), TorqueTiming::held};
  if (flags.torque == "sampled") return {with(TorqueTiming::sampled), TorqueTiming::sampled};
  // The likelihood of both readings differs by the residuals only.
  Identification held = with(TorqueTiming::held), sampled = with(TorqueTiming::sampled);
  const auto size = [](const Identification& one) { return one.fit.sigma.array().log().sum(); };
  if (size(held) <= size(sampled)) return {std::move(held), TorqueTiming::held};
  return {std::move(sampled), TorqueTiming::sampled};
}

void check_flags(const IdentifyFlags& flags) {
  if (is_table(flags.log) || (flags.test && is_table(*flags.test))) return;
  const auto refuse = [](const char* option) {
    throw Error(
        ErrorCode::usage,
        fmt::format("{}: is for tables, expected none with a log, which states it", option));
  };
  if (flags.gravity) refuse("--gravity");
  if (flags.torque != "auto") refuse("--torque");
}

std::string_view name_of(TorqueTiming timing) {
  return timing == TorqueTiming::held ? "held" : "sampled";
}

void identify_robot(const IdentifyFlags& flags) {
  check_flags(flags);
  std::vector<fs::path> inputs{flags.log};
  for (const auto& file : {flags.robot, flags.spheres, flags.test})
    if (file) inputs.push_back(*file);
  fs::path target;
  if (flags.output) target = output_target(*flags.output, inputs);
  const Found found = identify(flags);
  std::optional<identification::TorqueErrors> test;
  if (flags.test) {
    const TorqueTiming timing = flags.torque == "sampled" ? TorqueTiming::sampled
                                : flags.torque == "held"
                                    ? TorqueTiming::held
                                    : found.timing.value_or(TorqueTiming::held);
    const Motion motion = read_motion(flags, *flags.test, timing);
    test = identification::test(motion.model, found.result, motion.record,
                                options_of(flags, motion.record).windows);
  }
  if (flags.output)
    write_file_atomically(target, description::robot_to_json(found.result.robot).dump(1) + "\n");
  if (flags.json) {
    Json out{{"log", flags.log.string()}};
    out["torque_timing"] = found.timing ? Json(name_of(*found.timing)) : Json(nullptr);
    out.update(identification::to_json(found.result, test));
    return print_json(out);
  }
  std::string text = identification::to_table(found.result, test);
  if (found.timing)
    text += fmt::format("torques of the table: read as {}\n", name_of(*found.timing));
  if (flags.output)
    text += fmt::format("{}: robot '{}' with what was identified\n", flags.output->string(),
                        found.result.robot.name);
  report(text);
}

void add_robot_options(CLI::App& command, IdentifyFlags& flags) {
  command
      .add_option("--robot", flags.robot,
                  "robot with approximate masses and inertias, .urdf or JSON (default: that of the "
                  "log)")
      ->type_name("FILE");
  command.add_option("--tip", flags.tip, "tip link, if a URDF has several leaves")
      ->type_name("LINK");
  command
      .add_option("--spheres", flags.spheres,
                  "sidecar file with collision spheres or capsules, to be part of -o")
      ->type_name("FILE");
  command
      .add_option("--gravity", flags.gravity,
                  "with a table: acceleration of free fall in the robot's base frame [m/s^2] "
                  "(default 0,0,-9.81)")
      ->type_name("X,Y,Z");
}

}  // namespace

void add_robot_identify(CLI::App& robot, int& exit_code) {
  auto* command = add_command(
      robot, "identify",
      "Identify masses, centres of mass, inertias, damping and dry friction of an arm from a log "
      "of "
      "its positions and motor torques, and check them on a part of the motion that was not fitted",
      "hamelin robot identify run.jsonl.zst -o identified.json\n"
      "hamelin robot identify motion.csv --robot arm.urdf --test other.csv -o identified.json\n"
      "hamelin robot identify motion.csv --robot arm.urdf --gravity 0,-9.81,0 --json");
  const auto flags = std::make_shared<IdentifyFlags>();
  command
      ->add_option(
          "log", flags->log,
          "log file, plain or zstd, or a table .csv with time_s, and q_JOINT and tau_JOINT "
          "of each joint")
      ->required()
      ->type_name("LOG");
  add_robot_options(*command, *flags);
  command
      ->add_option("--test", flags->test,
                   "also print the torque error on this log of another motion")
      ->type_name("LOG2");
  command
      ->add_option("-o,--output", flags->output,
                   "robot file to write, with what was identified; for scenes in place of the "
                   "robot's and the sidecar's files")
      ->type_name("FILE.json");
  command->add_option("--every", flags->every, "use every K-th tick")
      ->type_name("K")
      ->check(CLI::Range(1L, 1'000'000L))
      ->capture_default_str();
  command
      ->add_option(
          "--window", flags->window_s,
          "time over which the equations of motion are averaged [s] (default: 0.1, more if "
          "the positions are noisy)")
      ->type_name("S");
  command
      ->add_option(
          "--friction-speed", flags->friction_speed,
          "speed below which dry friction becomes viscous [rad/s or m/s] (default: that of "
          "the log, otherwise 0.01)")
      ->type_name("V");
  restrict_values(
      command
          ->add_option("--torque", flags->torque,
                       "with a table: held if each torque acts up to the next tick, sampled if it "
                       "was measured at its tick; auto takes what fits better")
          ->type_name("NAME")
          ->capture_default_str(),
      {"auto", "held", "sampled"});
  command->add_flag("--json", flags->json, "print the figures as JSON");
  command->callback([flags, &exit_code] {
    identify_robot(*flags);
    exit_code = 0;
  });
}

}  // namespace hamelin::app
