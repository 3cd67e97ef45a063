#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/log/trajectory.hpp"
#include "hamelin/optimal/solve.hpp"
#include "hamelin/optimal/timed_motion.hpp"
#include "hamelin/optimal/world_clearance.hpp"
#include "output.hpp"
#include "scene_flags.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct OptimizeOptions {
  std::filesystem::path file;
  SceneFlags flags;
  std::string minimize = "effort", solver = "hamelin", format = "json";
  int intervals = 50, points = 2;
  double duration_s = 2.0, margin_m = 0.005;
  std::optional<double> acceleration, jerk, rate_hz;
  std::optional<std::filesystem::path> output;
};

// The arm's world, and how far clearances count.
constexpr double influence_m = 0.1;

optimal::Problem problem_of(const OptimizeOptions& options, const scene::Scene& scene,
                            const model::Model& model) {
  const Eigen::Index n = model.dof();
  optimal::Problem problem;
  problem.model = &model;
  problem.intervals = options.intervals;
  problem.objective =
      options.minimize == "time" ? optimal::Objective::time : optimal::Objective::effort;
  problem.duration_s = options.duration_s;
  const control::ModelledLimits limits = control::modelled_limits(scene, model.robot());
  problem.limits.position_min = limits.q_lower;
  problem.limits.position_max = limits.q_upper;
  problem.limits.velocity = limits.velocity_max;
  problem.limits.torque = limits.effort_max;
  if (options.acceleration)
    problem.limits.acceleration = Eigen::VectorXd::Constant(n, *options.acceleration);
  if (options.jerk) problem.limits.jerk = Eigen::VectorXd::Constant(n, *options.jerk);
  problem.margin_m = options.margin_m;
  problem.clearance_points = options.points;
  return problem;
}

int optimize(const OptimizeOptions& options) {
  const scene::Scene scene = read_scene(options.file, options.flags);
  const model::Model model = control::load_model(scene);
  control::WorldView view(scene, model, influence_m);
  optimal::WorldClearance clearance(model, view);
  optimal::Problem problem = problem_of(options, scene, model);
  problem.clearance = &clearance;
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.dof());
  problem.q_start = scene.start_q.size() > 0 ? scene.start_q : rest;
  problem.v_start = scene.start_v.size() > 0 ? scene.start_v : rest;
  problem.q_goal = scene.goals.back().q;
  problem.v_goal = rest;
  optimal::SolveOptions solve_options;
  if (options.solver == "ipopt") solve_options.solver = optimal::Solver::ipopt;
  const Eigen::MatrixXd& path = scene.goals.back().path;
  Eigen::MatrixXd ends(model.dof(), 1 + std::max<Eigen::Index>(1, path.cols()));
  ends.col(0) = problem.q_start;
  if (path.cols() > 0)
    ends.rightCols(path.cols()) = path;
  else
    ends.col(1) = problem.q_goal;
  const optimal::Solution found =
      optimal::solve(problem, optimal::guess_along(ends, problem.intervals), solve_options);
  const optimal::TimedMotion motion = optimal::motion_of(problem, found);
  const optimal::MotionProof proof = optimal::prove(motion, view);
  fmt::print(
      "{} {} iterations, cost {}, duration {} s, violation {}, stationarity {}, margin {} "
      "certified {}\n",
      found.converged ? "solved" : found.cause, found.iterations, found.cost, motion.duration_s(),
      found.violation, found.stationarity, proof.margin_m, proof.certified);
  return found.converged && proof.certified ? 0 : 1;
}

}  // namespace

void add_optimize(CLI::App& app, int& exit_code) {
  auto* command = add_command(
      app, "optimize", "Find the motion of least effort or time to the goals of a scene",
      "hamelin optimize data/scenes/shelf.json -o shelf-motion.json\n"
      "hamelin optimize data/scenes/shelf.json --minimize time --jerk 5000 -o fast.json");
  const auto options = std::make_shared<OptimizeOptions>();
  command->add_option("scene", options->file, "scene file")->required()->type_name("SCENE.json");
  restrict_values(command->add_option("--minimize", options->minimize, "effort, or time")
                      ->type_name("NAME")
                      ->capture_default_str(),
                  {"effort", "time"});
  restrict_values(command->add_option("--solver", options->solver, "hamelin, or ipopt")
                      ->type_name("NAME")
                      ->capture_default_str(),
                  {"hamelin", "ipopt"});
  command->add_option("--intervals", options->intervals, "number of intervals between knots")
      ->type_name("N")
      ->capture_default_str();
  command
      ->add_option("--duration", options->duration_s,
                   "time of the motion [s]; with --minimize time the first guess")
      ->type_name("T")
      ->capture_default_str();
  command->add_option("--margin", options->margin_m, "least clearance [m]")
      ->type_name("M")
      ->capture_default_str();
  command->add_option("--points", options->points);
  command->add_option("--acceleration", options->acceleration, "limit of all joints")
      ->type_name("A");
  command->add_option("--jerk", options->jerk, "limit of all joints")->type_name("J");
  command
      ->add_option("--set", options->flags.set,
                   "set one value of the scene, e.g. /planner/params/gain=2; may be repeated")
      ->type_name("/json/pointer=VALUE")
      ->allow_extra_args(false);
  command->add_option("-o,--output", options->output, "file to write (default: standard output)")
      ->type_name("FILE");
  command->callback([options, &exit_code] { exit_code = optimize(*options); });
}

}  // namespace hamelin::app
