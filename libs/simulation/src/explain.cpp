#include "hamelin/simulation/explain.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "evasion_search.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/scene/modelled.hpp"
#include "hamelin/simulation/replay.hpp"
#include "recorder.hpp"

namespace hamelin::simulation {

namespace {

constexpr double last_acts_s = 1.0;

// What a log says beside the motion.
struct LoggedRun {
  Json header, result;
  std::vector<Explanation::Act> stops, planner_acts;
};

void extend(std::vector<Explanation::Act>& acts, Explanation::Act act, double before_s) {
  const bool same = !acts.empty() && acts.back().what == act.what &&
                    acts.back().evades == act.evades && acts.back().to_s == before_s;
  if (same)
    acts.back().to_s = act.to_s;
  else
    acts.push_back(std::move(act));
}

// The index of the planner's series of this name.
std::optional<std::size_t> series_index(const Json& header, std::string_view name) {
  const Json series = header.value("series", Json::array());
  for (std::size_t i = 0; i < series.size(); ++i)
    if (series[i]["name"] == name) return i;
  return std::nullopt;
}

LoggedRun read_acts(const std::filesystem::path& log) {
  log::LogReader reader(log);
  LoggedRun run;
  std::optional<std::size_t> evasion;
  double before_s = 0.0;
  for (Json line; reader.next(line);) {
    if (line["type"] == "header") {
      evasion = series_index(line, "evasion");
      run.header = std::move(line);
    } else if (line["type"] == "result") {
      run.result = std::move(line);
    } else if (line["type"] == "tick") {
      const double time_s = line["time_s"].get<double>();
      if (line.contains("stop"))
        extend(run.stops,
               {line["stop"]["cause"].get<std::string>(), line["stop"].value("evades", false),
                time_s, time_s},
               before_s);
      if (evasion && line.contains("series") && line["series"].size() > *evasion &&
          line["series"][*evasion].is_number())
        extend(run.planner_acts,
               {fmt::format("{:g}", line["series"][*evasion].get<double>()), false, time_s, time_s},
               before_s);
      before_s = time_s;
    }
  }
  return run;
}

// Why there is nothing to explain; empty if there is a contact.
std::string reason_for_nothing(const LoggedRun& run) {
  if (run.header["program"] != "run") return "the log is one of free motion";
  if (run.result.is_null()) return "the log has no result, because the run was not finished";
  if (run.result.contains("mover_contact")) return "";
  const std::string outcome = run.result["outcome"].get<std::string>();
  if (outcome != "collision") return fmt::format("the run ended without contact ({})", outcome);
  return fmt::format("the contact is not with an obstacle that moves or appears: {}",
                     run.result.value("cause", ""));
}

std::vector<Explanation::Act> last_of(const std::vector<Explanation::Act>& acts, double from_s) {
  std::vector<Explanation::Act> kept;
  for (auto act : acts) {
    if (act.to_s < from_s) continue;
    act.from_s = std::max(act.from_s, from_s);
    kept.push_back(std::move(act));
  }
  return kept;
}

std::vector<std::string> notes_of(const scene::Scene& scene, const model::Robot& robot,
                                  const std::vector<log::Trajectory::Point>& points) {
  std::vector<std::string> notes;
  if (!scene::limits_in_force(scene.model, robot).torque)
    notes.emplace_back("no torque limits are modelled, so motions may be too fast for the arm");
  if (scene.map && !scene.map->changes.empty())
    notes.emplace_back("the map changes: motions were checked with the map at the contact");
  const auto last = points.size() - 1;
  const double step_s = last > 0 ? points[last].time_s - points[last - 1].time_s : 0.0,
               before_s = last > 1 ? points[last - 1].time_s - points[last - 2].time_s : step_s;
  if (before_s > 2.0 * ExplainOptions::grid_s)
    notes.push_back(fmt::format(
        "the log has a state every {:g} s only, and evasions start there; log every step to find "
        "later ones",
        before_s));
  return notes;
}

std::vector<log::Trajectory::Point> points_until_contact(const std::filesystem::path& log,
                                                         double contact_s, int dof) {
  std::vector<log::Trajectory::Point> points = log::read_trajectory(log).points;
  while (!points.empty() && points.back().time_s > contact_s + 1e-9) points.pop_back();
  if (points.empty() || points.back().time_s < contact_s - 1e-9)
    throw Error(ErrorCode::invalid, fmt::format("{}: has no tick at {} s, expected one at the "
                                                "contact of the result",
                                                log.string(), contact_s));
  for (const auto& point : points)
    if (point.q.size() != dof || point.v.size() != dof)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: {} values at {} s, expected {} (one per joint)", log.string(),
                              point.q.size(), point.time_s, dof));
  if (!points.back().q.allFinite())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: q at {} s is not finite, expected the state at the contact",
                            log.string(), contact_s));
  return points;
}

