#include "guide/guidance.hpp"

#include <algorithm>
#include <limits>
#include <span>
#include <utility>

#include "loop/goal_list.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// A way-point is passed where no joint is farther from it than this, if the planner follows no
// paths [rad or m].
constexpr double passed = 0.1;
// The stretch of a new path on which the arm may have moved on while it was searched [rad or m].
constexpr double moved_on = 1.0;
// Tolerance of what the planner is shown. Whether a goal is reached does not depend on it.
constexpr double shown_tolerance = 0.02;
constexpr std::size_t cause_max = 256;
// Whether the way to a goal may begin anywhere, and in any direction.
bool begins_anywhere(const scene::Goal& goal) {
  const std::span<const scene::Goal> options = scene::options_of(goal);
  return !goal.way && !goal.retreat &&
         std::none_of(options.begin(), options.end(),
                      [](const auto& option) { return option.approach.has_value(); });
}

// A new goal in motion: from when on another motion is asked for at first, and how long it may take
// to be found [s]; the arm goes on along the one before.
constexpr double ahead_first_s = 0.06, ahead_most_s = 0.5;
// The rate of the clock below which an arm does not go on at speed.
constexpr double full_rate = 0.98;

}  // namespace

Guidance::Guidance(const scene::GuideSpec& spec, Index dof, Index points_max, bool follows_paths,
                   bool charges)
    : spec_(spec),
      follows_paths_(follows_paths),
      check_time_s_(charges ? spec.check_time_s : 0.0),
      path_(MatrixXd::Zero(dof, points_max)),
      goal_start_(VectorXd::Zero(dof)) {
  cause_.reserve(cause_max);
}

Guidance::News Guidance::update(const Now& now, GuideSearch& search) {
  if (goal_number_ != now.goal_number) begin(now);
  if (mode_ == Mode::off) return News::none;
  News news = News::none;
  beginning_ = {};
  if (awaits_) news = take(now, search);
  if (passes_ || passing_) check_pass(now);
  if (may_pass(now)) {
    lead_ = LeadState::sought;
    passes_ = pass_tried_ = wants_ = true;
    pass_goal_ = now.goal_index + 1;
  }
  if (lead_ == LeadState::found) news = go_over(now);
  if (!follows() && lead_ == LeadState::none && !awaits_ && !wants_ && world_ != now.world)
    wants_ = true;
  if (wants_ && !search.busy()) ask(now, search);
  if (!follows() && mode_ == Mode::waiting) figures_.waited_s += now.period_s;
  if (mode_ == Mode::guided && !follows_paths_) show_next_point(now);
  return news;
}

// A goal with a path of its own needs no other, and one that follows a target has no end: paths to
// them are searched where the planner asks.
void Guidance::begin(const Now& now) {
  const bool passed = has_passed(now);
  goal_number_ = now.goal_number;
  passes_ = passing_ = pass_tried_ = false;
  follows_ = now.goal().type == scene::GoalType::follow;
  needs_path_ = scene::needs_path(now.goal());
  if (passed) {
    goal_start_ = now.q;
    searches_ = 1;
    return;
  }
  const bool leads = may_lead(now);
  const bool guided = needs_path_ || (spec_.type != scene::GuideType::on_request && !follows() &&
                                      now.goal().path.cols() == 0);
  lead_ = guided && leads ? LeadState::sought : LeadState::none;
  ahead_s_ = ahead_first_s;
  mode_ = !guided ? Mode::off : leads ? Mode::guided : Mode::waiting;
  goal_start_ = now.q;
  awaits_ = false;
  wants_ = guided;
  searches_ = guided ? 1 : 0;
  if (lead_ == LeadState::sought) return;
  ++number_;
  if (guided) hold(now);
}

bool Guidance::may_lead(const Now& now) const {
  return follows_motion(now) && begins_anywhere(now.goal());
}

bool Guidance::follows_motion(const Now& now) const {
  return mode_ == Mode::guided && follows_paths_ && motion_ && now.followed == motion_.get() &&
         motion_->braking_ramp == 0.0 && now.reference.rate > full_rate &&
         now.reference.time_s + ahead_first_s < motion_->motion.duration_s();
}

bool Guidance::may_pass(const Now& now) const {
  if (pass_tried_ || passing_ || lead_ != LeadState::none || awaits_ || wants_ ||
      !now.goal().passes || now.goal_index + 1 >= now.goals->size() || !follows_motion(now))
    return false;
  const scene::Goal& next = (*now.goals)[now.goal_index + 1];
  return next.type != scene::GoalType::follow && next.path.cols() == 0 &&
         next.may_touch == now.goal().may_touch && begins_anywhere(next);
}

