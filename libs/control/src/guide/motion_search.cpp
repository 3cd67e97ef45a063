#include "guide/motion_search.hpp"

#include <cmath>
#include <utility>

#include "hamelin/search/constrained_query.hpp"

namespace hamelin::control {

MotionSearch::MotionSearch(const model::Model& model, search::Settings settings,
                           std::unique_ptr<PathTiming> timing, long other_checks)
    : model_(model),
      search_(model, std::move(settings)),
      timing_(std::move(timing)),
      other_checks_(other_checks) {}

long MotionSearch::other_checks(const scene::GuideSpec& spec) {
  constexpr double most_s = 0.006, most = 3000.0;
  return std::lround(spec.check_time_s * most > most_s ? most_s / spec.check_time_s : most);
}

MotionSearch::Found MotionSearch::find(const search::Problem& problem, GuideQuery& query) {
  const auto& kept = problem.goals.front().constraints;
  if (kept.empty()) return find(problem, query, query);
  search::TipConstraints constraints(model_, kept);
  search::ConstrainedQuery constrained(query, constraints);
  return find(problem, query, constrained);
}

MotionSearch::Found MotionSearch::find(const search::Problem& problem, const GuideQuery& world,
                                       search::Query& query) {
  Found out;
  out.path = search_.search(problem, query);
  out.checks = out.path.checks;
  if (!out.path.found() || !timing_) return out;
  const long before = query.checks() + timing_->checks();
  timing_->begin(problem.number);
  timing_->consider(out.path.points, search_.margins(), query);
  consider_others(problem, out.path, query);
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

// Other random numbers may lead around the other side of an obstacle.
void MotionSearch::consider_others(search::Problem problem, const search::Path& first,
                                   search::Query& query) {
  if (first.points.cols() == 2) return;
  const long until = query.checks() + other_checks_;
  const std::uint64_t number = problem.number;
  for (std::uint64_t k = 1; query.checks() < until; ++k) {
    problem.number = number + (k << 32);
    search_.begin(problem, query);
    if (!search_.advance(until - query.checks())) return;
    if (search_.path().found() && search_.path().margin_m >= first.margin_m)
      timing_->consider(search_.path().points, search_.margins(), query);
  }
}

}  // namespace hamelin::control
