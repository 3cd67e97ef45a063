#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "command_line.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/description/srdf.hpp"
#include "hamelin/fit/self_check.hpp"
#include "hamelin/io/file.hpp"
#include "output.hpp"
#include "robot_commands.hpp"
#include "robot_notes.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct RobotCheckFlags {
  std::filesystem::path file;
  description::RobotOptions robot;
  fit::SelfCheckOptions check;
  std::optional<std::filesystem::path> output;
  bool never = false;
  bool json = false;
};

// What the sampling says of a pair.
std::string contact_words(const fit::PartPair& pair, int samples) {
  if (samples == 0) return "not sampled";
  if (pair.contacts == samples) return "always in contact";
  if (pair.contacts == 0) return "never in contact";
  return fmt::format("in contact in {:.3g} %", 100.0 * pair.contacts / samples);
}

Json describe(const fit::SelfCheck& check, const model::Robot& robot) {
  Json pairs = Json::array();
  for (const auto& pair : check.pairs)
    pairs.push_back({{"parts", {pair.part_a, pair.part_b}},
                     {"checked", pair.checked},
                     {"reason", pair.checked ? Json(nullptr) : Json(pair.reason)},
                     {"neighbours", pair.neighbours},
                     {"rest_m", pair.rest_m},
                     {"least_m", pair.least_m},
                     {"contacts", pair.contacts}});
  Json faults = Json::array();
  for (const auto& pair : check.faults())
    faults.push_back({{"parts", {pair.part_a, pair.part_b}}, {"rest_m", pair.rest_m}});
  return {{"name", robot.name},
          {"rest_q", check.rest_q},
          {"samples", check.samples},
          {"overlaps_at_rest", faults},
          {"pairs", pairs},
          {"links_without_shapes", check.shapeless},
          {"odd_limits", check.odd_limits},
          {"notes", robot.notes},
          {"warnings", model::warnings(robot)}};
}

void print(const fit::SelfCheck& check, const model::Robot& robot, const std::filesystem::path& file) {
  std::string text = fmt::format("{}: {}, at rest where q = [{:.4g}], {} random configurations within the limits\n",
                                 file.string(), robot.name, fmt::join(check.rest_q, ", "), check.samples);
  constexpr const char* row = "{:<42} {:>9} {:>9}  {}\n";
  const auto list = [&](const std::string& title, const auto& take, const auto& words) {
    bool any = false;
    for (const auto& pair : check.pairs) {
      if (!take(pair)) continue;
      if (!any) text += "\n" + fmt::format(row, title, "rest mm", "least mm", "");
      any = true;
      text += fmt::format(row, pair.part_a + " - " + pair.part_b, fmt::format("{:.1f}", 1e3 * pair.rest_m),
                          fmt::format("{:.1f}", 1e3 * pair.least_m), words(pair));
    }
  };
  const auto sampled = [&](const fit::PartPair& pair) { return contact_words(pair, check.samples); };
  list(
      "OVERLAP at rest, and checked:", [](const fit::PartPair& p) { return p.checked && p.touches_at_rest(); },
      sampled);
  list(
      "checked:", [](const fit::PartPair& p) { return p.checked && !p.touches_at_rest() && p.contacts > 0; }, sampled);
  list(
      "checked, never in contact:",
      [](const fit::PartPair& p) { return p.checked && !p.touches_at_rest() && p.contacts == 0; },
      [](const fit::PartPair&) { return std::string(); });
  list(
      "dropped:", [](const fit::PartPair& p) { return !p.checked; },
      [&](const fit::PartPair& p) { return fmt::format("{}; {}", p.reason, contact_words(p, check.samples)); });
  text += "\n";
  for (const auto& line : check.odd_limits) text += fmt::format("limits: {}\n", line);
  for (const auto& link : check.shapeless) text += fmt::format("no shapes: moving link '{}' meets nothing\n", link);
  text += notes_text(robot.notes);
  const auto faults = check.faults();
  const auto checked =
      std::count_if(check.pairs.begin(), check.pairs.end(), [](const fit::PartPair& p) { return p.checked; });
  text +=
      fmt::format("{} of {} pairs are checked, {} of them overlap at rest: {}\n", checked, check.pairs.size(),
                  faults.size(), faults.empty() ? coloured("clean", Colour::good) : coloured("not clean", Colour::bad));
  report(text);
}

