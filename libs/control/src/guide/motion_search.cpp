#include "guide/motion_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "hamelin/control/goal_tracker.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/search/constrained_query.hpp"
#include "hamelin/search/ways.hpp"

namespace hamelin::control {

namespace {

// In which an arm may be slow enough for another direction [s].
constexpr std::array braking_times_s{0.1, 0.25, 0.6, 2.0};
// The share of a goal's tolerances within which an arm is sure to reach it.
constexpr double well_within = 0.7;
// How far before a goal that is passed the corner there begins, in ways from where a motion to it
// is well within its tolerances.
constexpr std::array corners{12.0, 6.0, 3.0, 1.0};
// Spacing at which motions are compared with a goal [s].
constexpr double compare_s = 0.002;

// The motion along the fastest of the paths that were considered.
void make_motion(PathTiming& timing, search::Query& query, const GuideQuery& world,
                 MotionSearch::Found& out) {
  out.motion = timing.make(query);
  out.cause = out.motion ? "" : timing.cause();
  if (!out.motion) return;
  out.motion->standing = world.standing();
  out.way_points = timing.points();
}

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

double MotionSearch::away(const CertifiedPath& path, double time_s, const scene::Goal& goal) {
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model_.dof());
  Eigen::VectorXd q(rest), v(rest), a(rest);
  timing::TimedPath::Cursor cursor;
  path.motion.at(time_s, q, v, a, cursor);
  dynamics::forward_kinematics(model_, ws_, q);
  return goal_error(goal, model_, ws_, q, rest).size;
}

double MotionSearch::entering_s(const CertifiedPath& path, const scene::Goal& goal) {
  double time_s = path.motion.duration_s();
  while (time_s > 0.0 && away(path, time_s - compare_s, goal) <= well_within) time_s -= compare_s;
  return std::max(0.0, time_s);
}

std::optional<double> MotionSearch::leaving_s(const CertifiedPath& path, const scene::Goal& goal) {
  std::optional<double> last;
  double least = 1.0;
  for (double time_s = 0.0; time_s < path.motion.duration_s(); time_s += compare_s) {
    const double size = away(path, time_s, goal);
    least = std::min(least, size);
    if (size < 1.0) last = time_s;
    if (last && size > 1.0) break;
  }
  return least <= well_within ? last : std::nullopt;
}

std::vector<MotionSearch::Way> MotionSearch::ways(search::Problem problem,
                                                  const search::Path& first, search::Query& query) {
  std::vector<Way> out{{first.points, search_.margins()}};
  each_other(std::move(problem), first, query, [&](const search::Path& path) {
    out.push_back({path.points, search_.margins()});
  });
  return out;
}

// The farther before the goal the corner begins, the faster it is passed, if still near enough.
MotionSearch::Found MotionSearch::find_past(const Lead& lead, const scene::Goal& passed,
                                            search::Problem problem, const scene::Goal& goal,
                                            GuideQuery& world) {
  search::TipConstraints kept(model_, goal.constraints);
  search::ConstrainedQuery constrained(world, kept);
  search::Query& query = kept.size() > 0 ? static_cast<search::Query&>(constrained) : world;
  tip_speed_m_s_ = scene::speed_max_m_s(goal.constraints);
  const timing::TimedPath& before = lead.path->motion;
  const bool free = goal.constraints.empty() && passed.constraints.empty();
  Eigen::VectorXd unused(problem.start), other(problem.start), from(problem.start);
  before.curve.at(before.curve.end(), problem.start, unused, other);
  const long checks = query.checks() + timing_->checks();
  Found out;
  out.path = search_.search(problem, query);
  if (!out.path.found()) return out;
  const std::vector<Way> all = ways(problem, out.path, query);
  const double entering = entering_s(*lead.path, passed),
               left = before.curve.end() - before.along(entering).place;
  for (const double share : corners) {
    if (share > 1.0 && !free) continue;
    const double place = before.curve.end() - share * left;
    const Lead begin{lead.path, share > 1.0 ? before.time_at(place) : entering};
    if (begin.time_s < lead.time_s) continue;
    timing_->begin(problem.number, tip_speed_m_s_);
    timing_->begin_past(begin, from);
    for (const Way& way : all) (void)consider(way.points, way.margins, from, query);
    if (!timing_->has_path()) continue;
    make_motion(*timing_, query, world, out);
    const auto leaving = out.motion ? leaving_s(*out.motion, passed) : std::nullopt;
    out.lead_s = begin.time_s;
    out.passed_by_s = leaving.value_or(0.0);
    if (leaving) break;
    out.motion.reset();
  }
  out.checks = std::max(out.path.checks, query.checks() + timing_->checks() - checks);
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
  if (out.path.found() && consider(out.path.points, search_.margins(), from, query)) {
    consider_others(problem, out.path, from, query);
    make_motion(*timing_, query, world, out);
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
  (void)consider(out.path.points, search_.margins(), {}, query);
  if (!problem.way) consider_others(problem, out.path, {}, query);
  make_motion(*timing_, query, world, out);
  out.checks += query.checks() + timing_->checks() - before;
  return out;
}

bool MotionSearch::consider(const Eigen::MatrixXd& path, const search::Margins& margins,
                            const Eigen::VectorXd& from, search::Query& query) {
  Eigen::MatrixXd points = path;
  if (from.size() > 0) {
    query.set_margins(margins);
    if (!query.motion_clear(from, path.col(0))) return false;
    points.resize(from.size(), 1 + path.cols());
    points << from, path;
  }
  timing_->consider(points, margins, query);
  return true;
}

void MotionSearch::consider_others(search::Problem problem, const search::Path& first,
                                   const Eigen::VectorXd& from, search::Query& query) {
  each_other(std::move(problem), first, query, [&](const search::Path& path) {
    (void)consider(path.points, search_.margins(), from, query);
  });
}

// Other random numbers may lead around the other side of an obstacle.
template <class Take>
void MotionSearch::each_other(search::Problem problem, const search::Path& first,
                              search::Query& query, const Take& take) {
  if (first.points.cols() == 2) return;
  const long until = query.checks() + other_checks_;
  const std::uint64_t number = problem.number;
  for (std::uint64_t k = 1; query.checks() < until; ++k) {
    problem.number = number + (k << 32);
    search_.begin(problem, query);
    if (!search_.advance(until - query.checks())) return;
    if (search_.path().found() && search_.path().margin_m >= first.margin_m) take(search_.path());
  }
}

}  // namespace hamelin::control
