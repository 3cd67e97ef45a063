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

// How often a pair was in contact in the sampled configurations.
std::string contact_frequency(const fit::PartPair& pair, int samples) {
  if (samples == 0) return "not sampled";
  if (pair.contacts == samples) return "always in contact";
  if (pair.contacts == 0) return "never in contact";
  return fmt::format("in contact in {:.3g} %", 100.0 * pair.contacts / samples);
}

void print(const fit::SelfCheck& check, const model::Robot& robot,
           const std::filesystem::path& file) {
  std::string text =
      fmt::format("{}: {}, rest pose q = [{:.4g}], {} random configurations within the limits\n",
                  file.string(), robot.name, fmt::join(check.rest_q, ", "), check.samples);
  constexpr const char* row = "{:<42} {:>9} {:>9}  {}\n";
  const auto list = [&](const std::string& title, const auto& belongs, const auto& remark) {
    bool any = false;
    for (const auto& pair : check.pairs) {
      if (!belongs(pair)) continue;
      if (!any) text += "\n" + fmt::format(row, title, "rest mm", "least mm", "");
      any = true;
      text += fmt::format(row, pair.part_a + " - " + pair.part_b,
                          fmt::format("{:.1f}", 1e3 * pair.rest_m),
                          fmt::format("{:.1f}", 1e3 * pair.least_m), remark(pair));
    }
  };
  const auto sampled = [&](const fit::PartPair& pair) {
    return contact_frequency(pair, check.samples);
  };
  list(
      "OVERLAP at rest, checked:",
      [](const fit::PartPair& p) { return p.checked && p.touches_at_rest(); }, sampled);
  list(
      "checked:",
      [](const fit::PartPair& p) { return p.checked && !p.touches_at_rest() && p.contacts > 0; },
      sampled);
  list(
      "checked, never in contact:",
      [](const fit::PartPair& p) { return p.checked && !p.touches_at_rest() && p.contacts == 0; },
      [](const fit::PartPair&) { return std::string(); });
  list(
      "not checked:", [](const fit::PartPair& p) { return !p.checked; },
      [&](const fit::PartPair& p) {
        return fmt::format("{}; {}", p.reason, contact_frequency(p, check.samples));
      });
  text += "\n";
  for (const auto& line : check.suspicious_limits) text += fmt::format("limits: {}\n", line);
  for (const auto& link : check.links_without_shapes)
    text += fmt::format("no shapes: collisions of moving link '{}' are not checked\n", link);
  text += notes_text(robot.notes, robot.warnings);
  const auto faults = check.contacts_at_rest();
  const auto checked = std::count_if(check.pairs.begin(), check.pairs.end(),
                                     [](const fit::PartPair& p) { return p.checked; });
  text += fmt::format(
      "{} of {} pairs are checked, {} of them overlap at rest: {}\n", checked, check.pairs.size(),
      faults.size(),
      faults.empty() ? coloured("clean", Colour::good) : coloured("not clean", Colour::bad));
  report(text);
}

// What was written, and the pairs in it that were checked before. One that is rarely in contact may
// be a real collision of the rest pose.
std::string written_text(const RobotCheckFlags& flags, const fit::SelfCheck& check) {
  constexpr double rare_share = 0.5;
  const auto disabled = check.disabled(flags.never);
  std::string text = fmt::format("wrote {}: {} pairs are not checked with it\n",
                                 flags.output->string(), disabled.size());
  for (const auto& pair : check.pairs) {
    const auto entry =
        std::find_if(disabled.begin(), disabled.end(), [&](const description::DisabledPair& d) {
          return d.link_a == pair.part_a && d.link_b == pair.part_b;
        });
    if (!pair.checked || entry == disabled.end()) continue;
    const bool rare = pair.touches_at_rest() && pair.contacts < rare_share * check.samples;
    text += fmt::format("  added: {} - {}: {}; {}{}\n", pair.part_a, pair.part_b, entry->reason,
                        contact_frequency(pair, check.samples),
                        rare ? "; a real collision of the rest pose? Then take the pair out of the "
                               "file, and start elsewhere"
                             : "");
  }
  return text;
}

// The list of disabled pairs as an SRDF, or in a copy of the given sidecar.
std::string list_text(const RobotCheckFlags& flags, const fit::SelfCheck& check,
                      const model::Robot& robot) {
  const auto pairs = check.disabled(flags.never);
  if (flags.output->extension() == ".srdf") return fit::srdf_text(robot.name, pairs);
  if (!flags.robot.spheres)
    throw Error(
        ErrorCode::usage,
        fmt::format(
            "--write {}: a sidecar is written as a copy of that of --spheres, which is not given; "
            "expected --spheres FILE or a name that ends in .srdf",
            flags.output->string()));
  Json document = read_json(*flags.robot.spheres);
  document["self_collision_disabled"] = Json::array();
  for (const auto& pair : pairs)
    document["self_collision_disabled"].push_back(Json::array({pair.link_a, pair.link_b}));
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
  if (flags.output) write_file_atomically(target, list_text(flags, check, robot));
  if (flags.json)
    print_json(fit::to_json(check, robot));
  else
    print(check, robot, flags.file);
  if (flags.output && !flags.json) report(written_text(flags, check));
  return check.contacts_at_rest().empty() ? 0 : 1;
}

}  // namespace

void add_robot_check(CLI::App& robot, int& exit_code) {
  auto* command = add_command(
      robot, "check",
      "Check a robot for self-collision and unusual limits. Lists overlaps at rest, and the pairs "
      "of "
      "links that are not checked with the reason; the exit code is 1 if shapes overlap at rest",
      "hamelin robot check data/robots/arm7.urdf --spheres data/robots/arm7.spheres.json\n"
      "hamelin robot check arm.urdf --spheres arm.spheres.json --srdf arm.srdf --samples 100000\n"
      "hamelin robot check arm.urdf --spheres arm.spheres.json --write arm.checked.spheres.json");
  const auto flags = std::make_shared<RobotCheckFlags>();
  command->add_option("file", flags->file, "robot file, .urdf or JSON")
      ->required()
      ->type_name("FILE");
  command->add_option("--tip", flags->robot.tip, "tip link (default for a URDF: its only leaf)")
      ->type_name("LINK");
  command
      ->add_option("--spheres", flags->robot.spheres,
                   "sidecar file with collision spheres or capsules")
      ->type_name("FILE.json");
  command->add_option("--srdf", flags->robot.srdf, "SRDF file with pairs of links that may touch")
      ->type_name("FILE.srdf");
  command->add_option("--samples", flags->check.samples, "number of random configurations")
      ->type_name("N")
      ->check(CLI::Range(0, 100'000'000))
      ->capture_default_str();
  command->add_option("--seed", flags->check.seed, "seed of the random configurations")
      ->type_name("N")
      ->check(unsigned_range())
      ->capture_default_str();
  command
      ->add_option("--write", flags->output,
                   "write the pairs to disable: an SRDF file if the name ends in .srdf, otherwise "
                   "a copy of the "
                   "--spheres file with the list")
      ->type_name("FILE");
  command->add_flag("--drop-never", flags->never,
                    "with --write: also list pairs that were never in contact");
  command->add_flag("--strict", flags->robot.strict, strict_help);
  command->add_flag("--json", flags->json, "print JSON");
  command->callback([flags, &exit_code] { exit_code = run(*flags); });
}

}  // namespace hamelin::app
