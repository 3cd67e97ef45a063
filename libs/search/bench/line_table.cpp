// hamelin_line_table [--lines N] [--changes N] SCENE...: for each scene, the time to build the
// map's distance field, and counts of what must never happen: lines that are proved clear although
// a sample every 0.002 rad is nearer than the margin, bounds above the exact distance, and fields
// that differ from a fresh one after changes of the map. The exit status is 1 if any was seen.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/core/isa.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/search/line_check.hpp"
#include "hamelin/test/robots.hpp"

namespace {

using namespace hamelin;
using Eigen::Vector3d;
using Eigen::VectorXd;
using Clock = std::chrono::steady_clock;

constexpr double sample_rad = 0.002, margin_most_m = 0.02;

double ms_since(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

double quantile(std::vector<double> x, double p) {
  if (x.empty()) return std::nan("");
  std::sort(x.begin(), x.end());
  return x[std::min(x.size() - 1, static_cast<std::size_t>(p * static_cast<double>(x.size())))];
}

scene::Environment environment_of(const scene::Scene& scene, const model::Model& arm) {
  return scene::make_environment(scene, arm, 0.2);
}

/// An arm in its scene, with random lines and their samples.
class Rig {
 public:
  explicit Rig(const scene::Scene& scene)
      : arm_(description::read_robot(scene.robot.file,
                                     {scene.robot.tip, scene.robot.spheres, scene.robot.srdf}),
             scene.base),
        self_(arm_),
        environment_(environment_of(scene, arm_)),
        line_(arm_, &self_),
        ws_(arm_),
        shapes_(arm_) {
    line_.set_environment(environment_, 0.0);
  }

  struct Counts {
    long proved = 0, wrong = 0;
    double check_us = 0.0;  ///< mean of a line
  };
  Counts compare(long lines, Rng& rng) {
    Counts out;
    for (long i = 0; i < lines; ++i) {
      const VectorXd a = test::random_within_limits(arm_, rng),
                     b = a + rng.uniform(0.02, 1.0) * (test::random_within_limits(arm_, rng) - a);
      const double margin = rng.uniform(0.0, margin_most_m);
      line_.set_margins(search::Margins(margin));
      const auto start = Clock::now();
      const bool proved = line_.motion_clear(a, b);
      out.check_us += 1e3 * ms_since(start);
      if (!proved) continue;
      ++out.proved;
      if (!samples_clear(a, b, margin)) ++out.wrong;
    }
    out.check_us /= static_cast<double>(std::max(1L, lines));
    return out;
  }

  /// How often a bound is above the exact distance from the map.
  long bounds_above(long points, Rng& rng) const {
    const auto field = environment_.distance_field();
    if (!field || !environment_.unknown_field().empty()) return 0;
    const double reach = 1.2 * arm_.reach();
    long above = 0;
    for (long i = 0; i < points; ++i) {
      const Vector3d p =
          environment_.map_pose().inverse() *
          (arm_.base() * Vector3d(rng.uniform(-reach, reach), rng.uniform(-reach, reach),
                                  rng.uniform(-reach, reach)));
      std::int32_t hint = -1;
      const double exact = environment_.map_field().distance(p, p, 100.0, hint);
      above += field->lower_bound(p) > exact ? 1 : 0;
    }
    return above;
  }

  [[nodiscard]] const model::Model& arm() const { return arm_; }
  [[nodiscard]] const scene::Environment& environment() const { return environment_; }

 private:
  bool samples_clear(const VectorXd& a, const VectorXd& b, double margin) {
    const auto count = static_cast<int>(std::ceil((b - a).norm() / sample_rad)) + 1;
    for (int i = 0; i <= count; ++i) {
      dynamics::forward_kinematics(arm_, ws_, a + static_cast<double>(i) / count * (b - a));
      shapes_.place(arm_, ws_);
      const double limit = margin + 0.01;
      if (environment_.clearance(shapes_.view(), 0.0, limit) <= margin) return false;
      for (std::size_t pair = 0; pair < self_.pairs().size(); ++pair)
        if (self_.distance(pair, shapes_.view(), limit) <= margin) return false;
    }
    return true;
  }

  model::Model arm_;
  scene::SelfField self_;
  scene::Environment environment_;
  search::LineCheck line_;
  dynamics::Workspace ws_;
  scene::PlacedShapes shapes_;
};

/// Random changes of a map, after which its field is compared with one of the voxels it has then.
struct Changes {
  std::vector<double> ms;  ///< of each
  long different = 0;

  void run(scene::Environment environment, double resolution_m, long count, Rng& rng) {
    constexpr long compare_every = 500;
    environment.prepare_field();
    const auto corner = [&] { return resolution_m * std::floor(rng.uniform(-40.0, 40.0)); };
    const auto box = [&] {
      const Vector3d lo(corner(), corner(), corner());
      return scene::Box{lo, lo + resolution_m * Vector3d(1.0 + std::floor(rng.uniform(0.0, 8.0)),
                                                         1.0 + std::floor(rng.uniform(0.0, 8.0)),
                                                         1.0 + std::floor(rng.uniform(0.0, 8.0)))};
    };
    for (long i = 1; i <= count; ++i) {
      scene::MapChangeSpec change;
      (i % 2 == 0 ? change.free_m : change.occupied_m).push_back(box());
      const auto start = Clock::now();
      environment = environment.with_change(change);
      ms.push_back(ms_since(start));
      if (i % compare_every == 0 || i == count) different += equal(environment) ? 0 : 1;
    }
  }

  static bool equal(const scene::Environment& environment) {
    std::vector<scene::VoxelBox> voxels;
    const double resolution_m = environment.summary().resolution_m;
    for (const auto* part : {&environment.map_field(), &environment.unknown_field()})
      part->boxes().for_each_alive(
          [&](const scene::Box& box) { voxels.push_back(scene::to_voxels(box, resolution_m)); });
    const auto fresh = scene::DistanceField::make(voxels, resolution_m);
    const auto kept = environment.distance_field();
    if (!fresh || !kept) return !fresh && !kept;
    const auto a = fresh->view(), b = kept->view();
    return a.lo == b.lo && a.count == b.count &&
           std::equal(a.values,
                      a.values + static_cast<std::ptrdiff_t>(a.count[0]) * a.count[1] * a.count[2],
                      b.values);
  }
};

double build_ms(const scene::Scene& scene, const model::Model& arm) {
  std::vector<double> ms;
  for (int i = 0; i < 5; ++i) {
    const scene::Environment environment = environment_of(scene, arm);
    const auto start = Clock::now();
    environment.prepare_field();
    ms.push_back(ms_since(start));
  }
  return quantile(ms, 0.5);
}

int run(int argc, char** argv) {
  long lines = 10000, changes = 1000, bad = 0;
  std::vector<std::string> files;
  for (int i = 1; i < argc; ++i) {
    const std::string arg = argv[i];
    if (arg == "--lines" && i + 1 < argc)
      lines = std::atol(argv[++i]);
    else if (arg == "--changes" && i + 1 < argc)
      changes = std::atol(argv[++i]);
    else
      files.push_back(arg);
  }
  fmt::print("instruction set {}\n", name_of(default_isa()));
  constexpr const char* row =
      "{:<28} {:>9} {:>7} {:>9} {:>8} {:>7} {:>8} {:>8} {:>7} {:>10} {:>9}\n";
  fmt::print(row, "scene", "build ms", "MB", "lines", "proved", "wrong", "us/line", "bounds >",
             "changes", "p50/p95 ms", "different");
  for (const std::string& file : files) {
    const scene::Scene scene = scene::read_scene(file);
    Rng rng(1);
    Rig rig(scene);
    const Rig::Counts counts = rig.compare(lines, rng);
    const long above = rig.bounds_above(lines, rng);
    const scene::Environment& environment = rig.environment();
    Changes changed;
    if (scene.map) changed.run(environment, environment.summary().resolution_m, changes, rng);
    const auto field = environment.distance_field();
    fmt::print(row, std::filesystem::path(file).stem().string(),
               fmt::format("{:.1f}", build_ms(scene, rig.arm())),
               fmt::format("{:.1f}", field ? 1e-6 * static_cast<double>(field->bytes()) : 0.0),
               lines, counts.proved, counts.wrong, fmt::format("{:.1f}", counts.check_us), above,
               changed.ms.size(),
               fmt::format("{:.1f}/{:.1f}", quantile(changed.ms, 0.5), quantile(changed.ms, 0.95)),
               changed.different);
    bad += counts.wrong + above + changed.different;
  }
  return bad == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 2;
  }
}
