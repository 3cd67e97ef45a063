// Runs an adversary through embedded controllers, and prints one line for each finding.
//
//     hamelin_adversary_runs COUNT FIRST_SEED [torque|position|both] [THREADS] [unshielded]
//
// A finding names the seed and the drive that reproduce it: `hamelin_adversary_runs 1 SEED DRIVE`.
#include <fmt/format.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <mutex>
#include <string>
#include <thread>

#include "embedded_run.hpp"

namespace {

using namespace hamelin::test;

struct Totals {
  long runs = 0, failed = 0, unstarted = 0, ticks = 0, stopping = 0, overtaken = 0;
  std::array<long, faults> runs_with{};
  Events events;
  double least_clearance_m = 1.0, strayed_share = 0.0, path = 0.0;

  void add(const EmbeddedReport& report) {
    ++runs;
    unstarted += report.unstarted.empty() ? 0 : 1;
    ticks += report.ticks;
    stopping += report.stopping;
    overtaken += report.overtaken;
    path += report.path;
    for (std::size_t i = 0; i < faults; ++i) runs_with[i] += report.counts[i] > 0 ? 1 : 0;
    events += report.events;
    least_clearance_m = std::min(least_clearance_m, report.least_clearance_m);
    strayed_share = std::max(strayed_share, report.strayed_share);
  }
};

void print(const char* drive, const Totals& totals) {
  const Events& events = totals.events;
  fmt::print("{}: {} runs, {} ticks, {:.0f} rad of path, {} ticks of stops\n", drive, totals.runs,
             totals.ticks, totals.path, totals.stopping);
  fmt::print(
      "  {} unusable measurements, {} late answers, {} stops, {} resumptions, {} resets, {} loads, "
      "{} loads refused, {} updates of the world, {} of goals, {} of parameters, {} refused\n",
      events.measurements, events.late, events.stops, events.resumptions, events.resets,
      events.loads, events.refused_loads, events.worlds, events.goals, events.params,
      events.refused);
  fmt::print("  runs with faults:");
  for (std::size_t i = 0; i < faults; ++i)
    fmt::print(" {} {}", to_string(static_cast<Fault>(i)), totals.runs_with[i]);
  fmt::print(
      "\n  {} errors, {} resets without a start, {} stops overtaken; least clearance {:.2g} m, "
      "strayed {:.2f} of the bound\n",
      totals.failed, totals.unstarted, totals.overtaken, totals.least_clearance_m,
      totals.strayed_share);
}

void work(std::atomic<long>& next, long count, std::uint64_t first, bool position, bool shielded,
          Totals& totals, std::mutex& mutex) {
  for (long i = next++; i < count; i = next++) {
    const EmbeddedRun run{first + static_cast<std::uint64_t>(i), position, shielded};
    try {
      const EmbeddedReport report = run_embedded(run);
      const std::lock_guard lock(mutex);
      totals.add(report);
      for (const std::string& line : report.findings) fmt::print("{}\n", line);
      if (!report.unstarted.empty())
        fmt::print("seed {} {}: no start after a reset: {}\n", run.seed,
                   position ? "position" : "torque", report.unstarted);
    } catch (const std::exception& e) {
      const std::lock_guard lock(mutex);
      ++totals.failed;
      fmt::print("seed {} {}: {}\n", run.seed, position ? "position" : "torque", e.what());
    }
    std::fflush(stdout);
  }
}

bool all_well(long count, std::uint64_t first, bool position, int threads, bool shielded) {
  Totals totals;
  std::mutex mutex;
  std::atomic<long> next{0};
  std::vector<std::thread> workers;
  for (int i = 0; i < threads; ++i)
    workers.emplace_back([&] { work(next, count, first, position, shielded, totals, mutex); });
  for (std::thread& worker : workers) worker.join();
  print(position ? "position" : "torque", totals);
  long found = totals.failed;
  for (const long runs : totals.runs_with) found += runs;
  return found == 0;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fputs(
        "adversary_runs: expected COUNT FIRST_SEED [torque|position|both] [THREADS] [unshielded]\n",
        stderr);
    return 2;
  }
  const std::string drive = argc > 3 ? argv[3] : "both";
  const int threads = argc > 4 ? std::atoi(argv[4]) : 1;
  const bool shielded = argc <= 5;
  const long count = std::atol(argv[1]);
  const auto first = static_cast<std::uint64_t>(std::atol(argv[2]));
  bool well = true;
  for (const bool position : {false, true})
    if (drive == "both" || drive == (position ? "position" : "torque"))
      well = all_well(count, first, position, threads, shielded) && well;
  return well ? 0 : 1;
}
