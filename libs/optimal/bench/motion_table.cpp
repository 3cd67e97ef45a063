#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <vector>

#include "execution.hpp"
#include "guide/guide_query.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/optimal/scene_motion.hpp"
#include "hamelin/optimal/world_clearance.hpp"
#ifdef HAMELIN_HAS_IPOPT
#include "ipopt_solver.hpp"
#include "trapezoidal.hpp"
#endif

// hamelin_motion_table [--only banded|trapezoidal] [--least effort|time] [--intervals N]
// SCENE...: optimises the motion to the first goal of each scene, along the path of its guide
// (rrt-connect without one), and prints cost, time, iterations, CPU time of the solver, violation,
// certificate, and the error if the torques move the arm.
namespace {

using namespace hamelin;
using namespace hamelin::optimal;

double cpu_s() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

struct Row {
  double cost = 0.0, time_s = 0.0, cpu_s = 0.0, violation = 0.0, error = 0.0;
  int iterations = 0;
  bool converged = false;
  const char* certified = "-";
};

struct Case {
  const Problem& problem;
  const MatrixXd& points;
  control::WorldView& view;
};

Row by_splines(const Case& c) {
  SceneMotionOptions wanted;
  wanted.objective = c.problem.objective;
  const SolveOptions options = solve_options(wanted);
  Row row;
  const double since = cpu_s();
  const Optimized found = optimize(c.problem, c.points, c.view, options);
  row.cpu_s = cpu_s() - since;
  row.cost = found.solution.cost;
  row.time_s = found.motion.duration_s();
  row.violation = found.solution.violation;
  row.iterations = found.iterations;
  row.converged = found.solution.converged;
  row.certified = found.proof.certified ? "yes" : "no";
  row.error = motion_error(c.problem, found.solution);
  return row;
}

#ifdef HAMELIN_HAS_IPOPT
Row by_trapezoidal_collocation(const Case& c) {
  Problem problem = c.problem;
  WorldClearance clearance(*problem.model, c.view);
  if (clearance.rows() > 0) problem.clearance = &clearance;
  Trapezoidal program(problem);
  Row row;
  const double since = cpu_s();
  const IpoptResult found = solve_by_ipopt(
      program, program.guess(guess_along(c.points, problem.intervals)), SolveOptions{});
  row.cpu_s = cpu_s() - since;
  row.cost = program.cost();
  row.time_s = program.step_s() * problem.intervals;
  row.violation = program.violation();
  row.iterations = found.iterations;
  row.converged = found.converged;
  row.error = executed_error(problem, program.torques(), program.step_s(), false);
  return row;
}
#endif

void print(const std::string& scene, const char* least, const char* method, const Row& row) {
  fmt::print("{:<28} {:<7} {:<12} {:>9.5f} {:>8.4f} {:>6} {:>9.3f} {:>9.1e} {:>6} {:>9.1e}  {}\n",
             scene, least, method, row.cost, row.time_s, row.iterations, row.cpu_s, row.violation,
             row.certified, row.error, row.converged ? "optimal" : "not proved optimal");
  std::fflush(stdout);
}

MatrixXd guide_path(const scene::Scene& scene, const model::Model& arm) {
  control::World world(scene, arm, {});
  const control::WorldView view(scene, arm, world);
  control::GuideQuery query(arm, world, view);
  search::Search search(
      arm, control::guide_settings(scene, arm, view, {},
                                   scene.planner ? scene.planner->params : Json::object()));
  query.refresh(0.0);
  const search::Path path = search.search({scene.start_q, {scene.goals.front()}, 1}, query);
  if (!path.found())
    throw Error(ErrorCode::invalid, scene.name + ": /goals/0: no path found: " + path.cause);
  return path.points;
}

struct Options {
  std::string only, least;
  int intervals = 50;
  std::vector<std::string> files;
};

void tabulate(const std::string& file, const Options& options) {
  scene::Scene scene = scene::read_scene(file);
  if (scene.guide.type == scene::GuideType::none) scene.guide.type = scene::GuideType::rrt_connect;
  if (scene.goals.empty()) throw Error(ErrorCode::invalid, file + ": /goals: there is none");
  const model::Model arm = control::load_model(scene);
  const MatrixXd points = guide_path(scene, arm);
  control::WorldView view(scene, arm, influence_of(SceneMotionOptions{}.margin_m));
  for (const auto objective : {Objective::effort, Objective::time}) {
    const char* const least = objective == Objective::time ? "time" : "effort";
    if (!options.least.empty() && options.least != least) continue;
    SceneMotionOptions wanted;
    wanted.objective = objective;
    wanted.intervals = options.intervals;
    Problem problem = problem_of(scene, wanted, arm);
    problem.q_start = points.leftCols<1>();
    problem.q_goal = points.rightCols<1>();
    problem.v_start = problem.v_goal = VectorXd::Zero(arm.dof());
    problem.duration_s = slow_duration(points, problem.limits.velocity);
    if (problem.limits.torque.size() > 0 && problem.limits.torque.allFinite())
      problem.effort_weights = problem.limits.torque.cwiseAbs2().cwiseInverse();
    const Case c{problem, points, view};
    const auto wants = [&](const char* method) {
      return options.only.empty() || options.only == method;
    };
    if (wants("banded")) print(scene.name, least, "banded", by_splines(c));
#ifdef HAMELIN_HAS_IPOPT
    if (wants("trapezoidal"))
      print(scene.name, least, "trapezoidal", by_trapezoidal_collocation(c));
#endif
  }
}

int run(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const bool has_value = i + 1 < argc;
    if (argument == "--only" && has_value)
      options.only = argv[++i];
    else if (argument == "--least" && has_value)
      options.least = argv[++i];
    else if (argument == "--intervals" && has_value)
      options.intervals = std::atoi(argv[++i]);
    else
      options.files.push_back(argument);
  }
  if (options.files.empty())
    throw Error(ErrorCode::usage, "hamelin_motion_table: no scene given, expected SCENE...");
  fmt::print("{:<28} {:<7} {:<12} {:>9} {:>8} {:>6} {:>9} {:>9} {:>6} {:>9}\n", "scene", "least",
             "method", "cost", "time, s", "iter.", "CPU, s", "violated", "clear", "error");
  for (const auto& file : options.files) tabulate(file, options);
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
