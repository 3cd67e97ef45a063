#include "hamelin/simulation/replay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "closed_loop.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/log/provenance.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "scene_values.hpp"

namespace hamelin::simulation {

namespace {

namespace fs = std::filesystem;

std::string short_hash(const std::string& sha256) {
  return sha256.substr(0, 12);
}

// Where an input is now, and its hash; empty if it was not found.
struct Found {
  fs::path file;
  std::string sha256;
};

// The first place with a file of this hash, else the first with a file of this name.
Found find_input(const fs::path& named, const std::string& sha256, const fs::path& cwd,
                 const fs::path& log) {
  Found first;
  for (const auto& place :
       {named, cwd / named, log.parent_path() / named, log.parent_path() / named.filename()}) {
    std::error_code ec;
    if (!fs::is_regular_file(place, ec)) continue;
    Found here{place, sha256_of_file(place)};
    if (here.sha256 == sha256) return here;
    if (first.file.empty()) first = std::move(here);
  }
  return first;
}

// Text of the value at a pointer of a document, "" if there is none.
std::string text_at(const Json& document, const char* pointer) {
  const Json::json_pointer at(pointer);
  if (!document.contains(at)) return "";
  const Json& value = document[at];
  return value.is_string() ? value.get<std::string>() : value.is_null() ? "" : value.dump();
}

// The SHA-256 of the input with this role; empty if there is none.
std::string logged_hash(const Json& header, std::string_view role) {
  for (const auto& input : header["provenance"].value("inputs", Json::array()))
    if (text_at(input, "/role") == role) return text_at(input, "/sha256");
  return "";
}

std::vector<std::string> build_differences(const Json& then) {
  std::vector<std::string> lines;
  const Json now = log::provenance({});
  const std::pair<const char*, const char*> bits_depend_on[] = {
      {"/build/id", "build"},
      {"/isa", "instruction set"},
      {"/versions/libc", "C library"},
      {"/host/fma", "fused operations in the C library"}};
  for (const auto& [pointer, name] : bits_depend_on) {
    const auto before = text_at(then, pointer), here = text_at(now, pointer);
    if (before != here)
      lines.push_back(fmt::format("{}: {} in the log, {} now", name,
                                  before.empty() ? "unknown" : before,
                                  here.empty() ? "unknown" : here));
  }
  return lines;
}

// Roles of a run's input files, and the pointers at which its configuration names them.
std::vector<std::pair<std::string, std::string>> file_pointers(const Json& header) {
  const Json& config = header["config"];
  std::vector<std::pair<std::string, std::string>> places{{"robot", "/robot/file"},
                                                          {"spheres", "/robot/spheres"},
                                                          {"srdf", "/robot/srdf"},
                                                          {"map", "/map/file"}};
  const Json::json_pointer changes("/map/changes");
  for (std::size_t i = 0; config.contains(changes) && i < config[changes].size(); ++i)
    places.emplace_back(fmt::format("map_change_{}", i), fmt::format("/map/changes/{}/file", i));
  const Json::json_pointer events("/events");
  for (std::size_t i = 0; config.contains(events) && i < config[events].size(); ++i)
    places.emplace_back(fmt::format("event_map_{}", i), fmt::format("/events/{}/map/file", i));
  const Json::json_pointer obstacles("/obstacles");
  for (std::size_t i = 0; config.contains(obstacles) && i < config[obstacles].size(); ++i)
    places.emplace_back(fmt::format("waypoints_{}", i),
                        fmt::format("/obstacles/{}/motion/file", i));
  const Json::json_pointer goals("/goals");
  for (std::size_t i = 0; config.contains(goals) && i < config[goals].size(); ++i)
    for (const char* place : {"motion", "stream"})
      places.emplace_back(fmt::format("target_{}", i), fmt::format("/goals/{}/{}/file", i, place));
  const Json::json_pointer inputs("/provenance/inputs");
  for (std::size_t i = 0; header.contains(inputs) && i < header[inputs].size(); ++i)
    if (const std::string role =
            text_at(header, fmt::format("/provenance/inputs/{}/role", i).c_str());
        role.starts_with(planner_file_role))
      places.emplace_back(role, "/planner/params/" + role.substr(planner_file_role.size()));
  return places;
}

// Removes the paths of input files: these may differ, as their contents are checked by hash.
void remove_paths(Json& header) {
  if (!header.contains("config")) return;
  for (const auto& place : file_pointers(header))
    if (const Json::json_pointer at(place.second); header["config"].contains(at))
      header["config"][at] = nullptr;
}

// Earlier versions wrote null for a weightless scene.
void state_gravity(Json& header) {
  if (!header.contains("config") || !header["config"].is_object()) return;
  Json& config = header["config"];
  if (const auto found = config.find("gravity_m_s2"); found != config.end() && found->is_null())
    *found = Json::array({0.0, 0.0, 0.0});
}

std::string abbreviated(const Json& value) {
  std::string text = value.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > 80) text = text.substr(0, 77) + "...";
  return text;
}

// Compares the lines of a run with those of a log as they come.
class Comparison final : public log::LineSink {
 public:
  Comparison(const fs::path& log, double tolerance) : reader_(log), tolerance_(tolerance) {}

