#include "ompl_search.hpp"

#ifdef HAMELIN_WITH_OMPL
#include <ompl/base/SpaceInformation.h>
#include <ompl/base/goals/GoalState.h>
#include <ompl/base/objectives/PathLengthOptimizationObjective.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/geometric/PathGeometric.h>
#include <ompl/geometric/PathSimplifier.h>
#include <ompl/geometric/planners/informedtrees/BITstar.h>
#include <ompl/geometric/planners/rrt/InformedRRTstar.h>
#include <ompl/geometric/planners/rrt/RRT.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/util/Console.h>
#include <ompl/util/RandomNumbers.h>

#include <memory>

namespace hamelin::peers {

namespace ob = ompl::base;
namespace og = ompl::geometric;

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double range = 0.5;  // the longest edge of a tree, as that of our search [rad or m]

VectorXd vector(const ob::State* state, Index n) {
  return VectorXd::Map(state->as<ob::RealVectorStateSpace::StateType>()->values, n);
}

/// Proves motions clear, where OMPL would sample them.
class Motions final : public ob::MotionValidator {
 public:
  Motions(const ob::SpaceInformationPtr& info, search::Query& query, Index n)
      : MotionValidator(info), query_(query), n_(n) {}
  bool checkMotion(const ob::State* a, const ob::State* b) const override {
    return query_.motion_clear(vector(a, n_), vector(b, n_));
  }
  bool checkMotion(const ob::State* a, const ob::State* b,
                   std::pair<ob::State*, double>& last) const override {
    last.second = 0.0;
    if (last.first != nullptr) si_->copyState(last.first, a);
    return checkMotion(a, b);
  }

 private:
  search::Query& query_;
  Index n_;
};

ob::SpaceInformationPtr make_space(const OmplSearch& search) {
  const Index n = search.start.size();
  auto space = std::make_shared<ob::RealVectorStateSpace>(static_cast<unsigned>(n));
  ob::RealVectorBounds bounds(static_cast<unsigned>(n));
  for (Index i = 0; i < n; ++i) {
    const auto at = static_cast<unsigned>(i);
    bounds.setLow(at, std::min({search.box.lower[i], search.start[i], search.goal[i]}));
    bounds.setHigh(at, std::max({search.box.upper[i], search.start[i], search.goal[i]}));
  }
  space->setBounds(bounds);
  auto info = std::make_shared<ob::SpaceInformation>(space);
  info->setStateValidityChecker([&query = search.query, n](const ob::State* state) {
    const VectorXd q = vector(state, n);
    return query.motion_clear(q, q);
  });
  info->setMotionValidator(std::make_shared<Motions>(info, search.query, n));
  info->setup();
  return info;
}

template <class Planner>
ob::PlannerPtr ranged(const ob::SpaceInformationPtr& info) {
  auto planner = std::make_shared<Planner>(info);
  planner->setRange(range);
  return planner;
}

ob::PlannerPtr make_planner(const std::string& name, const ob::SpaceInformationPtr& info) {
  if (name == "RRT") return ranged<og::RRT>(info);
  if (name == "RRTstar") return ranged<og::RRTstar>(info);
  if (name == "InformedRRTstar") return ranged<og::InformedRRTstar>(info);
  if (name == "RRTConnect") return ranged<og::RRTConnect>(info);
  auto planner = std::make_shared<og::BITstar>(info);
  planner->setPruning(false);  // OMPL 1.5 crashes where it prunes the goal (ompl/ompl#949)
  return planner;
}

}  // namespace

std::vector<std::string> ompl_planners() {
  return {"RRTConnect", "RRT", "RRTstar", "InformedRRTstar", "BITstar"};
}

MatrixXd ompl_search(const OmplSearch& search, bool simplifies) {
  ompl::msg::setLogLevel(ompl::msg::LOG_NONE);
  ompl::RNG::setSeed(search.seed);
  const auto info = make_space(search);
  auto problem = std::make_shared<ob::ProblemDefinition>(info);
  ob::ScopedState<ob::RealVectorStateSpace> start(info), goal(info);
  std::copy(search.start.begin(), search.start.end(), start->values);
  std::copy(search.goal.begin(), search.goal.end(), goal->values);
  problem->setStartAndGoalStates(start, goal);
  auto objective = std::make_shared<ob::PathLengthOptimizationObjective>(info);
  objective->setCostThreshold(objective->infiniteCost());  // the first path ends the search
  problem->setOptimizationObjective(objective);
  const auto planner = make_planner(search.planner, info);
  planner->setProblemDefinition(problem);
  planner->setup();
  const long end = search.query.checks() + search.checks_max;
  long iterations = 0;  // a planner may go on without checking anything
  planner->solve(
      ob::PlannerTerminationCondition([&] { return search.query.checks() + ++iterations >= end; }));
  if (!problem->hasExactSolution()) return {};
  auto& path = *problem->getSolutionPath()->as<og::PathGeometric>();
  if (simplifies) og::PathSimplifier(info).simplifyMax(path);
  MatrixXd out(search.start.size(), static_cast<Index>(path.getStateCount()));
  for (std::size_t i = 0; i < path.getStateCount(); ++i)
    out.col(static_cast<Index>(i)) = vector(path.getState(static_cast<unsigned>(i)), out.rows());
  return out;
}

}  // namespace hamelin::peers

#else

namespace hamelin::peers {

std::vector<std::string> ompl_planners() {
  return {};
}
Eigen::MatrixXd ompl_search(const OmplSearch&, bool) {
  return {};
}

}  // namespace hamelin::peers
#endif