// In another world the path to the current goal is proved again first. A goal that was not reached
// where the arm passed it is gone to from rest.
void Guidance::check_pass(const Now& now) {
  if (passing_) {
    if (now.followed == motion_.get() && now.reference.time_s > passed_by_s_) (void)request();
    return;
  }
  if (now.followed != motion_.get() || (lead_ == LeadState::found && world_ != now.world))
    end_pass();
}

// An answer that is on its way would lead to another goal than the current one.
void Guidance::end_pass() noexcept {
  if (passes_) awaits_ = false;
  lead_ = LeadState::none;
  passes_ = passing_ = false;
}

bool Guidance::request() {
  if (mode_ == Mode::waiting) return true;
  end_pass();
  if (!follows() && searches_ >= spec_.searches_max) return false;
  ++searches_;
  mode_ = Mode::waiting;
  awaits_ = false;
  wants_ = true;
  count_ = 0;  // the next request holds the arm where it is then
  return true;
}

// An arm whose goal needs a path goes on waiting for one.
void Guidance::give_up_path() noexcept {
  mode_ = needs_path_ ? Mode::waiting : Mode::unguided;
  wants_ = needs_path_;
  ++number_;
}

void Guidance::ask(const Now& now, GuideSearch& search) {
  GuideRequest& request = search.request();
  request.number = ++asked_;
  request.time_s = now.time_s;
  request.allowance = now.allowance;
  request.q = now.q;
  request.goals = now.goals;
  request.goal = passes_ ? pass_goal_ : now.goal_index;
  request.passes = passes_;
  request.way_start = goal_start_;
  request.target.reset();
  if (follows() && now.target != nullptr) request.target = now.target->pose;
  request.search = asked_;
  request.kept_count = 0;
  request.lead.reset();
  if (lead_ == LeadState::sought)
    request.lead = Lead{motion_.get(), now.reference.time_s + ahead_s_};
  else if (mode_ == Mode::guided && !follows())
    fill_kept(now, request);
  if (mode_ == Mode::waiting && count_ == 0 && !follows()) {
    ++number_;
    hold(now);
  }
  asked_s_ = now.time_s;
  awaits_ = true;
  wants_ = false;
  search.ask();
}

Guidance::News Guidance::take(const Now& now, GuideSearch& search) {
  GuideAnswer& answer = search.take();
  if (answer.number != asked_ || (before_ && before_.get() == now.in_force)) return News::none;
  // docs/theory.md (17.5)
  if (now.time_s < asked_s_ + check_time_s_ * static_cast<double>(answer.checks)) return News::none;
  awaits_ = false;
  if (passes_) {
    figures_.checks += answer.checks;
    take_pass(now, answer);
    return News::none;
  }
  world_ = answer.snapshot;
  figures_.checks += answer.checks;
  if (answer.kept) {
    ++figures_.kept;
    pass_tried_ = false;
    return News::none;
  }
  ++figures_.searches;
  if (lead_ == LeadState::sought) {
    take_lead(now, answer);
    return News::none;
  }
  if (answer.path.found() && answer.path.points.cols() <= path_.cols()) {
    passing_ = false;
    ++figures_.found;
    figures_.length = answer.path.length;
    figures_.option = answer.path.goal;
    margin_m_ = answer.path.margin_m;
    cause_.assign(answer.motion_cause, 0, cause_max);
    before_.swap(answer.motion);  // the memory of the one before goes back with the answer
    before_.swap(motion_);
    set_path(now, answer.path.points);
    return News::path;
  }
  cause_.assign(answer.path.cause, 0, cause_max);
  if (mode_ == Mode::waiting && !needs_path_) {
    mode_ = Mode::unguided;
    if (!follows()) ++number_;
  }
  return News::no_path;
}

// One that comes too late is asked for again, from a later time on.
void Guidance::take_lead(const Now& now, GuideAnswer& answer) {
  const bool usable = answer.motion && answer.path.points.cols() <= path_.cols() &&
                      answer.lead->path == now.followed && now.reference.rate > full_rate;
  if (!usable) return end_lead(now);
  if (now.reference.time_s > answer.lead->time_s) {
    ahead_s_ *= 2.0;
    if (ahead_s_ > ahead_most_s) return end_lead(now);
    wants_ = true;
    return;
  }
  keep_next(answer);
}

void Guidance::keep_next(GuideAnswer& answer) {
  next_.motion.swap(answer.motion);
  next_.points.swap(answer.path.points);
  next_.length = answer.path.length;
  next_.option = answer.path.goal;
  next_.margin_m = answer.path.margin_m;
  next_.begin_s = answer.lead->time_s;
  next_.passed_by_s = answer.passed_by_s;
  lead_ = LeadState::found;
}