  [[nodiscard]] const Verdict& verdict() const noexcept { return verdict_; }
  /// To be called at the end: checks that the log has no further lines.
  void finish() {
    Json logged;
    if (!ended() && reader_.next(logged))
      record_difference("", logged, Json("the repeated run ended here"), logged);
    while (branched_ && reader_.next(logged)) note_outcome(logged, verdict_.outcome_logged);
  }

 private:
  void take(Json replayed) override {
    Json logged;
    if (enough_) return;
    note_outcome(replayed, verdict_.outcome_replayed);
    if (branched_) return;
    if (!reader_.next(logged)) {  // the end of an unfinished log
      enough_ = true;
      return;
    }
    note_outcome(logged, verdict_.outcome_logged);
    // The logged line is not trusted: step and time are those of the replayed line.
    if (replayed["type"] == "tick") {
      k_ = replayed["k"].get<long>();
      time_s_ = replayed["time_s"].get<double>();
    }
    for (Json* line : {&logged, &replayed}) {
      line->erase("timing");
      if (line->value("type", Json()) == "header") {
        remove_paths(*line);
        state_gravity(*line);
      }
      line->erase("provenance");
    }
    compare("", logged, replayed, logged);
    if (ended()) return;
    ++verdict_.lines;
    verdict_.ticks += logged["type"] == "tick" ? 1 : 0;
    verdict_.finished = logged["type"] == "result";
  }

  static void note_outcome(const Json& line, std::string& outcome) {
    if (line.value("type", Json()) == "result") outcome = text_at(line, "/outcome");
  }

  // Texts for people: another build may word them differently.
  static bool is_wording(const std::string& at) {
    return at == "/robot_notes" || at == "/warnings" || at == "/cause" || at == "/text";
  }

  void compare(const std::string& at, const Json& a, const Json& b, const Json& line) {
    if (ended()) return;
    if (is_wording(at)) {
      if (a != b) record_difference(at, a, b, line, tolerance_ > 0.0);
    } else if (a.is_object() && b.is_object()) {
      for (const auto& [key, value] : a.items())
        if (b.contains(key))
          compare(fmt::format("{}/{}", at, key), value, b[key], line);
        else
          record_difference(fmt::format("{}/{}", at, key), value, Json("missing"), line);
      for (const auto& [key, value] : b.items())
        if (!a.contains(key))
          record_difference(fmt::format("{}/{}", at, key), Json("missing"), value, line);
    } else if (a.is_array() && b.is_array() && a.size() == b.size()) {
      for (std::size_t i = 0; i < a.size(); ++i)
        compare(fmt::format("{}/{}", at, i), a[i], b[i], line);
    } else if (a.is_number_float() && b.is_number_float()) {
      const double x = a.get<double>(), y = b.get<double>();
      if (std::bit_cast<std::uint64_t>(x) == std::bit_cast<std::uint64_t>(y)) return;
      const double error = std::abs(x - y) / std::max(1.0, std::abs(x));
      if (error <= tolerance_) verdict_.largest = std::max(verdict_.largest, error);
      record_difference(at, a, b, line, error <= tolerance_, error);
    } else if (a != b) {
      record_difference(at, a, b, line);
    }
  }

  void record_difference(const std::string& field, const Json& logged, const Json& replayed,
                         const Json& line, bool tolerated = false,
                         std::optional<double> size = {}) {
    if (ended()) return;
    const Json type = line.value("type", Json());
    const Verdict::Difference found{reader_.lines(),
                                    type.is_string() ? type.get<std::string>() : "line",
                                    k_,
                                    time_s_,
                                    field,
                                    abbreviated(logged),
                                    abbreviated(replayed),
                                    size};
    if (!verdict_.first_difference) verdict_.first_difference = found;
    if (tolerated && tolerance_ > 0.0) return;
    verdict_.beyond_tolerance = found;
    // With a tolerance the run continues for its outcome. Without one, any difference is an error.
    (tolerance_ > 0.0 && found.type == "tick" ? branched_ : enough_) = true;
  }

  // Whether all that can be compared has been compared.
  [[nodiscard]] bool ended() const noexcept { return enough_ || branched_; }

  log::LogReader reader_;
  double tolerance_;
  bool branched_ = false;
  Verdict verdict_;
  std::optional<long> k_;
  std::optional<double> time_s_;
};

// Equal bits hold on one instruction set only, so the run is repeated on the logged one if
// this machine has it and the caller names no other.
void use_logged_isa(const Json& header) {
  if (default_isa_is_set()) return;
  try {
    set_default_isa(isa_from_name(text_at(header.value("provenance", Json::object()), "/isa"),
                                  "/provenance/isa"));
  } catch (const Error&) {
    // Not available: build_differences reports it, and the comparison uses the tolerance.
  }
}

// The step at which the logged run was stopped.
std::optional<long> logged_stop_step(const fs::path& log) {
  log::LogReader reader(log);
  std::string last;
  for (std::string_view line; reader.next_text(line);) last = line;
  const Json result = try_parse_json(last);
  if (!result.is_object() || result.value("type", Json()) != "result" ||
      result.value("outcome", Json()) != "interrupted" || !result.contains("steps") ||
      !result["steps"].is_number_integer())
    return {};
  return result["steps"].get<long>();
}

}  // namespace

