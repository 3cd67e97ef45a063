#include "hamelin/search/search.hpp"

#include <fmt/format.h>

#include <limits>
#include <utility>

#include "hamelin/core/error.hpp"
#include "run.hpp"
#include "search_input.hpp"

namespace hamelin::search {

using Eigen::Index;
using Eigen::VectorXd;

void check(const model::Model& model, const Settings& settings) {
  for (const VectorXd* limits : {&settings.q_lower, &settings.q_upper})
    if (limits->size() != 0 && limits->size() != model.dof())
      throw Error(ErrorCode::invalid, fmt::format("search: {} joint limits given, expected {}",
                                                  limits->size(), model.dof()));
  if (!(settings.margin_m >= 0.0) || !(settings.self_margin_m >= 0.0) ||
      !(settings.least_m >= 0.0) || settings.checks_max < 1)
    throw Error(ErrorCode::invalid,
                "search: margins and checks_max: expected margins of at least 0 and 1 check");
}

namespace {

void check(const scene::Goal& goal) {
  if (goal.type == scene::GoalType::follow)
    throw Error(ErrorCode::invalid,
                "search: goal: follows a target, expected a goal that stays where it is");
  if (goal.type == scene::GoalType::any_of)
    throw Error(ErrorCode::invalid,
                "search: goal: is any of several, expected these as goals of their own");
  if (!goal.pose.p().allFinite() || !goal.pose.R().allFinite())
    throw Error(ErrorCode::invalid, "search: goal: is not finite, expected finite numbers");
}

}  // namespace

void check(const model::Model& model, const Problem& problem) {
  const auto fits = [&](const VectorXd& q, const char* name) {
    if (q.size() != model.dof() || !q.allFinite())
      throw Error(ErrorCode::invalid,
                  fmt::format("search: {}: {} values given, expected {} finite numbers (one per "
                              "joint of '{}')",
                              name, q.size(), model.dof(), model.robot().name));
  };
  fits(problem.start, "start");
  if (problem.goals.empty())
    throw Error(ErrorCode::invalid, "search: goals: none given, expected at least one");
  if (problem.known.size() != 0 &&
      (problem.known.rows() != model.dof() || !problem.known.allFinite()))
    throw Error(ErrorCode::invalid,
                fmt::format("search: known path: {} rows given, expected {} of finite numbers",
                            problem.known.rows(), model.dof()));
  if (problem.way && (problem.goals.size() != 1 || !problem.goals.front().way))
    throw Error(ErrorCode::invalid,
                "search: way: is given without a goal that has one, expected one such goal");
  for (const scene::Goal& goal : problem.goals) {
    check(goal);
    if (goal.type == scene::GoalType::joint) fits(goal.q, "goal");
  }
}

double path_length(const Eigen::MatrixXd& points) {
  double length = 0.0;
  for (Index i = 0; i + 1 < points.cols(); ++i)
    length += (points.col(i + 1) - points.col(i)).norm();
  return length;
}

Search::Search(const model::Model& model, Settings settings)
    : model_(model), settings_(std::move(settings)) {
  check(model_, settings_);
  run_ = std::make_unique<Run>(model_, settings_);
}

Search::~Search() = default;

void Search::begin(const Problem& problem, Query& query) {
  check(model_, problem);
  run_->begin(problem, query);
}

bool Search::advance(long checks) {
  return run_->advance(checks);
}

const Path& Search::path() const noexcept {
  return run_->path();
}

const Margins& Search::margins() const noexcept {
  return run_->margins();
}

Path Search::search(const Problem& problem, Query& query) {
  begin(problem, query);
  while (!advance(settings_.checks_max)) {
  }
  return path();
}

}  // namespace hamelin::search
