#include <fmt/format.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/geometric/PathGeometric.h>
#include <ompl/geometric/PathSimplifier.h>
#include <ompl/util/Console.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <ctime>
#include <string>
#include <vector>

#include "guide/guide_query.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"

// hamelin_guide_table [--seeds N] [--only GUIDE] [--certified] [--list] SCENE...: searches a path
// to the first goal of each scene with each guide, with certified checks and with sampled ones, and
// prints how many were found, CPU times, checks and lengths. OMPL's simplification of the same path
// is the reference of lengths.
namespace {

using namespace hamelin;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

double cpu_s() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

/// The same world with motions that are sampled, as OMPL does by default.
class SampledQuery final : public search::Query {
 public:
  SampledQuery(control::GuideQuery& exact, double per_rad) : exact_(exact), per_rad_(per_rad) {}
  double clearance(const VectorXd& q, double at_least_m) override {
    return exact_.clearance(q, at_least_m);
  }
  bool posture_clear(const VectorXd& q, double margin_m) override {
    return exact_.posture_clear(q, margin_m);
  }
  bool motion_clear(const VectorXd& a, const VectorXd& b, double margin_m) override {
    const int n = std::max(1, static_cast<int>(std::ceil(per_rad_ * (b - a).norm())));
    for (int i = n; i >= 0; --i) {
      const VectorXd q = a + static_cast<double>(i) / n * (b - a);
      if (!posture_clear(q, margin_m)) return false;
    }
    return true;
  }
  long checks() const override { return exact_.checks(); }

 private:
  control::GuideQuery& exact_;
  double per_rad_;
};

struct Rig {
  explicit Rig(const std::string& file)
      : scene(scene::read_scene(file)),
        arm(control::load_model(scene)),
        world(scene, arm, {}),
        view(scene, arm, world),
        query(arm, world, view) {}
  scene::Scene scene;
  model::Model arm;
  control::World world;
  control::WorldView view;
  control::GuideQuery query;
};

namespace ob = ompl::base;
namespace og = ompl::geometric;

class Motions final : public ob::MotionValidator {
 public:
  Motions(const ob::SpaceInformationPtr& info, Rig& rig, double margin)
      : MotionValidator(info), rig_(rig), margin_(margin) {}
  bool checkMotion(const ob::State* a, const ob::State* b) const override {
    return rig_.query.motion_clear(vector(a), vector(b), margin_);
  }
  bool checkMotion(const ob::State* a, const ob::State* b,
                   std::pair<ob::State*, double>& last) const override {
    last.second = 0.0;
    return checkMotion(a, b);
  }
  [[nodiscard]] VectorXd vector(const ob::State* state) const {
    return VectorXd::Map(state->as<ob::RealVectorStateSpace::StateType>()->values, rig_.arm.dof());
  }

