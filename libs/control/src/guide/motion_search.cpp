#include "guide/motion_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/search/constrained_query.hpp"
#include "hamelin/search/ways.hpp"

namespace hamelin::control {

namespace {

// In which an arm may be slow enough for another direction [s].
constexpr std::array braking_times_s{0.1, 0.25, 0.6, 2.0};

}  // namespace

MotionSearch::MotionSearch(const model::Model& model, search::Settings settings,
                           std::unique_ptr<PathTiming> timing, long other_checks)
    : model_(model),
      ws_(model),
      search_(model, std::move(settings)),
      timing_(std::move(timing)),
      other_checks_(other_checks) {}

long MotionSearch::other_checks(const scene::GuideSpec& spec) {
  constexpr double most_s = 0.006, most = 3000.0;
  return std::lround(spec.check_time_s * most > most_s ? most_s / spec.check_time_s : most);
}

geometry::SE3 MotionSearch::tip_at(const Eigen::VectorXd& q) {
  dynamics::forward_kinematics(model_, ws_, q);
  return dynamics::tip_pose(model_, ws_);
}

MotionSearch::Found MotionSearch::find(search::Problem problem, const scene::Goal& goal,
                                       const Eigen::VectorXd& way_start, GuideQuery& query) {
  search::TipConstraints kept(model_, goal.constraints);
  tip_speed_m_s_ = scene::speed_max_m_s(goal.constraints);
  if (goal.way) {
    try {
      problem.way = search::way_curve(goal, tip_at(way_start));
    } catch (const Error& e) {
      Found none;
      none.path.cause = e.what();
      return none;
    }
    kept.add(*problem.way, goal.way->tolerance);
  }
  if (goal.retreat) {
    problem.retreat = goal.retreat;
    const geometry::SE3 tip = tip_at(problem.start);
    kept.add(search::retreat_curve(*goal.retreat, tip), goal.retreat->tolerance,
             search::ball_of(*goal.retreat, tip));
  }
  const bool approaches = std::any_of(problem.goals.begin(), problem.goals.end(),
                                      [](const scene::Goal& option) { return option.approach; });
  problem.shortens = !approaches;
  Found out = find(problem, kept, query, !approaches);
  if (out.path.found() && approaches) choose(std::move(problem), kept, query, out);
  return out;
}

// The arm needs some time until it is slow enough for another direction: if there is too little,
// the time law finds no motion, and it gets more.
MotionSearch::Found MotionSearch::find_on(const Lead& lead, search::Problem problem,
                                          const scene::Goal& goal, GuideQuery& query) {
  search::TipConstraints kept(model_, goal.constraints);
  tip_speed_m_s_ = scene::speed_max_m_s(goal.constraints);
  const double left = lead.path->motion.duration_s() - lead.time_s;
  long checks = 0;
  Found out;
  for (const double braking_s : braking_times_s) {
    out = find_after(lead, std::min(braking_s, left), problem, kept, query);
    checks += out.checks;
    out.checks = checks;
    if (out.motion || !out.path.found() || braking_s >= left) break;
  }
  return out;
}

MotionSearch::Found MotionSearch::find_after(const Lead& lead, double braking_s,
                                             search::Problem& problem, search::TipConstraints& kept,
                                             GuideQuery& world) {
  search::ConstrainedQuery constrained(world, kept);
  search::Query& query = kept.size() > 0 ? static_cast<search::Query&>(constrained) : world;
  const long before = query.checks() + timing_->checks();
  Found out;
  Eigen::VectorXd from(problem.start.size());
  timing_->begin(problem.number, tip_speed_m_s_);
  timing_->begin_with(lead, braking_s, from, problem.start);
  out.path = search_.search(problem, query);
  const long search_checks = out.path.checks;
  if (out.path.found() && consider(out.path, from, query)) {
    consider_others(problem, out.path, from, query);
    out.motion = timing_->make(query);
    if (out.motion) {
      out.motion->standing = world.standing();
      out.way_points = timing_->points();
    }
    out.cause = out.motion ? "" : timing_->cause();
  }
  out.checks = std::max(search_checks, query.checks() + timing_->checks() - before);
  return out;
}

void MotionSearch::choose(search::Problem problem, search::TipConstraints& kept, GuideQuery& query,
                          Found& found) {
  scene::Goal goal = scene::joint_goal(found.path.points.rightCols<1>());
  goal.approach = problem.goals[found.path.goal].approach;
  if (goal.approach) {
    const geometry::SE3 tip = tip_at(goal.q);
    kept.add(search::approach_curve(*goal.approach, tip), goal.approach->tolerance,
             search::ball_of(*goal.approach, tip));
  }
  problem.goals = {std::move(goal)};
  problem.known = found.path.points;
  problem.shortens = true;
  Found again = find(problem, kept, query, true);
  again.checks += found.checks;
  again.path.goal = found.path.goal;
  again.path.goals = std::move(found.path.goals);
  found = std::move(again);
}

MotionSearch::Found MotionSearch::find(const search::Problem& problem, search::TipConstraints& kept,
                                       GuideQuery& world, bool times) {
  search::ConstrainedQuery constrained(world, kept);
  search::Query& query = kept.size() > 0 ? static_cast<search::Query&>(constrained) : world;
  Found out;
  out.path = search_.search(problem, query);
  out.checks = out.path.checks;
  if (!out.path.found() || !timing_ || !times) return out;
  const long before = query.checks() + timing_->checks();
  timing_->begin(problem.number, tip_speed_m_s_);
  (void)consider(out.path, {}, query);
  if (!problem.way) consider_others(problem, out.path, {}, query);
  out.motion = timing_->make(query);
  if (out.motion) {
    out.motion->standing = world.standing();
    out.way_points = timing_->points();
  } else {
    out.cause = timing_->cause();
  }
  out.checks += query.checks() + timing_->checks() - before;
  return out;
}

bool MotionSearch::consider(const search::Path& path, const Eigen::VectorXd& from,
                            search::Query& query) {
  Eigen::MatrixXd points = path.points;
  if (from.size() > 0) {
    query.set_margins(search_.margins());
    if (!query.motion_clear(from, path.points.col(0))) return false;
    points.resize(from.size(), 1 + path.points.cols());
    points << from, path.points;
  }
  timing_->consider(points, search_.margins(), query);
  return true;
}

// Other random numbers may lead around the other side of an obstacle.
void MotionSearch::consider_others(search::Problem problem, const search::Path& first,
                                   const Eigen::VectorXd& from, search::Query& query) {
  if (first.points.cols() == 2) return;
  const long until = query.checks() + other_checks_;
  const std::uint64_t number = problem.number;
  for (std::uint64_t k = 1; query.checks() < until; ++k) {
    problem.number = number + (k << 32);
    search_.begin(problem, query);
    if (!search_.advance(until - query.checks())) return;
    if (search_.path().found() && search_.path().margin_m >= first.margin_m)
      (void)consider(search_.path(), from, query);
  }
}

}  // namespace hamelin::control