// Without it the arm comes to rest at the goal, and goes on from there.
void Guidance::take_pass(const Now& now, GuideAnswer& answer) {
  const bool usable = answer.motion && answer.path.points.cols() <= path_.cols() &&
                      answer.lead->path == now.followed && answer.snapshot == world_ &&
                      now.reference.time_s <= answer.lead->time_s;
  if (!usable) return end_pass();
  ++figures_.searches;
  keep_next(answer);
}

void Guidance::end_lead(const Now& now) {
  lead_ = LeadState::none;
  mode_ = Mode::waiting;
  wants_ = true;
  ++number_;
  hold(now);
}

// Both motions are the same where the arm goes over from one to the other.
Guidance::News Guidance::go_over(const Now& now) {
  const ReferenceState& reference = now.reference;
  if (now.followed != motion_.get() || reference.rate < full_rate ||
      (before_ && before_.get() == now.in_force)) {
    passes_ ? end_pass() : end_lead(now);
    return News::none;
  }
  const double time_s = reference.time_s + reference.rate * now.period_s;
  if (time_s < next_.begin_s) return News::none;
  lead_ = LeadState::none;
  ++figures_.found;
  figures_.length = next_.length;
  figures_.option = next_.option;
  margin_m_ = next_.margin_m;
  before_.swap(next_.motion);
  before_.swap(motion_);
  beginning_ = {time_s - next_.begin_s, reference.rate};
  set_path(now, next_.points);
  passing_ = std::exchange(passes_, false);
  passed_by_s_ = next_.passed_by_s;
  return News::path;
}

// The arm may have moved on since it asked.
void Guidance::set_path(const Now& now, const MatrixXd& points) {
  count_ = points.cols();
  path_.leftCols(count_) = points;
  const Place place = nearest(now.q, moved_on);
  path_.col(place.line) += place.share * (path_.col(place.line + 1) - path_.col(place.line));
  mode_ = Mode::guided;
  point_ = place.line;
  show(now, place.line, follows_paths_ || follows() ? count_ - place.line : 1);
}

Guidance::Place Guidance::nearest(const VectorXd& q, double length) const {
  Place best;
  double least = std::numeric_limits<double>::infinity();
  for (Index i = 0; i + 1 < count_ && length > 0.0; ++i) {
    const auto line = path_.col(i + 1) - path_.col(i);
    const double size = line.norm();
    if (size <= 0.0) continue;
    const double share =
        std::clamp((q - path_.col(i)).dot(line) / (size * size), 0.0, std::min(1.0, length / size));
    const double distance = (path_.col(i) + share * line - q).squaredNorm();
    if (distance < least) {
      least = distance;
      best = {i, share};
    }
    length -= size;
  }
  return best;
}

void Guidance::fill_kept(const Now& now, GuideRequest& request) const {
  const Place place = nearest(now.q, std::numeric_limits<double>::infinity());
  request.kept_count = count_ - place.line;
  request.kept.leftCols(request.kept_count) = path_.middleCols(place.line, request.kept_count);
  request.kept.col(0) += place.share * (path_.col(place.line + 1) - path_.col(place.line));
}

void Guidance::hold(const Now& now) {
  path_.col(0) = now.q;
  count_ = 1;
  show(now, 0, 1);
}

void Guidance::show(const Now& now, Index first, Index count) {
  if (!follows()) ++number_;
  shown_ = {};
  shown_.struct_size = sizeof shown_;
  shown_.type = HAMELIN_GOAL_JOINT;
  shown_.quaternion_wxyz[0] = 1.0;
  shown_.tolerance_rad = shown_tolerance;
  shown_.speed_max = scene::options_of(now.goal()).front().speed_max;
  shown_.q = path_.col(first + count - 1).data();
  shown_.path_search = mode_ == Mode::waiting ? HAMELIN_PATH_SOUGHT : HAMELIN_PATH_FOUND;
  if (!follows_paths_ || count == 1) return;
  shown_.path = path_.col(first).data();
  shown_.path_points = static_cast<std::size_t>(count);
  shown_.path_margin_m = margin_m_;
}

void Guidance::tell(hamelin_goal& goal) const noexcept {
  if (mode_ == Mode::off) return;
  goal.path_search = mode_ == Mode::waiting  ? HAMELIN_PATH_SOUGHT
                     : mode_ == Mode::guided ? HAMELIN_PATH_FOUND
                                             : HAMELIN_PATH_NOT_FOUND;
  if (mode_ != Mode::guided) return;
  goal.path = shown_.path;
  goal.path_points = shown_.path_points;
  goal.path_margin_m = margin_m_;
}

void Guidance::show_next_point(const Now& now) {
  const Index before = point_;
  while (point_ + 1 < count_ && (now.q - path_.col(point_)).lpNorm<Eigen::Infinity>() < passed)
    ++point_;
  if (point_ != before) show(now, point_, 1);
}

}  // namespace hamelin::control
