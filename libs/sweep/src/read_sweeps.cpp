#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <map>

#include "hamelin/core/error.hpp"
#include "hamelin/io/atomic_file.hpp"
#include "hamelin/sweep/merge.hpp"
#include "hamelin/sweep/records.hpp"

namespace hamelin::sweep {

namespace {

namespace fs = std::filesystem;

std::string text_of(const Json& value) {
  return value.is_string() ? value.get<std::string>() : "";
}

// The builds that made a result: (name, build) of the program and of its planner.
std::vector<std::pair<std::string, std::string>> builds_of(const Json& result) {
  const Json provenance = result.value("provenance", Json::object());
  std::vector<std::pair<std::string, std::string>> builds;
  if (provenance.contains("build"))
    builds.emplace_back("the program", provenance["build"].value("id", Json()).dump());
  if (provenance.contains("inputs"))
    for (const Json& input : provenance["inputs"])
      if (input.value("role", Json()) == "plugin")
        builds.emplace_back(fmt::format("planner {}", text_of(result.value("planner", Json()))),
                            input["sha256"].dump());
  return builds;
}

// CPU, instruction set and build of a result; null if it does not name them.
Json machine_of(const Json& result) {
  const Json provenance = result.value("provenance", Json::object());
  if (!provenance.contains("host") && !provenance.contains("isa")) return nullptr;
  return {{"host", provenance.value("host", Json(nullptr))},
          {"isa", provenance.value("isa", Json(nullptr))},
          {"build", provenance.value("build", Json(nullptr))}};
}

/// Reads lines again by their places, and keeps the last file open.
class LineReader {
 public:
  explicit LineReader(const Sweeps& sweeps) : sweeps_(sweeps) {}
  std::string read(const RecordPlace& place) {
    const fs::path& file = sweeps_.files[place.file];
    if (!in_.is_open() || place.file != open_) {
      in_ = std::ifstream(file, std::ios::binary);
      open_ = place.file;
    }
    std::string line(place.bytes, '\0');
    in_.seekg(static_cast<std::streamoff>(place.offset));
    if (!in_.read(line.data(), static_cast<std::streamsize>(line.size())))
      throw Error(ErrorCode::io, fmt::format("{}: cannot be read: it has become shorter than it "
                                             "was, expected no change while it is read",
                                             file.string()));
    return line;
  }
  Json read_json(const RecordPlace& place) {
    return parse_json(read(place), sweeps_.files[place.file].string());
  }

 private:
  const Sweeps& sweeps_;
  std::ifstream in_;
  std::size_t open_ = 0;
};

/// Joins the records of the directories with one plan.
class Join {
 public:
  Join(Sweeps& sweeps, const Plan& plan, const fs::path& directory, bool timing)
      : sweeps_(sweeps),
        lines_(sweeps),
        timing_(timing),
        index_(plan),
        first_run_(sweeps.runs.size()) {
    std::map<std::string_view, const PlannedScene*> scenes;
    for (const auto& scene : plan.scenes) scenes[scene.file] = &scene;
    for (const auto& run : plan.runs) {
      const PlannedScene& scene = *scenes.at(run.scene);
      sweeps.runs.push_back({run, directory, scene.feasible, scene.reason, {}, {}});
    }
    for (const auto& ablation : plan.ablations)
      if (std::none_of(
              sweeps.ablations.begin(), sweeps.ablations.end(), [&](const Ablation& known) {
                return known.planner == ablation.planner && known.without == ablation.without;
              }))
        sweeps.ablations.push_back(ablation);
  }

  void add(const fs::path& file) {
    const std::size_t number = sweeps_.files.size();
    sweeps_.files.push_back(file);
    (void)read_records(file, index_, [&](PlacedRecord&& record) {
      add(std::move(record.record), sweeps_.runs[first_run_ + record.run],
          {number, record.offset, record.bytes});
    });
  }

 private:
  void add(Json&& record, MergedRun& run, const RecordPlace& place) {
    if (record["result"].is_object()) {
      for (const auto& [name, build] : builds_of(record["result"]))
        sweeps_.builds[name].insert(build);
      if (sweeps_.machine.is_null()) sweeps_.machine = machine_of(record["result"]);
    }
    if (run.facts.recorded) {
      const Json before = lines_.read_json(run.place);
      if (repeatable_text(before, run.run) == repeatable_text(record, run.run))
        ++sweeps_.repeated;
      else
        sweeps_.different.push_back(run.run.id);
      if (run.facts.outcome != "crashed" || record["outcome"] == "crashed") return;
    }
    run.facts = facts_of(record, timing_);
    run.place = place;
  }

  Sweeps& sweeps_;
  LineReader lines_;
  bool timing_;
  RunIndex index_;
  std::size_t first_run_;
};

}  // namespace

Sweeps read_sweeps(const std::vector<fs::path>& directories, bool timing) {
  Sweeps sweeps;
  std::vector<Plan> plans;
  plans.reserve(directories.size());
  std::map<std::string, std::vector<fs::path>> copies;
  for (const auto& directory : directories) {
    Plan plan = read_plan(directory);
    auto& same = copies[plan.sha256];
    std::error_code ec;
    if (same.empty()) plans.push_back(std::move(plan));
    if (std::none_of(same.begin(), same.end(),
                     [&](const fs::path& other) { return fs::equivalent(directory, other, ec); }))
      same.push_back(directory);
  }
  for (const Plan& plan : plans) {
    Join join(sweeps, plan, copies[plan.sha256].front(), timing);
    for (const auto& directory : copies[plan.sha256])
      for (const auto& file : record_files(directory)) join.add(file);
  }
  return sweeps;
}

Sweeps read_sweeps_apart(const std::vector<fs::path>& directories) {
  Sweeps sweeps;
  for (const auto& directory : directories) {
    const Plan plan = read_plan(directory);
    Join join(sweeps, plan, directory, true);
    for (const auto& file : record_files(directory)) join.add(file);
  }
  return sweeps;
}

void write_records(const Sweeps& sweeps, const fs::path& file, bool timing) {
  AtomicFile out(file);
  LineReader lines(sweeps);
  for (const auto& run : sweeps.runs) {
    if (!run.facts.recorded) continue;
    out.append(timing ? lines.read(run.place)
                      : repeatable_text(lines.read_json(run.place), run.run));
    out.append("\n");
  }
  out.commit();
}

}  // namespace hamelin::sweep
