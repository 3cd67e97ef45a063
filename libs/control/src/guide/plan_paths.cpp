#include "hamelin/control/plan_paths.hpp"

#include <fmt/format.h>

#include <ctime>
#include <span>
#include <utility>

#include "guide/guide_query.hpp"
#include "guide/motion_search.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/search/constrained_query.hpp"
#include "loop/goal_list.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

double process_cpu_s() {
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

void check(const scene::Scene& scene) {
  if (scene.guide.type == scene::GuideType::none)
    throw Error(
        ErrorCode::invalid,
        fmt::format("{}: /planner/guide: is none, expected on-request or rrt-connect", scene.name));
  for (std::size_t i = 0; i < scene.goals.size(); ++i)
    if (scene.goals[i].type == scene::GoalType::follow)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: /goals/{}: follows a target, expected a goal that stays where "
                              "it is",
                              scene.name, i));
}

// What a shield of the scene keeps while the arm moves slowly.
LimitReserve reserve_of(const scene::Scene& scene) {
  LimitReserve reserve;
  if (scene::safety_type(scene) == scene::SafetyType::shield)
    reserve.obstacles_m = reserve.self_m = scene.safety.margin_m;
  return reserve;
}

VectorXd start_of(const scene::Scene& scene, const model::Model& arm) {
  return scene.start_q.size() > 0 ? scene.start_q : VectorXd::Zero(arm.dof());
}

Json columns(const Eigen::MatrixXd& points) {
  Json out = Json::array();
  for (Index i = 0; i < points.cols(); ++i)
    out.push_back(std::vector<double>(points.col(i).begin(), points.col(i).end()));
  return out;
}

// Spacing of the points of a motion in a document [s].
constexpr double document_spacing_s = 0.01;

Json motion_json(const PlannedMotion& motion) {
  const scene::JointTrajectory points = motion.motion.sampled(document_spacing_s);
  return {{"duration_s", motion.motion.duration_s()},
          {"clearance_m", motion.clearance_m},
          {"time_s", std::vector<double>(points.time_s.begin(), points.time_s.end())},
          {"q", columns(points.q)},
          {"v", columns(points.v)},
          {"a", columns(points.a)}};
}

// Which goal of several was taken, and why others were not.
Json options_json(const search::Path& path) {
  Json options = Json::array();
  for (std::size_t i = 0; i < path.goals.size(); ++i) {
    const search::GoalFigures& figures = path.goals[i];
    const bool taken = path.found() && i == path.goal;
    options.push_back({{"tried", figures.tried},
                       {"reached", figures.reached},
                       {"clear", figures.clear},
                       {"cause", taken ? Json(nullptr) : Json(search::why_not(figures))}});
  }
  return {{"taken", path.found() ? Json(path.goal) : Json(nullptr)},
          {"options", std::move(options)}};
}

Json planned_json(const PlannedGoal& goal) {
  const search::Path& path = goal.path;
  Json out{{"type", goal.type},
           {"found", path.found()},
           {"cause", path.cause.empty() ? Json(nullptr) : Json(path.cause)},
           {"q", columns(path.points)},
           {"length", path.length},
           {"certificate", nullptr},
           {"motion", goal.motion ? motion_json(*goal.motion) : Json(nullptr)},
           {"motion_cause", goal.motion_cause.empty() ? Json(nullptr) : Json(goal.motion_cause)},
           {"search",
            {{"checks", path.checks},
             {"first_checks", path.first_checks},
             {"margin_m", path.margin_m},
             {"planned_length", search::path_length(path.planned)},
             {"planned_points", path.planned.cols()},
             {"roots", path.roots},
             {"states", path.states}}},
           {"timing", {{"search_s", goal.search_s}}}};
  if (goal.has_way)
    out["way"] = {{"share", path.way_share}, {"q", columns(path.found() ? path.points : path.way)}};
  if (path.goals.size() > 1) out["any_of"] = options_json(path);
  if (path.found())
    out["certificate"] = {
        {"clearance_m", goal.clearance_m},
        {"smallest_m", *std::min_element(goal.clearance_m.begin(), goal.clearance_m.end())}};
  return out;
}

PlannedGoal planned(MotionSearch& search, GuideQuery& query, const scene::Goal& goal,
                    const VectorXd& start, std::uint64_t number) {
  PlannedGoal out;
  out.type = scene::type_name(goal);
  out.has_way = goal.way.has_value();
  const std::span<const scene::Goal> options = scene::options_of(goal);
  const search::Problem problem{start, {options.begin(), options.end()}, number};
  const double since = process_cpu_s();
  MotionSearch::Found found = search.find(problem, goal, start, query);
  out.search_s = process_cpu_s() - since;
  out.path = std::move(found.path);
  if (found.motion) {
    out.path.points = std::move(found.way_points);
    out.path.length = search::path_length(out.path.points);
  }
  const Eigen::MatrixXd& points = out.path.points;
  for (Index i = 0; i + 1 < points.cols(); ++i)
    out.clearance_m.push_back(query.proved_clearance(points.col(i), points.col(i + 1)));
  out.motion_cause = std::move(found.cause);
  if (!found.motion) return out;
  const CertifiedPath& proved = *found.motion;
  const double clearance_m = std::min(proved.clearance_m.minCoeff(), proved.self_m.minCoeff());
  out.motion = PlannedMotion{std::move(found.motion->motion), clearance_m};
  return out;
}

