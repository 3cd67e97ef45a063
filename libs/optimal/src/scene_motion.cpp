#include "hamelin/optimal/scene_motion.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "hamelin/control/plan_paths.hpp"
#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "refuse.hpp"

namespace hamelin::optimal {

using Eigen::Index;

namespace {

constexpr double usual_torque_share = 0.9;
// Motions keep so far away from joint limits where their ends do [rad or m]: beyond the limits
// there is no place for what feedback corrects.
constexpr double limit_distance = 0.01;

[[noreturn]] void refuse_scene(const scene::Scene& scene, const std::string& what) {
  throw Error(ErrorCode::invalid, scene.name + ": " + what);
}

void check_positive(const char* what, double x) {
  if (!(x > 0.0) || !std::isfinite(x))
    refuse(fmt::format("{}: {} given, expected a positive number", what, x));
}

// Of what a Problem does not check itself, or only after the map is read.
void check_options(const SceneMotionOptions& options) {
  const double share = options.limit_share.value_or(1.0);
  check_positive("share of the limits", share);
  if (share > 1.0) refuse(fmt::format("share of the limits: {} given, expected at most 1", share));
  if (!(options.margin_m >= 0.0) || !std::isfinite(options.margin_m))
    refuse(fmt::format("margin: {} given, expected a finite number that is not negative",
                       options.margin_m));
}

bool any(const scene::JointNumbers& numbers) {
  return numbers.from_robot || std::any_of(numbers.values.begin(), numbers.values.end(),
                                           [](double x) { return x != 0.0; });
}

void check_scene(const scene::Scene& scene, bool has_paths) {
  if (any(scene.model.joint_damping) || any(scene.model.friction))
    refuse_scene(scene,
                 "/model: damping or friction is modelled, expected neither: optimised motions "
                 "do not include it");
  if (scene.goals.empty()) refuse_scene(scene, "/goals: there is none, expected at least one");
  for (std::size_t i = 0; i < scene.goals.size(); ++i) {
    const auto type = scene.goals[i].type;
    if (type == scene::GoalType::follow)
      refuse_scene(scene,
                   fmt::format("/goals/{}: follows a target, expected a goal to arrive at", i));
    if (!scene.goals[i].may_touch.empty())
      refuse_scene(scene, fmt::format("/goals/{}/may_touch: is given, expected none: optimised "
                                      "motions keep away from all obstacles",
                                      i));
    if (const auto& goal = scene.goals[i];
        goal.way || goal.approach || goal.retreat || !goal.constraints.empty())
      refuse_scene(scene, fmt::format("/goals/{}/{}: is given, expected none: optimised motions do "
                                      "not keep it",
                                      i, scene::path_need(goal)));
    if (type != scene::GoalType::joint && !has_paths)
      refuse_scene(scene,
                   fmt::format("/goals/{}: is a {}, expected joint positions, or a guide that "
                               "finds them (--guide)",
                               i, scene::type_name(scene.goals[i])));
  }
}

MatrixXd way_points(const scene::Goal& goal, const VectorXd& from, const MatrixXd* path) {
  if (path != nullptr) return *path;
  MatrixXd out(from.size(), 1 + std::max<Index>(1, goal.path.cols()));
  out.col(0) = from;
  if (goal.path.cols() > 0)
    out.rightCols(goal.path.cols()) = goal.path;
  else
    out.col(1) = goal.q;
  return out;
}

}  // namespace

// The guess's speed is at most 15/8 of its mean, docs/theory.md (18.13).
double slow_duration(const MatrixXd& points, const VectorXd& velocity) {
  VectorXd travel = VectorXd::Zero(points.rows());
  for (Index i = 1; i < points.cols(); ++i)
    travel += (points.col(i) - points.col(i - 1)).cwiseAbs();
  double duration = 0.1;
  for (Index j = 0; j < travel.size(); ++j) {
    const double limit = velocity.size() > 0 && std::isfinite(velocity[j]) ? velocity[j] : 2.0;
    duration = std::max(duration, 15.0 / 8.0 * travel[j] / (0.5 * limit));
  }
  return duration;
}

SolveOptions solve_options(const SceneMotionOptions& options) {
  // the estimate of what is left to gain is far worse for efforts
  constexpr double of_time = 5e-3, of_effort = 1e-4, small_violation = 1e-3;
  const bool time = options.objective == Objective::time;
  SolveOptions out = options.solve;
  out.cost_tolerance = options.cost_tolerance.value_or(time ? of_time : of_effort);
  if (time && out.cost_tolerance > 0.0)
    out.violation_max = std::max(out.violation_max, small_violation);
  return out;
}

Problem problem_of(const scene::Scene& scene, const SceneMotionOptions& options,
                   const model::Model& model) {
  Problem problem;
  problem.model = &model;
  problem.objective = options.objective;
  problem.intervals = options.intervals;
  problem.margin_m = options.margin_m;
  problem.time_effort_weight = options.time_effort_weight;
  problem.clearance_points = 2;
  const control::ModelledLimits limits = control::modelled_limits(scene, model.robot());
  problem.limits.position_min = limits.q_lower;
  problem.limits.position_max = limits.q_upper;
  problem.limits.velocity = options.limit_share.value_or(1.0) * limits.velocity_max;
  problem.limits.torque = options.limit_share.value_or(usual_torque_share) * limits.effort_max;
  const Index n = model.dof();
  if (options.acceleration)
    problem.limits.acceleration = VectorXd::Constant(n, *options.acceleration);
  if (options.jerk) problem.limits.jerk = VectorXd::Constant(n, *options.jerk);
  return problem;
}

namespace {

// The paths along which the guesses go.
std::vector<MatrixXd> paths_of(const control::PathPlan& plan) {
  std::vector<MatrixXd> paths;
  for (const auto& goal : plan.goals) paths.push_back(goal.path.points);
  return paths;
}

// `q_lower`, `q_upper` of the joints.
void keep_off_limits(const VectorXd& q_lower, const VectorXd& q_upper, Problem& problem) {
  if (q_lower.size() == 0) return;
  const auto from = [&](const VectorXd& limit, double distance) -> VectorXd {
    return (limit.array() + distance).matrix();
  };
  problem.limits.position_min = from(q_lower, limit_distance)
                                    .cwiseMin(problem.q_start)
                                    .cwiseMin(problem.q_goal)
                                    .cwiseMax(q_lower);
  problem.limits.position_max = from(q_upper, -limit_distance)
                                    .cwiseMax(problem.q_start)
                                    .cwiseMax(problem.q_goal)
                                    .cwiseMin(q_upper);
}

// `paths`: for each goal way-points from the configuration before it, or empty: along the goals'
// own paths, or straight.
SceneMotion optimize_along(const scene::Scene& scene, const SceneMotionOptions& options,
                           const model::Model& model, control::WorldView& view,
                           const std::vector<MatrixXd>& paths) {
  SceneMotion out{scene.name, {}, {}, model, {}, scene.goals.size()};
  out.robot = out.model.robot().name;
  for (const auto& link : out.model.robot().links) out.joints.push_back(link.joint.name);
  const VectorXd rest = VectorXd::Zero(out.model.dof());
  VectorXd q = scene.start_q.size() > 0 ? scene.start_q : rest,
           v = scene.start_v.size() > 0 ? scene.start_v : rest;
  Problem problem = problem_of(scene, options, model);
  const VectorXd q_lower = problem.limits.position_min, q_upper = problem.limits.position_max;
  problem.v_goal = rest;
  const SolveOptions solve = solve_options(options);
  for (std::size_t i = 0; i < scene.goals.size(); ++i) {
    const MatrixXd points = way_points(scene.goals[i], q, i < paths.size() ? &paths[i] : nullptr);
    problem.q_start = q;
    problem.v_start = v;
    problem.begin_s = out.duration_s();
    problem.q_goal = points.rightCols<1>();
    keep_off_limits(q_lower, q_upper, problem);
    problem.duration_s =
        options.duration_s.value_or(slow_duration(points, problem.limits.velocity));
    try {
      out.goals.push_back({optimize(problem, points, view, solve)});
    } catch (const Error& e) {
      if (e.code() != ErrorCode::invalid) throw;
      refuse_scene(scene, fmt::format("/goals/{}: {}", i, e.what()));
    }
    q = problem.q_goal;
    v = rest;
    if (!out.goals.back().valid()) break;
  }
  return out;
}

// With how many seeds of the guide a motion is sought.
constexpr int seeds_max = 3;

// Whether the guesses go along searched paths: where the scene says so, and where a goal of the tip
// leaves open at which joint positions the arm ends.
bool uses_paths(const scene::Scene& scene) {
  return scene.guide.type == scene::GuideType::rrt_connect ||
         (scene.guide.type == scene::GuideType::on_request &&
          std::any_of(scene.goals.begin(), scene.goals.end(),
                      [](const scene::Goal& goal) { return goal.type != scene::GoalType::joint; }));
}

}  // namespace

SceneMotion optimize_scene(const scene::Scene& scene, const SceneMotionOptions& options) {
  const bool guided = uses_paths(scene);
  check_options(options);
  check_scene(scene, guided);
  const model::Model model = control::load_model(scene);
  if (!guided) {
    control::WorldView view(scene, model, influence_of(options.margin_m));
    return optimize_along(scene, options, model, view, {});
  }
  // Guide and optimisation use the same world, so that the map is read once.
  control::World::Options near;
  near.influence_m = influence_of(options.margin_m);
  control::World world(scene, model, near);
  const control::WorldView shown(scene, model, world);
  control::WorldView all(scene, model, shown);
  const control::PathPlan plan = control::plan_paths(scene, model, world);
  if (!plan.found())
    refuse_scene(scene, fmt::format("/goals/{}: no path was found: {}", plan.goals.size() - 1,
                                    plan.goals.back().path.cause));
  SceneMotion found = optimize_along(scene, options, model, all, paths_of(plan));
  // Where the guess leads to kinks that are not left again, that along another path may not.
  scene::Scene other = scene;
  for (int k = 1; k < seeds_max && !found.valid(); ++k) {
    ++other.seed;
    const control::PathPlan next = control::plan_paths(other, model, world);
    if (!next.found()) continue;
    try {
      SceneMotion tried = optimize_along(scene, options, model, all, paths_of(next));
      if (tried.valid()) found = std::move(tried);
    } catch (const Error& e) {  // its end, for a goal of the tip, is nearer than the margin
      if (e.code() != ErrorCode::invalid) throw;
    }
  }
  return found;
}

double SceneMotion::duration_s() const {
  double sum = 0.0;
  for (const auto& goal : goals) sum += goal.found.motion.duration_s();
  return sum;
}

std::vector<SceneMotion::Point> SceneMotion::points(std::optional<double> rate_hz) const {
  if (rate_hz) check_positive("rate", *rate_hz);
  std::vector<Point> out;
  dynamics::Workspace ws(model);
  double begun = 0.0, next = 0.0;
  for (const auto& goal : goals) {
    const TimedMotion& motion = goal.found.motion;
    const double end = begun + motion.duration_s();
    const auto add = [&](double time_s) {
      Point point{time_s, {}, {}, {}, VectorXd::Zero(model.dof())};
      motion.at(time_s - begun, point.q, point.v, point.a);
      dynamics::inverse_dynamics(model, ws, point.q, point.v, point.a, point.torque);
      out.push_back(std::move(point));
    };
    if (!rate_hz) {
      for (Index k = out.empty() ? 0 : 1; k <= motion.intervals(); ++k)
        add(begun + motion.step_s * static_cast<double>(k));
    } else {
      const bool last = &goal == &goals.back();
      for (; next < end - 1e-9; next = static_cast<double>(out.size()) / *rate_hz) add(next);
      if (last) add(end);
    }
    begun = end;
  }
  return out;
}

std::string cause_of(const Solution& solution) {
  const char* const between = solution.cause.empty() || solution.violated.empty() ? "" : "; ";
  return solution.cause + between +
         (solution.violated.empty() ? "" : "violated: " + solution.violated);
}

Json to_json(const SceneMotion& motion, const SceneMotionOptions& options,
             std::optional<double> rate_hz) {
  const auto numbers = [](const VectorXd& x) {
    return Json(std::vector<double>(x.data(), x.data() + x.size()));
  };
  const auto finite = [](double x) { return std::isfinite(x) ? Json(x) : Json(nullptr); };
  Json goals = Json::array(), points = Json::array();
  for (const auto& goal : motion.goals) {
    const Optimized& f = goal.found;
    goals.push_back({{"duration_s", f.motion.duration_s()},
                     {"cost", f.solution.cost},
                     {"converged", f.solution.converged},
                     {"cause", cause_of(f.solution)},
                     {"iterations", f.solution.iterations},
                     {"stationarity", finite(f.solution.stationarity)},
                     {"violation", finite(f.solution.violation)},
                     {"torque_share", finite(f.torque_share)},
                     {"certified", f.proof.certified},
                     {"margin_m", finite(f.proof.margin_m)},
                     {"clearance_points", f.clearance_points}});
  }
  for (const auto& point : motion.points(rate_hz))
    points.push_back({{"time_s", point.time_s},
                      {"q", numbers(point.q)},
                      {"v", numbers(point.v)},
                      {"a", numbers(point.a)},
                      {"tau", numbers(point.torque)}});
  return {{"schema", "hamelin.trajectory/1"},
          {"scene", motion.scene},
          {"robot", motion.robot},
          {"joints", motion.joints},
          {"minimize", options.objective == Objective::time ? "time" : "effort"},
          {"goals", std::move(goals)},
          {"points", std::move(points)}};
}

}  // namespace hamelin::optimal