Json acts_json(const std::vector<Explanation::Act>& acts, const char* what, bool evades) {
  Json all = Json::array();
  for (const auto& act : acts) {
    all.push_back({{what, act.what}, {"from_s", act.from_s}, {"to_s", act.to_s}});
    if (evades) all.back()["evades"] = act.evades;
  }
  return all;
}

Json found_json(const std::optional<Explanation::Found>& found, double contact_s) {
  if (!found) return nullptr;
  const Evasion& evasion = found->evasion;
  return {{"kind", to_string(evasion.kind)},
          {"before_contact_s", contact_s - evasion.start_s},
          {"start_s", evasion.start_s},
          {"decided_s", found->decided_s},
          {"duration_s", evasion.duration_s},
          {"q", to_json(evasion.q)},
          {"v", to_json(evasion.v)},
          {"way", to_json(evasion.way)},
          {"q_end", to_json(evasion.end())},
          {"known", found->known},
          {"looked_clear", found->looked_clear},
          {"contact_predicted", found->contact_predicted}};
}

}  // namespace

std::string_view to_string(Evasion::Kind kind) noexcept {
  return kind == Evasion::Kind::stop ? "stop" : kind == Evasion::Kind::back ? "back" : "aside";
}

std::string_view to_string(Avoidability verdict) noexcept {
  switch (verdict) {
    case Avoidability::avoidable:
      return "avoidable";
    case Avoidability::avoidable_in_hindsight:
      return "avoidable_in_hindsight";
    case Avoidability::unavoidable:
      break;
  }
  return "unavoidable";
}

Explanation explain(const std::filesystem::path& log, const ExplainOptions& options) {
  (void)log::check_log(log);
  const LoggedRun logged = read_acts(log);
  Explanation explanation;
  explanation.nothing = reason_for_nothing(logged);
  if (!explanation.nothing.empty()) return explanation;

  const Recorded recorded = read_header(logged.header, log);
  if (!recorded.changed.empty()) throw Error(ErrorCode::invalid, recorded.changed.front().text);
  const model::Model model = control::load_model(recorded.scene);
  explanation.contact = logged.result["mover_contact"];
  const double contact_s = explanation.contact["time_s"].get<double>();
  const auto points = points_until_contact(log, contact_s, model.dof());
  explanation.stops = last_of(logged.stops, contact_s - last_acts_s);
  explanation.planner_acts = last_of(logged.planner_acts, contact_s - last_acts_s);
  explanation.notes = notes_of(recorded.scene, model.robot(), points);
  EvasionSearch search(
      {log, recorded.scene, model, points, explanation.contact["obstacle"].get<std::string>()},
      options);
  search.run(explanation);
  return explanation;
}

Json to_json(const Explanation& explanation) {
  Json json{{"schema", "hamelin.explanation/1"}, {"verdict", nullptr}};
  if (!explanation.nothing.empty()) {
    json["reason"] = explanation.nothing;
    return json;
  }
  const double contact_s = explanation.contact["time_s"].get<double>();
  const auto& search = explanation.search;
  json["verdict"] = to_string(explanation.verdict);
  json["mover_contact"] = explanation.contact;
  json["known_since_s"] =
      explanation.known_since_s ? Json(*explanation.known_since_s) : Json(nullptr);
  json["evasion"] = found_json(explanation.latest, contact_s);
  json["foreseen_evasion"] = found_json(explanation.latest_foreseen, contact_s);
  json["search"] = {{"first_start_s", search.first_s},
                    {"last_start_s", search.last_s},
                    {"starts", search.starts},
                    {"motions", search.motions},
                    {"motions_per_start", search.motions_per_start},
                    {"seed", search.seed}};
  json["last_second"] = {{"stops", acts_json(explanation.stops, "cause", true)},
                         {"planner_evasion", acts_json(explanation.planner_acts, "value", false)}};
  json["notes"] = explanation.notes;
  return json;
}

}  // namespace hamelin::simulation