// The second begins where the first one ends.
void append(scene::JointTrajectory& out, const scene::JointTrajectory& more) {
  const Index before = out.points();
  if (before == 0) {
    out = more;
    return;
  }
  const Index added = more.points() - 1;
  const double end = out.time_s[before - 1];
  out.time_s.conservativeResize(before + added);
  out.time_s.tail(added) = more.time_s.tail(added).array() + end;
  for (auto [to, from] : {std::pair(&out.q, &more.q), {&out.v, &more.v}, {&out.a, &more.a}}) {
    to->conservativeResize(Eigen::NoChange, before + added);
    to->rightCols(added) = from->rightCols(added);
  }
}

// Of what a scene sends to an arm.
ChangeBounds changes_of(const scene::Scene& scene, int dof) {
  ChangeBounds out{scene.actuation.torque_rate_max_Nm_s.value_or(0.0), {}, {}};
  if (scene.actuation.type != scene::ActuationType::position) return out;
  const auto values = [&](const std::vector<double>& given, const char* key) {
    return one_or_per_joint(given, dof, fmt::format("{}: /actuation/servo/{}", scene.name, key));
  };
  out.acceleration_max = values(scene.actuation.servo.acceleration_max, "acceleration_max");
  out.jerk_max = values(scene.actuation.servo.jerk_max, "jerk_max");
  return out;
}

}  // namespace

PathPlan plan_paths(const scene::Scene& scene, const PlanOptions& options) {
  check(scene);
  const model::Model arm = load_model(scene);
  World world(scene, arm, {});
  return plan_paths(scene, arm, world, options);
}

PathPlan plan_paths(const scene::Scene& scene, const model::Model& arm, World& world,
                    const PlanOptions& options) {
  check(scene);
  check_numbers(scene, arm);
  const WorldView view(scene, arm, world);
  GuideQuery query(arm, world, view);
  query.set_poll(options.poll);
  const Json params = scene.planner ? scene.planner->params : Json::object();
  const LimitReserve reserve = reserve_of(scene);
  const search::Settings settings = guide_settings(scene, arm, view, reserve, params);
  std::unique_ptr<PathTiming> timing;
  if (options.motions)
    timing = std::make_unique<PathTiming>(
        scene, arm, view.self_field(), MotionBounds{reserve, params, changes_of(scene, arm.dof())},
        settings);
  MotionSearch search(arm, settings, std::move(timing), MotionSearch::other_checks(scene.guide));
  PathPlan plan;
  plan.scene = scene.name;
  plan.robot = arm.robot().name;
  for (const auto& link : arm.robot().links) plan.joints.push_back(link.joint.name);
  plan.guide = scene::to_string(scene.guide.type);
  plan.seed = scene.seed;
  plan.goal_count = scene.goals.size();
  VectorXd start = start_of(scene, arm);
  const std::vector<std::uint64_t> allowances = world.allow(allowances_of(scene.goals));
  for (const scene::Goal& goal : scene.goals) {
    query.refresh(0.0, allowances[plan.goals.size()]);
    plan.goals.push_back(planned(search, query, goal, start, plan.goals.size() + 1));
    const PlannedGoal& found = plan.goals.back();
    if (!found.path.found()) break;
    start = found.path.points.rightCols(1);
  }
  return plan;
}

search::Postures find_postures(const scene::Scene& scene, std::size_t goal,
                               const search::PosturesWanted& wanted) {
  check(scene);
  if (goal >= scene.goals.size())
    throw Error(ErrorCode::invalid, fmt::format("{}: /goals/{}: does not exist, expected less than "
                                                "the number of goals, {}",
                                                scene.name, goal, scene.goals.size()));
  const model::Model arm = load_model(scene);
  World world(scene, arm, {});
  check_numbers(scene, arm);
  const WorldView view(scene, arm, world);
  GuideQuery query(arm, world, view);
  const scene::Goal& given = scene.goals[goal];
  query.refresh(0.0, world.allow(allowances_of(scene.goals))[goal]);
  const std::span<const scene::Goal> options = scene::options_of(given);
  const search::Problem problem{start_of(scene, arm), {options.begin(), options.end()}, goal + 1};
  const Json params = scene.planner ? scene.planner->params : Json::object();
  const search::Settings settings = guide_settings(scene, arm, view, reserve_of(scene), params);
  search::TipConstraints kept(arm, given.constraints);
  search::ConstrainedQuery constrained(query, kept);
  search::Query& asked = kept.size() > 0 ? static_cast<search::Query&>(constrained) : query;
  return search::find_postures(arm, settings, problem, asked, wanted);
}

scene::JointTrajectory trajectory_of(const PathPlan& plan, double spacing_s) {
  scene::JointTrajectory out;
  for (std::size_t i = 0; i < plan.goals.size(); ++i) {
    const PlannedGoal& goal = plan.goals[i];
    if (!goal.motion)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: /goals/{}: no motion: {}", plan.scene, i,
                              goal.path.found() ? goal.motion_cause : goal.path.cause));
    append(out, goal.motion->motion.sampled(spacing_s));
  }
  return out;
}

Json to_json(const PathPlan& plan) {
  Json out{{"schema", "hamelin.path/1"}, {"scene", plan.scene}, {"robot", plan.robot},
           {"joints", plan.joints},      {"guide", plan.guide}, {"seed", plan.seed},
           {"paths", Json::array()}};
  for (const PlannedGoal& goal : plan.goals) out["paths"].push_back(planned_json(goal));
  return out;
}

}  // namespace hamelin::control
