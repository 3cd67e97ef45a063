#include "hamelin/simulation/explain.hpp"

#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "document.hpp"
#include "hamelin/core/error.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

using simulation::Avoidability;
using simulation::Evasion;
using simulation::Explanation;

struct ExplainCommand {
  std::filesystem::path file;
  simulation::ExplainOptions search;
  bool json = false;
};

std::string speed_text(const Json& speed) {
  return speed.is_null() ? "not finite" : fmt::format("{:.3g} m/s", speed.get<double>());
}

std::string contact_text(const Json& contact) {
  std::string text = fmt::format(
      "{:<12}at {:.6g} s, link '{}' with obstacle '{}'\n"
      "{:<12}arm {}, obstacle {}, towards each other {}\n",
      "contact", contact["time_s"].get<double>(), contact["link"].get<std::string>(),
      contact["obstacle"].get<std::string>(), "speeds", speed_text(contact["arm_speed_m_s"]),
      speed_text(contact["obstacle_speed_m_s"]), speed_text(contact["closing_speed_m_s"]));
  text += fmt::format("{:<12}{}", "prediction", contact["prediction"].get<std::string>());
  for (const auto& error : contact["prediction_errors"])
    if (!error["error_m"].is_null())
      text += fmt::format(", wrong by {:.3g} m {:g} s before", error["error_m"].get<double>(),
                          error["ahead_s"].get<double>());
  return text + "\n";
}

std::string motion_text(const Evasion& evasion) {
  const Eigen::VectorXd end = evasion.end();
  std::string text;
  for (const double q : end) text += fmt::format("{}{:.3f}", text.empty() ? "" : ", ", q);
  switch (evasion.kind) {
    case Evasion::Kind::stop:
      text = "by stopping at q = (" + text;
      break;
    case Evasion::Kind::back:
      text = "by moving back to q = (" + text;
      break;
    case Evasion::Kind::aside:
      text = "by moving aside to q = (" + text;
      break;
  }
  return fmt::format("{}) in {:.3g} s", text, evasion.duration_s);
}

std::string found_text(const Explanation::Found& found, double contact_s) {
  std::string then = "the obstacle was not known then";
  if (found.known)
    then = fmt::format("as predicted then, this motion {}, that of the arm {}",
                       found.looked_clear ? "was clear" : "was not clear",
                       found.contact_predicted ? "was not" : "was clear");
  return fmt::format("until {:.3g} s before the contact, {}\n{:<12}{}\n",
                     contact_s - found.evasion.start_s, motion_text(found.evasion), "", then);
}

std::string search_text(const Explanation::Search& search) {
  if (search.starts == 0)
    return "no start: the obstacle appeared at the contact, or no state before it is logged";
  return fmt::format("{} motions from {} states, from {:.6g} s back to {:.6g} s, seed {}",
                     search.motions, search.starts, search.last_s, search.first_s, search.seed);
}

std::string verdict_text(const Explanation& explanation) {
  switch (explanation.verdict) {
    case Avoidability::avoidable:
      return coloured("avoidable", Colour::bad) + ", with what was known";
    case Avoidability::avoidable_in_hindsight:
      return coloured("avoidable_in_hindsight", Colour::fair) +
             ": only if the obstacle's true motion had been known";
    case Avoidability::unavoidable:
      break;
  }
  if (explanation.search.starts == 0)
    return coloured("unavoidable", Colour::fair) + ": no time to move";
  return coloured("unavoidable", Colour::fair) +
         fmt::format(": none of {} motions that were tried", explanation.search.motions);
}

std::string acts_text(const char* name, const std::vector<Explanation::Act>& acts) {
  std::string text;
  for (const auto& act : acts)
    text += fmt::format("{:<12}{}{} from {:.6g} s to {:.6g} s\n", text.empty() ? name : "",
                        act.what, act.evades ? " (evades)" : "", act.from_s, act.to_s);
  return text;
}

std::string explanation_text(const Explanation& explanation) {
  const double contact_s = explanation.contact["time_s"].get<double>();
  std::string text = fmt::format("{:<12}{}\n", "verdict", verdict_text(explanation));
  text += contact_text(explanation.contact);
  text += fmt::format("{:<12}{}\n", "known",
                      explanation.known_since_s
                          ? fmt::format("since {:.6g} s", *explanation.known_since_s)
                          : "never");
  if (explanation.latest)
    text += fmt::format("{:<12}{}", "evasion", found_text(*explanation.latest, contact_s));
  if (const auto& foreseen = explanation.latest_foreseen;
      foreseen && foreseen->evasion.way != explanation.latest->evasion.way)
    text += fmt::format("{:<12}{}", "foreseen", found_text(*foreseen, contact_s));
  text += acts_text("stops", explanation.stops);
  text += acts_text("planner", explanation.planner_acts);
  return text + fmt::format("{:<12}{}\n", "search", search_text(explanation.search));
}

int explain(const ExplainCommand& command) {
  if (const Kind kind = kind_of(command.file); kind != Kind::log)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: is a {}, expected a log", command.file.string(), to_string(kind)));
  Explanation explanation;
  {
    Progress progress("starts searched");
    simulation::ExplainOptions options = command.search;
    options.progress = [&progress](double done, double all) { progress.show(done, all); };
    explanation = simulation::explain(command.file, options);
  }
  for (const auto& text : explanation.notes)
    note(fmt::format("{}: {}", command.file.string(), text));
  if (command.json)
    print_json(simulation::to_json(explanation));
  else if (!explanation.nothing.empty())
    report(fmt::format("{}: nothing to explain: {}\n", command.file.string(), explanation.nothing));
  else
    report(explanation_text(explanation));
  return 0;
}

void add_explain(CLI::App& app, int& exit_code) {
  auto* command = add_command(
      app, "explain",
      "Search whether the arm could have avoided the moving obstacle that it touched at the end of "
      "a run, until when, and by which motion. The verdict is avoidable, avoidable_in_hindsight "
      "(not with what was known of the obstacle), or unavoidable (by none of the motions that were "
      "tried). The exit code is 0 also if there is no such contact",
      "hamelin explain run.jsonl\n"
      "hamelin explain run.jsonl.zst --motions 10000 --json");
  const auto options = std::make_shared<ExplainCommand>();
  command->add_option("log", options->file, "log file, plain or zstd")
      ->required()
      ->type_name("LOG");
  command
      ->add_option("--motions", options->search.motions,
                   "number of motions to try from each state before the contact")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000000));
  command->add_option("--seed", options->search.seed, "seed of the random motions")
      ->type_name("SEED")
      ->capture_default_str()
      ->check(unsigned_range());
  command->add_flag("--json", options->json, "print JSON");
  command->callback([options, &exit_code] { exit_code = explain(*options); });
}

const RegisteredCommand registered_explain("explain", add_explain);

}  // namespace

}  // namespace hamelin::app
