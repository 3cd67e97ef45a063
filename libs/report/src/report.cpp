#include "hamelin/report/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "container.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/simulation/replay.hpp"
#include "run.hpp"
#include "world.hpp"

namespace hamelin::report {

namespace {

// Reads the header. A file of any kind that does not begin with one is refused in one line.
Json read_first_line(log::LogReader& reader, const std::filesystem::path& file) {
  const auto error = [&file](const std::string& problem) {
    return Error(ErrorCode::invalid, fmt::format("{}: {}, expected a log of `hamelin run --log`",
                                                 file.string(), problem));
  };
  Json header;
  bool any = false;
  try {
    any = reader.next(header);
  } catch (const Error& e) {
    if (e.code() != ErrorCode::parse || reader.lines() != 1) throw;
    throw error("its first line is not a JSON object");
  }
  if (!any) throw error(reader.cut() ? "has no complete line" : "is empty");
  if (header.value("type", Json()) != "header") throw error("its first line is not a header");
  return header;
}

// Runs are named by their planner. Runs of one planner are distinguished by the names of their
// logs, and logs of one name by their number.
std::vector<std::string> names_of(const Json& runs) {
  std::vector<std::string> names;
  for (const Json& run : runs)
    names.push_back(
        (run["planner"].is_null() ? run["integrator"] : run["planner"]).get<std::string>());
  const auto extend_duplicates = [&](const auto& suffix) {
    std::map<std::string, int> count;
    for (const auto& name : names) ++count[name];
    for (std::size_t i = 0; i < names.size(); ++i)
      if (count[names[i]] > 1) names[i] = fmt::format("{} {}", names[i], suffix(i));
  };
  extend_duplicates([&](std::size_t i) {
    return std::filesystem::path(runs[i]["log"].get<std::string>()).stem().string();
  });
  extend_duplicates([](std::size_t i) { return fmt::format("#{}", i + 1); });
  return names;
}

void check(const std::vector<std::filesystem::path>& logs, const Options& options) {
  if (logs.empty()) throw Error(ErrorCode::usage, "report: no logs given, expected at least one");
  if (options.frames_max < 2)
    throw Error(ErrorCode::usage,
                fmt::format("report: {} frames, expected at least 2", options.frames_max));
  if (options.plot_points_max < 4)
    throw Error(ErrorCode::usage,
                fmt::format("report: {} points, expected at least 4", options.plot_points_max));
}

}  // namespace

Data make_data(const std::vector<std::filesystem::path>& logs, const Options& options) {
  check(logs, options);
  Container container;
  Data data;
  std::vector<std::unique_ptr<World>> worlds;
  std::vector<std::string> scenes;
  Json runs = Json::array();
  for (const auto& file : logs) {
    log::LogReader reader(file);
    const Json header = read_first_line(reader, file);
    const simulation::Recorded recorded = simulation::read_header(header, file);
    const bool has_map = simulation::has_original_map(recorded);
    std::string key = fmt::format("{}{}", world_key(recorded), has_map ? "" : " without map");
    auto world = std::find_if(worlds.begin(), worlds.end(),
                              [&](const auto& known) { return known->key == key; });
    if (world == worlds.end())
      world = worlds.insert(world, make_world(recorded, std::move(key), has_map, container));

    Run run(header, recorded, **world, options);
    for (Json line; reader.next(line);) run.add_line(std::move(line), reader);
    RunSummary summary;
    summary.log = file;
    Json named{{"name", ""}, {"world", world - worlds.begin()}};
    named.update(run.finish(reader, container, summary));
    for (const Remark& remark : options.remarks) {
      named["notes"].push_back(remark.text);
      named["events"].push_back({{"t", remark.time_s}, {"text", remark.text}});
    }
    runs.push_back(std::move(named));
    data.runs.push_back(std::move(summary));
    std::string scene = std::filesystem::path(recorded.scene.name).filename().string();
    if (std::find(scenes.begin(), scenes.end(), scene) == scenes.end())
      scenes.push_back(std::move(scene));
  }
  const std::vector<std::string> names = names_of(runs);
  for (std::size_t i = 0; i < names.size(); ++i) runs[i]["name"] = data.runs[i].name = names[i];
  Json head{{"format", "hamelin.report/1"},
            {"generator", fmt::format("hamelin {}", version())},
            {"title", fmt::format("{}", fmt::join(scenes, ", "))},
            {"worlds", Json::array()},
            {"runs", std::move(runs)}};
  for (auto& world : worlds) head["worlds"].push_back(std::move(world->json));
  data.bytes = container.finish(head);
  return data;
}

std::string pack(const Json& data) {
  return Container().finish(data);
}

}  // namespace hamelin::report
