#include "bench_explain.hpp"

#include <fmt/format.h>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/simulation/explain.hpp"
#include "sweep_replays.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace fs = std::filesystem;

namespace {

// Runs in contact whose log would have something to explain, and that have no explanation yet.
std::vector<const sweep::MergedRun*> unexplained(const bench::Results& results,
                                                 const fs::path& directory) {
  std::vector<const sweep::MergedRun*> runs;
  for (const auto& run : results.by_family.sweeps.runs)
    if (run.facts.outcome == "collision" && run.facts.contact_arm_speed_m_s &&
        !fs::exists(bench::explanation_file(directory, run.run.id)))
      runs.push_back(&run);
  return runs;
}

}  // namespace

void explain_contacts(const bench::Results& results, const fs::path& directory,
                      const std::vector<fs::path>& directories) {
  const auto runs = unexplained(results, directory);
  if (runs.empty()) return;
  const fs::path folder = bench::explanation_file(directory, runs.front()->run.id).parent_path();
  std::error_code ec;
  fs::create_directories(folder, ec);
  if (ec)
    throw Error(ErrorCode::io,
                fmt::format("{}: cannot be created: {}", folder.string(), ec.message()));
  Progress progress("contacts explained");
  for (std::size_t i = 0; i < runs.size() && !stop_on_signals(); ++i) {
    const fs::path file = bench::explanation_file(directory, runs[i]->run.id),
                   log = fs::path(file).replace_extension(".jsonl.zst");
    (void)repeat_run(*runs[i], log, directories);
    if (stop_on_signals()) break;
    write_file_atomically(file, to_json(simulation::explain(log, {})).dump(2) + "\n");
    progress.show(static_cast<double>(i + 1), static_cast<double>(runs.size()));
  }
}

}  // namespace hamelin::app
