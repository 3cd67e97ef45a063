#include <fmt/format.h>

#include <chrono>
#include <fstream>
#include <memory>

#include "command_line.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/log/run_log.hpp"
#include "hamelin/sweep/pairs.hpp"
#include "plants.hpp"
#include "scene_flags.hpp"
#include "sweep.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

namespace fs = std::filesystem;

struct PairsOptions {
  fs::path file;
  sweep::PairOptions pairs;
  SceneFlags flags;
  std::size_t jobs = 1;
  std::vector<fs::path> plugin_path;
  bool json = false;
  std::optional<fs::path> output;
};

/// Writes one JSON line per run and flushes it, so that a killed program loses at most one line.
class PairRecords {
 public:
  PairRecords(const std::optional<fs::path>& file, const fs::path& input) {
    if (!file) return;
    std::error_code ec;
    if (fs::equivalent(*file, input, ec))
      throw Error(
          ErrorCode::usage,
          fmt::format("{}: is the input, expected another path for the output", file->string()));
    log::check_writable(*file);
    file_ = *file;
  }

  void write(std::size_t index, const sweep::Pair& pair, const log::Result& result) {
    if (file_.empty()) return;
    if (!out_.is_open()) out_.open(file_, std::ios::binary | std::ios::trunc);
    const Json line{{"schema", "hamelin.pair/1"},
                    {"index", index},
                    {"start", std::vector<double>(pair.start.begin(), pair.start.end())},
                    {"goal", std::vector<double>(pair.goal.begin(), pair.goal.end())},
                    {"result", log::to_json(result)}};
    out_ << line.dump(-1, ' ', false, Json::error_handler_t::replace) << '\n' << std::flush;
    if (!out_) throw Error(ErrorCode::io, fmt::format("{}: cannot be written", file_.string()));
  }

 private:
  fs::path file_;
  std::ofstream out_;
};

std::string number(const std::optional<double>& value, const char* unit, int digits = 3) {
  return value ? fmt::format("{:.{}g} {}", *value, digits, unit) : "none";
}

std::string table(const sweep::Summary& s, const sweep::DrawnPairs& drawn, double wall_s) {
  std::string text;
  const auto line = [&](const char* name, const std::string& value) {
    text += fmt::format("{:<12}{}\n", name, value);
  };
  line("pairs",
       fmt::format(
           "{} run; {} of {} draws too close to an obstacle, {} goals too close to their start",
           s.runs, drawn.near_draws, drawn.draws, drawn.close_goals));
  for (std::size_t i = 0; i < s.outcomes.size(); ++i)
    if (s.outcomes[i] > 0)
      line(std::string(log::to_string(static_cast<log::Outcome>(i))).c_str(),
           fmt::format("{} ({:.1f} %)", s.outcomes[i],
                       100.0 * static_cast<double>(s.outcomes[i]) / static_cast<double>(s.runs)));
  line("collisions", fmt::format("{}", s.count(log::Outcome::collision)));
  line("clearance", number(s.min_clearance_m, "m at least"));
  if (s.certified_share_mean)
    line("certified", fmt::format("{:.4f} % of the steps (mean), {:.4f} % at least",
                                  100.0 * *s.certified_share_mean, 100.0 * *s.certified_share_min));
  line("arrival", fmt::format("{} (median), {} (latest)", number(s.reached_time_s_median, "s"),
                              number(s.reached_time_s_max, "s")));
  line("tick", fmt::format("{} (median p50), {} (median p99), {} (largest p99)",
                           number(s.tick_us_p50_median, "us"), number(s.tick_us_p99_median, "us"),
                           number(s.tick_us_p99_max, "us")));
  line("time",
       fmt::format("{:.4g} s simulated, {:.3g} s cpu, {:.3g} s wall", s.time_s, s.cpu_s, wall_s));
  return text;
}