bool has_original_map(const Recorded& recorded) {
  return recorded.scene.map && !recorded.scene.map->file.empty() &&
         std::none_of(recorded.changed.begin(), recorded.changed.end(),
                      [](const auto& changed) { return changed.role == "map"; });
}

void check_joints(const Json& header, const Recorded& recorded, const model::Robot& robot) {
  const Json& joints = header["joints"];
  bool same = joints.size() == robot.links.size();
  for (std::size_t i = 0; same && i < robot.links.size(); ++i)
    same = joints[i]["name"] == robot.links[i].joint.name;
  if (!same)
    throw Error(
        ErrorCode::invalid,
        fmt::format("{}: its joints differ from those in the log, expected the robot of the run",
                    recorded.scene.robot.file.string()));
}

Recorded read_header(const Json& header, const fs::path& log) {
  const std::string where = log.string() + ": line 1";
  if (header.value("type", Json()) != "header")
    throw Error(ErrorCode::invalid,
                fmt::format("{}: is not a header, expected a log of hamelin", where));
  log::check_line(header, where);

  Recorded recorded;
  recorded.program =
      header["program"] == "integrate" ? Recorded::Program::integrate : Recorded::Program::run;
  recorded.every = header["every"].get<long>();
  const Json& provenance = header["provenance"];
  recorded.other_build = build_differences(provenance);

  Json config = header["config"];
  const fs::path cwd = text_at(provenance, "/cwd");
  for (const auto& [role, pointer] : file_pointers(header)) {
    const Json::json_pointer at(pointer);
    if (!config.contains(at) || !config[at].is_string()) continue;
    const std::string sha256 = logged_hash(header, role);
    const std::string named = config[at].get<std::string>();
    const Found found = find_input(named, sha256, cwd, log);
    if (found.file.empty()) {
      recorded.changed.push_back(
          {role, fmt::format("{}: is missing, expected the {} of this log", named, role)});
    } else {
      if (found.sha256 != sha256)
        recorded.changed.push_back(
            {role,
             fmt::format("{}: has changed since the log was written: SHA-256 {}..., expected {}...",
                         found.file.string(), short_hash(found.sha256),
                         sha256.empty() ? "one in the header" : short_hash(sha256))});
      config[at] = found.file.string();
    }
  }
  recorded.scene = scene::scene_from_json(config, {}, where + ": /config");
  recorded.scene.name = header["scene"].get<std::string>();
  return recorded;
}

Recorded read_header(const fs::path& log, const std::vector<fs::path>& plugin_directories) {
  log::LogReader reader(log);
  Json header;
  if (!reader.next(header))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: has no complete line, expected a log of hamelin", log.string()));
  use_logged_isa(header);
  Recorded recorded = read_header(header, log);
  if (recorded.program == Recorded::Program::run && recorded.scene.planner) {
    const auto plugin = planning::find_plugin(recorded.scene.planner->name, plugin_directories);
    const std::string then = logged_hash(header, "plugin"), now = sha256_of_file(plugin.file());
    if (then != now)
      recorded.other_build.push_back(
          fmt::format("planner '{}': SHA-256 {}... in the log, {}... now", plugin.name(),
                      short_hash(then), short_hash(now)));
  }
  return recorded;
}

log::Result repeat(const Recorded& recorded, const std::vector<fs::path>& plugin_directories,
                   const Watch& watch, const PlantFactory& plant_factory) {
  if (!recorded.changed.empty()) throw Error(ErrorCode::invalid, recorded.changed.front().text);
  if (recorded.program == Recorded::Program::run)
    return ClosedLoop(recorded.scene, plugin_directories, plant_factory).run(watch);
  const model::Model model = control::load_model(recorded.scene);
  return integrate(model, free_motion(recorded.scene, model), watch);
}

Verdict verify(const Recorded& recorded, const fs::path& log, double tolerance,
               const std::vector<fs::path>& plugin_directories, const Watch& watch,
               const PlantFactory& plant_factory) {
  Comparison comparison(log, tolerance);
  Watch compared = watch;
  compared.log = &comparison;
  compared.every = recorded.every;
  compared.stop_at = logged_stop_step(log);
  compared.announce = nullptr;
  (void)repeat(recorded, plugin_directories, compared, plant_factory);
  comparison.finish();
  Verdict verdict = comparison.verdict();
  verdict.stopped = watch.stop != nullptr && watch.stop->load();
  return verdict;
}

}  // namespace hamelin::simulation
