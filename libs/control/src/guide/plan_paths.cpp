#include "hamelin/control/plan_paths.hpp"

#include <fmt/format.h>

#include <ctime>
#include <utility>

#include "guide/guide_query.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"

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

Json columns(const Eigen::MatrixXd& points) {
  Json out = Json::array();
  for (Index i = 0; i < points.cols(); ++i)
    out.push_back(std::vector<double>(points.col(i).begin(), points.col(i).end()));
  return out;
}

Json planned_json(const PlannedGoal& goal) {
  const search::Path& path = goal.path;
  Json out{{"type", goal.type},
           {"found", path.found()},
           {"cause", path.cause.empty() ? Json(nullptr) : Json(path.cause)},
           {"q", columns(path.points)},
           {"length", path.length},
           {"certificate", nullptr},
           {"search",
            {{"checks", path.checks},
             {"first_checks", path.first_checks},
             {"margin_m", path.margin_m},
             {"planned_length", search::path_length(path.planned)},
             {"planned_points", path.planned.cols()},
             {"roots", path.roots},
             {"states", path.states}}},
           {"timing", {{"search_s", goal.search_s}}}};
  if (path.found())
    out["certificate"] = {
        {"clearance_m", goal.clearance_m},
        {"smallest_m", *std::min_element(goal.clearance_m.begin(), goal.clearance_m.end())}};
  return out;
}

}  // namespace

PathPlan plan_paths(const scene::Scene& scene, const std::function<void()>& poll) {
  check(scene);
  const model::Model arm = load_model(scene);
  World world(scene, arm, {});
  return plan_paths(scene, arm, world, poll);
}

PathPlan plan_paths(const scene::Scene& scene, const model::Model& arm, World& world,
                    const std::function<void()>& poll) {
  check(scene);
  check_numbers(scene, arm);
  const WorldView view(scene, arm, world);
  GuideQuery query(arm, world, view);
  query.set_poll(poll);
  const Json params = scene.planner ? scene.planner->params : Json::object();
  search::Search search(arm, guide_settings(scene, arm, view, reserve_of(scene), params));
  PathPlan plan;
  plan.scene = scene.name;
  plan.robot = arm.robot().name;
  for (const auto& link : arm.robot().links) plan.joints.push_back(link.joint.name);
  plan.guide = scene::to_string(scene.guide.type);
  plan.seed = scene.seed;
  plan.goal_count = scene.goals.size();
  VectorXd start = scene.start_q.size() > 0 ? scene.start_q : VectorXd::Zero(arm.dof());
  for (const scene::Goal& goal : scene.goals) {
    PlannedGoal planned;
    planned.type = scene::type_name(goal);
    const double since = process_cpu_s();
    planned.path = search.search({start, {goal}, plan.goals.size() + 1}, query);
    planned.search_s = process_cpu_s() - since;
    const Eigen::MatrixXd& points = planned.path.points;
    for (Index i = 0; i + 1 < points.cols(); ++i)
      planned.clearance_m.push_back(query.proved_clearance(points.col(i), points.col(i + 1)));
    plan.goals.push_back(std::move(planned));
    if (!plan.goals.back().path.found()) break;
    start = plan.goals.back().path.points.rightCols(1);
  }
  return plan;
}

Json to_json(const PathPlan& plan) {
  Json out{{"schema", "hamelin.path/1"}, {"scene", plan.scene}, {"robot", plan.robot},
           {"joints", plan.joints},      {"guide", plan.guide}, {"seed", plan.seed},
           {"paths", Json::array()}};
  for (const PlannedGoal& goal : plan.goals) out["paths"].push_back(planned_json(goal));
  return out;
}

}  // namespace hamelin::control
