#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <memory>
#include <string>
#include <vector>

#include "exact_query.hpp"
#include "guide/guide_query.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/core/rng.hpp"
#include "ompl_search.hpp"

// hamelin_search_peers [--isa NAME] [--seeds N] [--improve N] [--changes N] [--list] [--peers A,B]
// [--exact] SCENE...: searches a path to the first goal of each scene by libs/search, and by OMPL's
// planners on the same proofs of motions, or with --exact on proofs by exact distances alone;
// `--peers none`: by ours only. Prints how many were found, CPU times until the first path and with
// shortening, checks and lengths. OMPL is given the configuration at which our path ends, and so
// needs no inverse kinematics. With --changes, boxes appear on the paths and disappear, as often
// for each scene and seed; the table shows the searches of new paths.
namespace {

using namespace hamelin;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double cpu_s() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

struct Rig {
  explicit Rig(const std::string& file)
      : scene(scene::read_scene(file)),
        arm(control::load_model(scene)),
        world(scene, arm, {}),
        view(scene, arm, world),
        query(arm, world, view),
        settings(control::guide_settings(scene, arm, view, {},
                                         scene.planner ? scene.planner->params : Json())),
        box(arm.dof(), settings.q_lower, settings.q_upper, 1e-3) {}
  scene::Scene scene;
  model::Model arm;
  control::World world;
  control::WorldView view;
  control::GuideQuery query;
  search::Settings settings;
  dynamics::JointBox box;
};

double quantile(std::vector<double> x, double p) {
  if (x.empty()) return std::nan("");
  std::sort(x.begin(), x.end());
  const double at = std::floor(p * static_cast<double>(x.size()));
  return x[static_cast<std::size_t>(std::min(at, static_cast<double>(x.size() - 1)))];
}

struct Figures {
  int searches = 0, found = 0;
  std::vector<double> first_ms, time_ms, checks, length;
  void add(bool was_found, double first_s, double all_s, long used, double path_length) {
    ++searches;
    if (!was_found) return;
    ++found;
    first_ms.push_back(1e3 * first_s);
    time_ms.push_back(1e3 * all_s);
    checks.push_back(static_cast<double>(used));
    length.push_back(path_length);
  }
};

void print(const std::string& name, const Figures& f) {
  fmt::print(
      "{:<16} {:>4}/{:<4} {:>7.3f} {:>7.3f} {:>7.3f} {:>8.3f} | {:>7.3f} {:>7.3f} {:>8.3f} "
      "{:>8.0f} {:>7.3f}\n",
      name, f.found, f.searches, quantile(f.first_ms, 0.5), quantile(f.first_ms, 0.75),
      quantile(f.first_ms, 0.95), quantile(f.first_ms, 1.0), quantile(f.time_ms, 0.5),
      quantile(f.time_ms, 0.95), quantile(f.time_ms, 1.0), quantile(f.checks, 0.5),
      quantile(f.length, 0.5));
}

struct Options {
  int seeds = 1, changes = 0;
  long improve = 0;
  bool list = false, exact = false;
  std::string peers;
};

search::Settings settings_of(const Rig& rig, int seed, const Options& options) {
  search::Settings settings = rig.settings;
  settings.seed = static_cast<std::uint64_t>(seed);
  settings.improve_checks = options.improve;
  return settings;
}

// What slices of one check took [us].
void print_slices(std::vector<double> us) {
  const auto slow = std::count_if(us.begin(), us.end(), [](double x) { return x > 50.0; });
  fmt::print(
      "slices of one check: {}, p50 {:.1f} us, p99 {:.1f}, p99.9 {:.1f}, largest {:.1f}, above 50 "
      "us: {}\n",
      us.size(), quantile(us, 0.5), quantile(us, 0.99), quantile(us, 0.999), quantile(us, 1.0),
      slow);
}

/// A search in slices of one check.
struct Timed {
  search::Path path;
  double first_s = 0.0, all_s = 0.0;
  std::vector<double> slices_us;
};

// From the start of the scene to its first goal.
Timed search_timed(Rig& rig, int seed, const Options& options, const MatrixXd& known = {}) {
  Timed out;
  search::Search search(rig.arm, settings_of(rig, seed, options));
  rig.query.refresh(0.0);
  const double since = cpu_s();
  search.begin({rig.scene.start_q, {rig.scene.goals.front()}, 1, known}, rig.query);
  double at = since;
  for (bool ended = false; !ended;) {
    ended = search.advance(1);
    const double now = cpu_s();
    out.slices_us.push_back(1e6 * (now - at));
    at = now;
    if (out.first_s == 0.0 && search.path().planned.cols() > 0) out.first_s = now - since;
  }
  out.all_s = at - since;
  out.path = search.path();
  return out;
}

// The same search three times: the shortest time of each slice counts, since the others contain
// what else the machine did. The times of the whole search are those of the first.
search::Path search_ours(Rig& rig, int seed, const Options& options, Figures& figures,
                         std::vector<double>& slices_us) {
  Timed first = search_timed(rig, seed, options);
  const search::Path& path = first.path;
  figures.add(path.found(), first.first_s, first.all_s, path.checks, path.length);
  for (int repeat = 1; repeat < 3; ++repeat) {
    const Timed again = search_timed(rig, seed, options);
    for (std::size_t i = 0; i < again.slices_us.size(); ++i)
      first.slices_us.at(i) = std::min(first.slices_us.at(i), again.slices_us[i]);
  }
  slices_us.insert(slices_us.end(), first.slices_us.begin(), first.slices_us.end());
  if (options.list)
    fmt::print(
        "  {} seed {}: {:.3f} and {:.3f} ms, {} checks, {} roots, margin {:.4f} m, {:.3f} {}\n",
        rig.scene.name, seed, 1e3 * first.first_s, 1e3 * first.all_s, path.checks, path.roots,
        path.margin_m, path.length, path.cause);
  return path;
}

void search_theirs(Rig& rig, search::Query& query, const std::string& planner, int seed,
                   const search::Path& ours, Figures& figures) {
  search::Margins margins(ours.margin_m);
  const VectorXd start = rig.scene.start_q, goal = ours.points.rightCols(1);
  for (const VectorXd& q : {start, goal})
    margins.add(q, std::max(0.5e-3, query.clearance(q, -1.0) - rig.settings.slack_m), 0.2, 0.9);
  query.set_margins(margins);
  const auto search = [&](bool simplifies) {
    return peers::ompl_search({planner, rig.box, start, goal, query,
                               static_cast<std::uint64_t>(seed), rig.settings.checks_max},
                              simplifies);
  };
  const long before = query.checks();
  const double since = cpu_s();
  const MatrixXd first = search(false);
  const double first_s = cpu_s() - since;
  const MatrixXd path = search(true);
  figures.add(path.cols() > 0, first_s, cpu_s() - since - first_s, query.checks() - before,
              search::path_length(path));
}

/// What happens where the map changes on a path.
struct Reaction {
  std::vector<double> publish_ms;  ///< the change of the world, on whichever thread makes it
  Figures searches;                ///< from the change on
};

// A box of 6 cm appears where the tip is at a random place of the path, unless start or goal would
// touch it, and the search begins again at its start; then the map is as it was.
void change_map(Rig& rig, const search::Path& path, int seed, const Options& options, Rng& rng,
                Reaction& reaction) {
  constexpr double half_m = 0.03;
  dynamics::Workspace ws(rig.arm);
  for (int i = 0; i < options.changes; ++i) {
    const auto line =
        static_cast<Eigen::Index>(rng.uniform(0.0, static_cast<double>(path.points.cols() - 1)));
    const VectorXd from = path.points.col(line), to = path.points.col(line + 1);
    dynamics::forward_kinematics(rig.arm, ws, from + rng.uniform(0.2, 0.8) * (to - from));
    const Eigen::Vector3d tip = rig.scene.map->pose.inverse() * dynamics::tip_pose(rig.arm, ws).p();
    const Eigen::Vector3d half = Eigen::Vector3d::Constant(half_m);
    scene::MapChangeSpec appear;
    appear.occupied_m = {{tip - half, tip + half}};
    const double published = cpu_s();
    rig.world.change_map(appear);
    reaction.publish_ms.push_back(1e3 * (cpu_s() - published));
    rig.query.refresh(0.0);
    const VectorXd goal = path.points.rightCols(1);
    if (std::min(rig.query.clearance(rig.scene.start_q, 0.0), rig.query.clearance(goal, 0.0)) >
        0.0) {
      const Timed next = search_timed(rig, seed, options, path.points);
      reaction.searches.add(next.path.found(), next.first_s, next.all_s, next.path.checks,
                            next.path.length);
    }
    rig.world.set_map(rig.scene.map);  // not the box alone: it may have covered voxels of the map
    rig.query.refresh(0.0);            // makes the field that the next change is to follow
  }
}

Options read(int argc, char** argv, std::vector<std::unique_ptr<Rig>>& rigs) {
  Options out;
  for (int i = 1; i < argc; ++i) {
    const std::string arg = argv[i];
    if (arg == "--isa" && i + 1 < argc)  // before the scenes
      set_default_isa(isa_from_name(argv[++i], "--isa"));
    else if (arg == "--exact")
      out.exact = true;
    else if (arg == "--seeds" && i + 1 < argc)
      out.seeds = std::atoi(argv[++i]);
    else if (arg == "--improve" && i + 1 < argc)
      out.improve = std::atol(argv[++i]);
    else if (arg == "--changes" && i + 1 < argc)
      out.changes = std::atoi(argv[++i]);
    else if (arg == "--peers" && i + 1 < argc)
      out.peers = fmt::format(",{},", argv[++i]);
    else if (arg == "--list")
      out.list = true;
    else
      rigs.push_back(std::make_unique<Rig>(arg));
  }
  return out;
}

int run(int argc, char** argv) {
  std::vector<std::unique_ptr<Rig>> rigs;
  const Options options = read(argc, argv, rigs);
  fmt::print("instruction set {}\n", name_of(default_isa()));
  fmt::print("{:<16} {:>9} {:>7} {:>7} {:>7} {:>8} | {:>7} {:>7} {:>8} {:>8} {:>7}\n", "search",
             "found", "p50 ms", "p75", "p95", "max", "all p50", "p95", "max", "checks", "length");
  Figures ours;
  std::vector<search::Path> paths;
  std::vector<double> slices_us;
  for (auto& rig : rigs)
    for (int seed = 1; seed <= options.seeds; ++seed)
      paths.push_back(search_ours(*rig, seed, options, ours, slices_us));
  print("hamelin", ours);
  print_slices(std::move(slices_us));
  const auto for_paths = [&](const auto& call) {
    auto path = paths.begin();
    for (auto& rig : rigs)
      for (int seed = 1; seed <= options.seeds; ++seed, ++path)
        if (path->found()) call(*rig, seed, *path);
  };
  if (options.changes > 0) {
    Reaction reaction;
    Rng rng(1);
    for_paths([&](Rig& rig, int seed, const search::Path& path) {
      if (rig.scene.map) change_map(rig, path, seed, options, rng, reaction);
    });
    print("map changes", reaction.searches);
    fmt::print("publishing a change: p50 {:.2f} ms, p95 {:.2f}, largest {:.2f}\n",
               quantile(reaction.publish_ms, 0.5), quantile(reaction.publish_ms, 0.95),
               quantile(reaction.publish_ms, 1.0));
  }
  for (const std::string& planner : peers::ompl_planners()) {
    if (!options.peers.empty() && options.peers.find("," + planner + ",") == std::string::npos)
      continue;
    Figures theirs;
    for_paths([&](Rig& rig, int seed, const search::Path& path) {
      if (!options.exact) return search_theirs(rig, rig.query, planner, seed, path, theirs);
      peers::ExactQuery exact(rig.query, rig.arm, rig.view.self_field(),
                              rig.world.latest()->environment);
      search_theirs(rig, exact, planner, seed, path, theirs);
    });
    print(planner, theirs);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const Error& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 2;
  }
}