// The list as an SRDF, or in a copy of the sidecar given.
std::string list_text(const RobotCheckFlags& flags, const fit::SelfCheck& check, const model::Robot& robot) {
  const auto pairs = check.disabled(flags.never);
  if (flags.output->extension() == ".srdf") return fit::srdf_text(robot.name, pairs);
  if (!flags.robot.spheres)
    throw Error(ErrorCode::usage,
                fmt::format("--write {}: a sidecar is written as a copy of the one given by --spheres, and none was "
                            "given; expected --spheres FILE or a name that ends in .srdf",
                            flags.output->string()));
  Json document = read_json(*flags.robot.spheres);
  document["self_collision_disabled"] = Json::array();
  for (const auto& pair : pairs) document["self_collision_disabled"].push_back(Json::array({pair.link_a, pair.link_b}));
  return document.dump(1) + "\n";
}

int run(const RobotCheckFlags& flags) {
  std::filesystem::path target;
  if (flags.output) {
    std::vector<std::filesystem::path> inputs = {flags.file};
    if (flags.robot.spheres) inputs.push_back(*flags.robot.spheres);
    if (flags.robot.srdf) inputs.push_back(*flags.robot.srdf);
    target = output_target(*flags.output, inputs);
  }
  const model::Robot robot = description::read_robot(flags.file, flags.robot);
  std::vector<description::DisabledPair> listed;
  if (flags.robot.srdf) listed = description::read_srdf(*flags.robot.srdf);
  const fit::SelfCheck check = fit::check_self(robot, listed, flags.check);
  if (flags.output) write_file_aside(target, list_text(flags, check, robot));
  if (flags.json)
    print_json(describe(check, robot));
  else
    print(check, robot, flags.file);
  return check.faults().empty() ? 0 : 1;
}

}  // namespace

void add_robot_check(CLI::App& robot, int& exit_code) {
  auto* command =
      add_command(robot, "check",
                  "Overlaps at rest, pairs that self-collision drops and why, odd limits; exit code 1 for an overlap",
                  "hamelin robot check data/robots/arm7.urdf --spheres data/robots/arm7.spheres.json\n"
                  "hamelin robot check arm.urdf --spheres arm.spheres.json --srdf arm.srdf --samples 100000\n"
                  "hamelin robot check arm.urdf --spheres arm.spheres.json --write arm.checked.spheres.json");
  const auto flags = std::make_shared<RobotCheckFlags>();
  command->add_option("file", flags->file, "a robot, .urdf or JSON")->required()->type_name("FILE");
  command->add_option("--tip", flags->robot.tip, "link that is the tip (URDF: default the only leaf)")
      ->type_name("LINK");
  command->add_option("--spheres", flags->robot.spheres, "sidecar file with collision spheres or capsules")
      ->type_name("FILE.json");
  command->add_option("--srdf", flags->robot.srdf, "SRDF whose disabled pairs count as listed")->type_name("FILE.srdf");
  command->add_option("--samples", flags->check.samples, "random configurations")
      ->type_name("N")
      ->check(CLI::Range(0, 100'000'000))
      ->capture_default_str();
  command->add_option("--seed", flags->check.seed, "of the random configurations")
      ->type_name("N")
      ->check(whole_number())
      ->capture_default_str();
  command
      ->add_option("--write", flags->output,
                   "write what should be disabled: an SRDF, or a copy of the sidecar given with the list in it")
      ->type_name("FILE");
  command->add_flag("--drop-never", flags->never, "--write also lists pairs that were never in contact");
  command->add_flag("--strict", flags->robot.strict, strict_help);
  command->add_flag("--json", flags->json, "print JSON");
  command->callback([flags, &exit_code] { exit_code = run(*flags); });
}

}  // namespace hamelin::app
