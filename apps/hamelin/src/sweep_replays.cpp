#include "sweep_replays.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <set>

#include "command_line.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/report/report.hpp"
#include "hamelin/sweep/failure_class.hpp"
#include "hamelin/sweep/judged_run.hpp"
#include "hamelin/sweep/plan.hpp"
#include "page.hpp"
#include "plants.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

namespace fs = std::filesystem;

/// Removes the log of a replay, of which only the page is kept.
class TemporaryLog {
 public:
  explicit TemporaryLog(fs::path file) : file_(std::move(file)) {}
  ~TemporaryLog() {
    std::error_code ec;
    fs::remove(file_, ec);
  }
  TemporaryLog(const TemporaryLog&) = delete;
  TemporaryLog& operator=(const TemporaryLog&) = delete;
  [[nodiscard]] const fs::path& file() const { return file_; }

 private:
  fs::path file_;
};

/// The first runs of each class and planner, in the order of the plans.
std::vector<std::size_t> runs_to_replay(const sweep::Merged& merged, std::size_t per_class) {
  std::map<std::pair<std::string, std::string>, std::size_t> chosen;
  std::vector<std::size_t> runs;
  for (std::size_t i = 0; i < merged.sweeps.runs.size(); ++i) {
    const sweep::RunFacts& facts = merged.sweeps.runs[i].facts;
    if (facts.failure.empty() || facts.outcome == "crashed") continue;
    std::size_t& taken = chosen[{facts.failure, merged.sweeps.runs[i].run.labels.at("planner")}];
    if (taken >= per_class) continue;
    ++taken;
    runs.push_back(i);
  }
  return runs;
}

/// A file name for the id of a run, different from those that are taken.
std::string file_name(const std::string& id, std::set<std::string>& taken) {
  std::string name;
  for (const char c : id)
    name += std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '.' || c == '_' ? c : '-';
  constexpr std::size_t longest = 120;
  name = name.substr(0, longest);
  std::string unique = name;
  for (int i = 2; !taken.insert(unique).second; ++i) unique = fmt::format("{}-{}", name, i);
  return unique;
}

std::vector<report::Remark> remarks_of(const sweep::MergedRun& run, const sweep::JudgedRun& now) {
  std::vector<report::Remark> remarks;
  const Json replayed{{"judge", sweep::to_json(now.verdict)}};
  if (const std::string contact = sweep::judged_contact(replayed); !contact.empty())
    remarks.push_back({sweep::judged_contact_time(replayed), contact});
  const std::string& recorded = run.facts.own_outcome;
  const std::string outcome(log::to_string(now.result.outcome));
  if (recorded != outcome)
    remarks.push_back({now.result.time_s,
                       fmt::format("the record of the sweep has the outcome {}; this repeated run "
                                   "has {}: another build or machine",
                                   recorded, outcome)});
  return remarks;
}

/// Repeats one run with its judge and writes its page.
void write_replay(const sweep::MergedRun& run, const fs::path& target,
                  const ReplayRequest& request) {
  const TemporaryLog temporary(fs::path(target).replace_extension(".jsonl.zst"));
  const sweep::JudgedRun now = repeat_run(run, temporary.file(), request.plugin_path);
  report::Options options;
  options.remarks = remarks_of(run, now);
  const report::Data data = report::make_data({temporary.file()}, options);
  write_page(page_template("page"), data.bytes, target);
  for (const auto& remark : options.remarks) detail(fmt::format("{}: {}", run.run.id, remark.text));
}

}  // namespace

sweep::JudgedRun repeat_run(const sweep::MergedRun& run, const fs::path& log_file,
                            const std::vector<fs::path>& directories) {
  const scene::Scene scene = sweep::read_scene(run.run, run.directory);
  log::RunLog log(log_file);
  simulation::Watch watch;
  watch.log = &log;
  watch.argv = command_line();
  watch.stop = &stop_on_signals();
  const HangGuard guard;
  sweep::JudgedRun now =
      sweep::run_under_judge(scene, plugin_path(directories), watch, plant_factory());
  log.flush();
  return now;
}

std::map<std::size_t, sweep::ReplayLink> write_replays(const sweep::Merged& merged,
                                                       const ReplayRequest& request) {
  std::map<std::size_t, sweep::ReplayLink> links;
  const auto runs = runs_to_replay(merged, request.per_class);
  if (runs.empty()) return links;
  const std::string folder = request.page.stem().string() + "-runs";
  const fs::path path = request.page.parent_path() / folder;
  std::error_code ec;
  fs::create_directories(path, ec);
  if (ec)
    throw Error(ErrorCode::io,
                fmt::format("{}: cannot be created: {}", path.string(), ec.message()));
  const Phase phase("the replays");
  Progress progress("runs replayed");
  std::set<std::string> taken;
  for (const std::size_t i : runs) {
    if (stop_on_signals()) break;
    const sweep::MergedRun& run = merged.sweeps.runs[i];
    const std::string name = file_name(run.run.id, taken) + ".html";
    write_replay(run, path / name, request);
    links[i] = {fmt::format("{}/{}", folder, name), run.facts.contact_time_s};
    progress.show(static_cast<double>(links.size()), static_cast<double>(runs.size()));
  }
  return links;
}

}  // namespace hamelin::app