 private:
  Rig& rig_;
  double margin_;
};

/// The length of OMPL's own simplification of a path with our proofs.
double simplified_length(Rig& rig, const MatrixXd& points, double margin) {
  const auto n = static_cast<unsigned>(points.rows());
  auto space = std::make_shared<ob::RealVectorStateSpace>(n);
  space->setBounds(-10.0, 10.0);
  auto info = std::make_shared<ob::SpaceInformation>(space);
  info->setStateValidityChecker([&](const ob::State* state) {
    return rig.query.posture_clear(
        VectorXd::Map(state->as<ob::RealVectorStateSpace::StateType>()->values, n), margin);
  });
  info->setMotionValidator(std::make_shared<Motions>(info, rig, margin));
  info->setup();
  og::PathGeometric path(info);
  ob::ScopedState<ob::RealVectorStateSpace> state(info);
  for (Index i = 0; i < points.cols(); ++i) {
    for (Index k = 0; k < points.rows(); ++k) state->values[k] = points(k, i);
    path.append(state.get());
  }
  og::PathSimplifier simplifier(info);
  simplifier.simplifyMax(path);
  return path.length();
}

double quantile(std::vector<double> x, double p) {
  if (x.empty()) return std::nan("");
  std::sort(x.begin(), x.end());
  return x[static_cast<std::size_t>(
      std::min(std::floor(p * static_cast<double>(x.size())), static_cast<double>(x.size() - 1)))];
}

struct Figures {
  int searches = 0, found = 0, certified = 0;
  std::vector<double> first_ms, time_ms, first_checks, length, simplified, ratio;
  double all_s = 0.0, all_checks = 0.0;
};

bool certified(Rig& rig, const MatrixXd& points) {
  for (Index i = 0; i + 1 < points.cols(); ++i)
    if (!(rig.query.proved_clearance(points.col(i), points.col(i + 1)) > 0.0)) return false;
  return points.cols() > 0;
}

void print(const std::string& name, const Figures& f) {
  fmt::print(
      "{:<18} {:<9} {:>4}/{:<4} {:>5} {:>8.2f} {:>8.2f} {:>8.2f} {:>8.2f} {:>8.0f} {:>8.2f} "
      "{:>7.2f} {:>7.2f} {:>6.2f}\n",
      name.substr(0, name.find(' ')), name.substr(name.find(' ') + 1), f.found, f.searches,
      f.certified, quantile(f.first_ms, 0.5), quantile(f.first_ms, 0.95), quantile(f.time_ms, 0.5),
      quantile(f.time_ms, 0.95), quantile(f.first_checks, 0.5), 1e6 * f.all_s / f.all_checks,
      quantile(f.length, 0.5), quantile(f.simplified, 0.5), quantile(f.ratio, 0.5));
}

int run(int argc, char** argv) {
  int seeds = 1;
  bool list = false, only_certified = false;
  std::string only;
  std::vector<std::string> files;
  for (int i = 1; i < argc; ++i) {
    const std::string arg = argv[i];
    if (arg == "--seeds" && i + 1 < argc)
      seeds = std::atoi(argv[++i]);
    else if (arg == "--only" && i + 1 < argc)
      only = argv[++i];
    else if (arg == "--certified")
      only_certified = true;
    else if (arg == "--list")
      list = true;
    else
      files.push_back(arg);
  }
  ompl::msg::setLogLevel(ompl::msg::LOG_NONE);
  std::vector<std::unique_ptr<Rig>> rigs;
  for (const auto& file : files) rigs.push_back(std::make_unique<Rig>(file));
  fmt::print("{:<18} {:<9} {:>9} {:>5} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>7} {:>7} {:>6}\n",
             "guide", "checks", "found", "cert.", "p50 ms", "p95 ms", "all p50", "all p95",
             "p50 chk", "us/chk", "length", "OMPL's", "ratio");
  for (const auto type :
       {scene::GuideType::rrt_connect, scene::GuideType::rrt, scene::GuideType::rrt_star,
        scene::GuideType::bit_star, scene::GuideType::informed_rrt_star}) {
    if (!only.empty() && only != to_string(type)) continue;
    for (const bool sampled : {false, true}) {
      if (sampled && only_certified) continue;
      Figures f;
      for (auto& rig : rigs)
        for (int seed = 1; seed <= seeds; ++seed) {
          scene::Scene& scene = rig->scene;
          scene.guide.type = type;
          scene.guide.improve_checks = 0;
          search::Settings settings = control::guide_settings(
              scene, rig->arm, rig->view, {}, scene.planner ? scene.planner->params : Json());
          settings.seed = static_cast<std::uint64_t>(seed);
          const search::Guide guide(rig->arm, settings);
          settings.shortens = false;
          const search::Guide first(rig->arm, settings);
          rig->query.refresh(0.0);
          SampledQuery sampling(rig->query, 32.0);
          search::Query& query = sampled ? static_cast<search::Query&>(sampling) : rig->query;
          const search::Problem problem{scene.start_q, scene.goals.front(), 1};
          const double since = cpu_s();
          (void)first.search(problem, query);
          const double first_time = cpu_s() - since;
          const search::Path path = guide.search(problem, query);
          const double time = cpu_s() - since - first_time;
          ++f.searches;
          f.all_s += time;
          f.all_checks += static_cast<double>(path.checks);
          double reference = 0.0;
          if (path.found() && !sampled)
            reference = simplified_length(*rig, path.planned, settings.least_m);
          if (list)
            fmt::print(
                "  {} {}: {} in {:.2f} ms, {} checks, {} until the first path, {} roots, margin "
                "{:.4f} m, length {:.3f}, OMPL's {:.3f} {}\n",
                scene.name, to_string(type), path.found() ? "found" : "not found", 1e3 * time,
                path.checks, path.first_checks, path.roots, path.margin_m, path.length, reference,
                path.cause);
          if (!path.found()) continue;
          ++f.found;
          f.certified += certified(*rig, path.points) ? 1 : 0;
          f.first_ms.push_back(1e3 * first_time);
          f.time_ms.push_back(1e3 * time);
          f.first_checks.push_back(static_cast<double>(path.first_checks));
          f.length.push_back(path.length);
          if (!sampled) {
            f.simplified.push_back(reference);
            f.ratio.push_back(path.length / f.simplified.back());
          }
        }
      print(fmt::format("{} {}", to_string(type), sampled ? "sampled" : "certified"), f);
    }
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
