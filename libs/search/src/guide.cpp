#include "hamelin/search/search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "edges.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "roots.hpp"
#include "search.hpp"
#include "shorten.hpp"

namespace hamelin::search {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Distance from a goal and from the start at which its margin counts fully, and not at all [rad or
// m]. A path soon leads away from a tight start: planners keep their margin there.
constexpr double near_goal = 0.2, far_goal = 0.9, near_start = 0.02, far_start = 0.3;
// Pieces of a motion on which margins vary are no longer than this [rad or m].
constexpr double piece = 0.1;
// Margins are constant if they vary by less than this [m].
constexpr double constant_m = 5e-4;
constexpr double start_slack_m = 2e-4;  // by which the clearance of the start may be undercut
constexpr double limit_reserve = 1e-3;  // kept from joint limits [rad or m]
// The margins that a search keeps one after the other, as shares of the full one, and the share of
// its checks that each of them may have used at the end.
constexpr std::array<std::pair<double, double>, 3> attempts{{{1.0, 0.1}, {0.5, 0.3}, {0.1, 1.0}}};

void check(const model::Model& model, const Problem& problem) {
  const auto fits = [&](const VectorXd& q, const char* name) {
    if (q.size() != model.dof() || !q.allFinite())
      throw Error(ErrorCode::invalid,
                  fmt::format("guide: {}: {} values given, expected {} finite numbers (one per "
                              "joint of '{}')",
                              name, q.size(), model.dof(), model.robot().name));
  };
  fits(problem.start, "start");
  if (problem.goal.type == scene::GoalType::joint) return fits(problem.goal.q, "goal");
  if (problem.goal.type == scene::GoalType::follow)
    throw Error(ErrorCode::invalid,
                "guide: goal: follows a target, expected a goal that stays where it is");
  if (!problem.goal.pose.p().allFinite() || !problem.goal.pose.R().allFinite())
    throw Error(ErrorCode::invalid, "guide: goal: is not finite, expected finite numbers");
}

void check(const model::Model& model, const Settings& settings) {
  if (!available()) throw Error(ErrorCode::invalid, std::string(why_unavailable()));
  for (const VectorXd* limits : {&settings.q_lower, &settings.q_upper})
    if (limits->size() != 0 && limits->size() != model.dof())
      throw Error(ErrorCode::invalid, fmt::format("guide: {} joint limits given, expected {}",
                                                  limits->size(), model.dof()));
  if (!(settings.margin_m >= 0.0) || !(settings.least_m >= 0.0) || settings.checks_max < 1)
    throw Error(ErrorCode::invalid,
                "guide: margins and checks_max: expected margins of at least 0 and 1 check");
}

// The box of the joint limits, with start and goals, which may be nearer to a limit.
dynamics::JointBox box_with(dynamics::JointBox box, const VectorXd& start,
                            const std::vector<VectorXd>& goals) {
  const auto include = [&](const VectorXd& q) {
    box.lower = box.lower.cwiseMin(q);
    box.upper = box.upper.cwiseMax(q);
  };
  include(start);
  for (const VectorXd& goal : goals) include(goal);
  return box;
}

// The straight way to the nearest configuration at the goal, which nothing can shorten.
Found straight(const VectorXd& start, const VectorXd& goal, Edges& edges) {
  Found found;
  if (!edges.clear(start, goal)) return found;
  found.points.resize(start.size(), 2);
  found.points << start, goal;
  found.first_checks = edges.checks();
  return found;
}

}  // namespace

std::string_view why_unavailable() noexcept {
  return "guide: this build of hamelin is without OMPL, expected guide none; to build with OMPL, "
         "install libompl-dev and configure again";
}

double path_length(const MatrixXd& points) {
  double length = 0.0;
  for (Index i = 0; i + 1 < points.cols(); ++i)
    length += (points.col(i + 1) - points.col(i)).norm();
  return length;
}

void Margins::add(const VectorXd& q, double margin_m, double near, double far) {
  if (margin_m < full_) places_.push_back({q, margin_m, near, far});
}

double Margins::margin_at(const Place& place, double distance) const {
  const double weight = std::clamp((distance - place.near) / (place.far - place.near), 0.0, 1.0);
  return place.margin + weight * (full_ - place.margin);
}

// docs/theory.md (17.1)
double Margins::required(const VectorXd& q) const {
  double margin = full_;
  for (const Place& place : places_)
    margin = std::min(margin, margin_at(place, (q - place.q).norm()));
  return margin;
}

double Margins::least(const VectorXd& a, const VectorXd& b) const {
  double margin = full_;
  const VectorXd line = b - a;
  const double square = line.squaredNorm();
  for (const Place& place : places_) {
    const double along =
        square > 0.0 ? std::clamp((place.q - a).dot(line) / square, 0.0, 1.0) : 0.0;
    margin = std::min(margin, margin_at(place, (a + along * line - place.q).norm()));
  }
  return margin;
}

bool Edges::clear(const VectorXd& a, const VectorXd& b) {
  const double least = margins_.least(a, b);
  const bool constant = std::max(margins_.required(a), margins_.required(b)) - least < constant_m;
  if (constant || (b - a).norm() <= piece) return query_.motion_clear(a, b, least);
  // The half at b first: it is new to the caller, and likelier to be in collision.
  const VectorXd middle = 0.5 * (a + b);
  return clear(middle, b) && clear(a, middle);
}

Guide::Guide(const model::Model& model, Settings settings)
    : model_(model), settings_(std::move(settings)) {
  check(model_, settings_);
}

Path Guide::search(const Problem& problem, Query& query) const {
  check(model_, problem);
  const long before = query.checks();
  Path out;
  const auto ended = [&](std::string cause) {
    out.cause = std::move(cause);
    out.checks = query.checks() - before;
    return out;
  };
  Rng rng(settings_.seed + 0x632be59bd9b4e019ULL * (problem.number + 1));
  const double at_start = query.clearance(problem.start, -1.0);
  if (at_start <= 0.0) return ended("the arm is in contact where it is");
  const dynamics::JointBox box(model_.dof(), settings_.q_lower, settings_.q_upper, limit_reserve);
  const std::vector<Root> roots = find_roots(model_, box, settings_, problem, query, rng);
  out.roots = static_cast<int>(roots.size());
  if (roots.empty()) return ended("no clear configuration was found at the goal");
  std::vector<VectorXd> goals;
  for (const Root& root : roots) goals.push_back(root.q);
  const dynamics::JointBox bounds = box_with(box, problem.start, goals);
  for (const auto& [share, used] : attempts) {
    Margins margins(share * settings_.margin_m);
    margins.add(problem.start, std::max(0.0, at_start - start_slack_m), near_start, far_start);
    for (const Root& root : roots)
      margins.add(root.q,
                  std::max(std::min(settings_.least_m, 0.5 * root.clearance),
                           root.clearance - settings_.slack_m),
                  near_goal, far_goal);
    Edges edges(query, margins);
    const auto end = static_cast<long>(used * static_cast<double>(settings_.checks_max));
    Found found = straight(problem.start, goals.front(), edges);
    if (found.points.cols() == 0)
      found = search::search({settings_.type, bounds, problem.start, goals, edges, rng.next(),
                              before + end, settings_.improve_checks});
    out.states += found.states;
    if (found.points.cols() == 0) continue;
    out.first_checks = found.first_checks - before;
    out.points = settings_.shortens ? shorten(found.points, edges, rng) : found.points;
    out.planned = std::move(found.points);
    out.length = path_length(out.points);
    out.margin_m = margins.full_m();
    return ended({});
  }
  return ended(fmt::format("no path was found within {} checks", settings_.checks_max));
}

}  // namespace hamelin::search