int sweep_pairs(const PairsOptions& options) {
  using clock = std::chrono::steady_clock;
  const scene::Scene scene = read_scene(options.file, options.flags);
  PairRecords records(options.output, options.file);
  const sweep::DrawnPairs drawn = [&] {
    const Phase phase("drawing pairs");
    return sweep::draw_pairs(scene, options.pairs);
  }();

  sweep::PairRuns runs;
  runs.plugin_directories = plugin_path(options.plugin_path);
  runs.plant_factory = plant_factory();
  runs.jobs = options.jobs;
  runs.stop = &stop_on_signals();
  const auto begin = clock::now();
  std::optional<Progress> progress(std::in_place, "pairs run");
  runs.on_result = [&](std::size_t index, const log::Result& result) {
    records.write(index, drawn.pairs[index], result);
    progress->show(static_cast<double>(index + 1), static_cast<double>(drawn.pairs.size()));
  };
  const auto results = [&] {
    const HangGuard guard;
    return sweep::run_pairs(scene, drawn.pairs, runs);
  }();
  progress.reset();
  const double wall_s = std::chrono::duration<double>(clock::now() - begin).count();

  const sweep::Summary summary = sweep::summarize(results);
  if (options.json) {
    Json document = sweep::to_json(summary);
    document["draws"] = {
        {"all", drawn.draws}, {"near", drawn.near_draws}, {"close_goals", drawn.close_goals}};
    document["timing"]["wall_s"] = wall_s;
    print_json(document);
  } else {
    report(table(summary, drawn, wall_s));
  }
  if (results.size() < drawn.pairs.size() || summary.count(log::Outcome::interrupted) > 0)
    return log::exit_code(log::Outcome::interrupted);
  const bool bad = summary.count(log::Outcome::collision) + summary.count(log::Outcome::diverged) +
                       summary.count(log::Outcome::defect) >
                   0;
  return bad ? 1 : 0;
}

}  // namespace

void add_sweep_pairs(CLI::App& sweep, int& exit_code) {
  auto* pairs = add_command(
      sweep, "pairs", "Run a scene between random pairs of collision-free configurations",
      "hamelin sweep pairs data/scenes/shelf.json --count 20\n"
      "hamelin sweep pairs data/scenes/shelf.json --count 20 --jobs 2 -o shelf.jsonl\n"
      "hamelin sweep pairs data/scenes/shelf.json --planner apf --json");
  const auto options = std::make_shared<PairsOptions>();
  pairs->add_option("scene", options->file, "scene file, whose start and goals are not used")
      ->required()
      ->type_name("SCENE.json");
  pairs->add_option("--count", options->pairs.count, "number of pairs of start and goal")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(1L, 1'000'000L));
  pairs->add_option("--seed", options->pairs.seed, "seed of the pairs")
      ->type_name("S")
      ->capture_default_str()
      ->check(unsigned_range());
  pairs
      ->add_option("--min-clearance", options->pairs.min_clearance_m,
                   "smallest clearance of start and goal [m]")
      ->type_name("D")
      ->capture_default_str();
  pairs
      ->add_option("--min-distance", options->pairs.min_distance_rad,
                   "smallest Euclidean joint distance of start and goal [rad]")
      ->type_name("D")
      ->capture_default_str();
  options->flags.duration_s = 20.0;
  pairs->add_option("--duration", options->flags.duration_s, "longest simulated time of a run [s]")
      ->type_name("T")
      ->capture_default_str();
  pairs->add_option("--jobs", options->jobs, "number of runs in parallel")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(1L, 1024L));
  pairs
      ->add_option("--planner", options->flags.planner,
                   "planner plugin, by name or path (default the scene's)")
      ->type_name("NAME|PATH");
  add_set_option(*pairs, options->flags.set,
                 "set one value of the scene, e.g. /map/file=cell.bt; may be repeated");
  add_plugin_path_option(*pairs, options->plugin_path);
  pairs->add_flag("--json", options->json, "print the summary as JSON");
  pairs->add_option("-o,--output", options->output, "write one JSON line per run")
      ->type_name("RECORDS.jsonl");
  pairs->callback([options, &exit_code] { exit_code = sweep_pairs(*options); });
}

}  // namespace hamelin::app
