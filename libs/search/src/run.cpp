#include "run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "hamelin/search/joint_metric.hpp"
#include "hamelin/search/ways.hpp"
#include "search_input.hpp"

namespace hamelin::search {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Distance from a goal and from the start at which its margin counts fully, and not at all. A path
// soon leads away from a tight start: planners keep their margin there.
constexpr double near_goal = 0.2, far_goal = 0.9, near_start = 0.02, far_start = 0.3;
constexpr double start_slack_m = 2e-4;  // by which the clearance of the start may be undercut
constexpr double range = 0.5;           // the longest edge by which a tree grows
// The same where the tip keeps constraints, and what a step gains at least, as a share.
constexpr double constrained_range = 0.25, least_progress = 0.2;
// Share of the samples around the start or a root, where ways are often narrow, and their spread.
constexpr double near_share = 0.3, near_spread = 0.5;
constexpr double near_known_share = 0.7;  // around the gap in a known path
constexpr double met = 1e-9;              // distance of configurations that count as one
constexpr long root_checks = 200;         // after so many checks another root is looked for
constexpr std::size_t nodes = 4096;
/// The margins that a search keeps one after the other, as shares of the full one, and the share of
/// its checks that all of them up to this one may use.
struct Attempt {
  double share, used;
};
constexpr std::array<Attempt, 3> attempts{{{1.0, 0.005}, {0.5, 0.05}, {0.1, 1.0}}};

}  // namespace

Search::Run::Run(const model::Model& model, const Settings& settings)
    : settings_(settings),
      model_(model),
      ws_(model),
      weights_(joint_weights(model)),
      box_(joint_box(model, settings)),
      bounds_(box_),
      finder_(model, box_, settings_, weights_),
      follower_(model, box_),
      shortening_(model.dof()),
      from_start_(weights_, nodes),
      from_goal_(weights_, nodes),
      sample_(VectorXd::Zero(model.dof())),
      at_(sample_),
      aim_(sample_) {}

void Search::Run::begin(const Problem& problem, Query& query) {
  problem_ = problem;
  query_ = &query;
  before_ = query.checks();
  followed_ = -follower_.checks();
  path_ = {};
  rng_ = rng_of(settings_, problem);
  roots_.clear();
  from_start_.clear();
  from_goal_.clear();
  tried_ = attempt_ = 0;
  asked_ = knows_ = follows_known_ = false;
  tries_known_ = problem_.known.cols() > 0;
  bounds_ = box_;
  head_ = problem_.start;
  blocked_.clear();
  finder_.begin(problem_);
  phase_ = problem_.way ? Phase::follow_way : Phase::first_root;
  start_clearance_ = query.clearance(problem_.start, -1.0);
  if (start_clearance_ <= 0.0) return end("the arm is in contact where it is");
  const double self = query.self_clearance(problem_.start, settings_.self_margin_m + start_slack_m);
  self_most_ = std::max(0.0, self - start_slack_m);
  constraints_ = query.constraints();
  if (constraints_ != nullptr) {
    if (const auto excess = constraints_->excess(problem_.start); excess.by > 0.0)
      return end("where the arm is, " + constraints_->describe(excess));
    constraints_->admit(problem_.start);
  }
  bounds_.lower = bounds_.lower.cwiseMin(problem_.start);
  bounds_.upper = bounds_.upper.cwiseMax(problem_.start);
  if (problem_.retreat && !retreat()) end("the retreat is " + blocked_);
}

bool Search::Run::advance(long checks) {
  const long until = used() + checks;
  while (phase_ != Phase::ended && used() < until) {
    if (!asked_) {
      step();
    } else if (const std::optional<bool> clear = query_->prove(until - used())) {
      asked_ = false;
      take_answer(*clear);
    }
  }
  return phase_ == Phase::ended;
}

void Search::Run::ask(const VectorXd& a, const VectorXd& b) {
  query_->begin_motion(a, b);
  asked_ = true;
}

void Search::Run::step() {
  switch (phase_) {
    case Phase::follow_way:
      return follow_way();
    case Phase::first_root:
      return find_first_root();
    case Phase::more_roots:
      return find_more_roots();
    case Phase::straight:
      return ask(head_.rightCols<1>(), roots_[tried_].tail.rightCols<1>());
    case Phase::known_ahead:
    case Phase::known_back:
      return follow_known();
    case Phase::grow:
      return grow();
    case Phase::connect:
    case Phase::walk:
      return connect();
    case Phase::shorten:
      return shorten();
    case Phase::improve:
      return improve();
    case Phase::ended:
      return;
  }
}

void Search::Run::take_answer(bool clear) {
  switch (phase_) {
    case Phase::straight:
      return take_straight(clear);
    case Phase::known_ahead:
    case Phase::known_back:
      return take_known(clear);
    case Phase::grow:
      if (!clear) return;
      node_ = (grows_start_ ? from_start_ : from_goal_).add(sample_, near_);
      phase_ = Phase::connect;
      return;
    case Phase::connect:
    case Phase::walk:
      return take_connected(clear);
    case Phase::shorten:
    case Phase::improve:
      if (shortening_.answer(clear)) ask(shortening_.from(), shortening_.to());
      return;
    case Phase::follow_way:
    case Phase::first_root:
    case Phase::more_roots:
    case Phase::ended:
      return;
  }
}

void Search::Run::find_first_root() {
  Root root;
  if (tries_known_) {
    tries_known_ = false;
    knows_ = finder_.take(problem_.known.rightCols<1>(), *query_, root);
  }
  if (!knows_) {
    if (!finder_.tries(0)) return end(no_root());
    if (!finder_.attempt(*query_, rng_, root)) return;
  }
  if (!add_root(root)) return;
  add_chain(head_, from_start_);
  phase_ = Phase::straight;
}

std::string Search::Run::no_root() const {
  if (const auto& excess = finder_.excess(); excess && excess->by > 0.0)
    return "at the goal, " + constraints_->describe(*excess);
  if (!blocked_.empty()) return "the approach to the goal is " + blocked_;
  if (problem_.goals.size() == 1) return "no clear configuration was found at the goal";
  return fmt::format("no clear configuration was found at any of {} goals", problem_.goals.size());
}

bool Search::Run::add_root(const Root& root) {
  roots_.push_back(root);
  set_margins();
  if (!approach(roots_.back())) {
    finder_.reject(root);
    roots_.pop_back();
    knows_ = false;
    if (!roots_.empty()) set_margins();
    return false;
  }
  bounds_.lower = bounds_.lower.cwiseMin(roots_.back().tail.rowwise().minCoeff());
  bounds_.upper = bounds_.upper.cwiseMax(roots_.back().tail.rowwise().maxCoeff());
  return true;
}

// A tail is proved to keep what is kept near its root, with the margins of the first attempt.
bool Search::Run::approach(Root& root) {
  root.tail = root.q;
  const std::optional<scene::Stretch>& stretch = problem_.goals[root.goal].approach;
  if (!stretch) return true;
  dynamics::forward_kinematics(model_, ws_, root.q);
  const TipCurve curve = approach_curve(*stretch, dynamics::tip_pose(model_, ws_));
  FollowedWay found = follower_.follow(curve, stretch->tolerance, root.q, *query_, rng_);
  blocked_ = std::move(found.cause);
  root.tail = std::move(found.points);
  return found.share >= 1.0;
}

bool Search::Run::retreat() {
  dynamics::forward_kinematics(model_, ws_, problem_.start);
  const TipCurve curve = retreat_curve(*problem_.retreat, dynamics::tip_pose(model_, ws_));
  for (attempt_ = 0; attempt_ < attempts.size(); ++attempt_) {
    set_margins();
    FollowedWay found =
        follower_.follow(curve, problem_.retreat->tolerance, problem_.start, *query_, rng_);
    head_ = std::move(found.points);
    blocked_ = std::move(found.cause);
    if (found.share >= 1.0) return true;
  }
  return false;
}

void Search::Run::follow_way() {
  FollowedWay best;
  for (attempt_ = 0; attempt_ < attempts.size() && best.share < 1.0; ++attempt_) {
    set_margins();
    FollowedWay found = follower_.follow(*problem_.way, problem_.goals.front().way->tolerance,
                                         problem_.start, *query_, rng_);
    if (attempt_ == 0 || found.share > best.share) best = std::move(found);
  }
  path_.way_share = best.share;
  if (best.share >= 1.0) return found_first(best.points);
  path_.way = std::move(best.points);
  end("the way is " + best.cause);
}

int Search::Run::add_chain(const MatrixXd& points, Tree& tree) {
  int node = -1;
  for (Index i = 0; i < points.cols(); ++i) node = tree.add(points.col(i), node);
  return node;
}

void Search::Run::set_margins() {
  margins_.emplace(attempts[attempt_].share * settings_.margin_m, weights_);
  margins_->set_self_most(self_most_);
  margins_->add(problem_.start, std::max(0.0, start_clearance_ - start_slack_m), near_start,
                far_start);
  for (const Root& root : roots_)
    margins_->add(root.q,
                  std::max(std::min(settings_.least_m, 0.5 * root.clearance),
                           root.clearance - settings_.slack_m),
                  near_goal, far_goal);
  query_->set_margins(*margins_);
}

// The straight way to a root, which nothing can shorten.
void Search::Run::take_straight(bool clear) {
  const Root& root = roots_[tried_++];
  if (clear) {
    MatrixXd points(root.q.size(), head_.cols() + root.tail.cols());
    points << head_, root.tail.rowwise().reverse();
    return found_first(points);
  }
  add_chain(root.tail, from_goal_);
  if (tried_ == roots_.size()) begin_growing();
}

void Search::Run::begin_growing() {
  next_root_ = used() + root_checks;
  phase_ = Phase::grow;
  if (!knows_ || follows_known_) return;
  follows_known_ = true;
  known_from_ = 0;
  known_to_ = problem_.known.cols() - 1;
  known_start_ = known_goal_ = 0;
  phase_ = Phase::known_ahead;
}

// The next piece of the known path, from the start until one is not clear, then from its end.
void Search::Run::follow_known() {
  const bool ahead = phase_ == Phase::known_ahead;
  at_ = ahead ? from_start_.q(known_start_) : from_goal_.q(known_goal_);
  if (ahead)
    sample_ = problem_.known.col(known_from_);
  else if (known_to_ > known_from_)
    sample_ = problem_.known.col(known_to_ - 1);
  else
    sample_ = from_start_.q(known_start_);
  const double distance = weighted_distance(weights_, at_, sample_);
  known_ends_ = distance <= range;
  if (!known_ends_) sample_ = at_ + range / distance * (sample_ - at_);
  ask(at_, sample_);
}

void Search::Run::take_known(bool clear) {
  const bool ahead = phase_ == Phase::known_ahead;
  if (!clear) {
    phase_ = ahead ? Phase::known_back : Phase::grow;
  } else if (known_ends_ && known_from_ == known_to_) {
    join(known_start_, known_goal_);
  } else if (ahead) {
    known_start_ = from_start_.add(sample_, known_start_);
    known_from_ += known_ends_ ? 1 : 0;
  } else {
    known_goal_ = from_goal_.add(sample_, known_goal_);
    known_to_ -= known_ends_ ? 1 : 0;
  }
}

// Until a root was found, or a batch is at its end.
void Search::Run::find_more_roots() {
  Root root;
  if (finder_.attempt(*query_, rng_, root)) {
    if (add_root(root)) phase_ = Phase::straight;
  } else if (!finder_.in_batch()) {
    next_root_ = used() + root_checks;
    phase_ = Phase::grow;
  }
}

void Search::Run::draw() {
  if (rng_.uniform() >= (knows_ ? near_known_share : near_share)) {
    for (Index j = 0; j < sample_.size(); ++j)
      sample_[j] = rng_.uniform(bounds_.lower[j], bounds_.upper[j]);
    return;
  }
  set_center();
  for (Index j = 0; j < sample_.size(); ++j)
    sample_[j] = std::clamp(at_[j] + near_spread / weights_[j] * rng_.normal(), bounds_.lower[j],
                            bounds_.upper[j]);
}

// Start or root, or an end of what is clear of the known path.
void Search::Run::set_center() {
  const auto k = static_cast<std::size_t>(rng_.below(knows_ ? 2 : roots_.size() + 1));
  if (knows_)
    at_ = k == 0 ? from_start_.q(known_start_) : from_goal_.q(known_goal_);
  else
    at_ = k < roots_.size() ? roots_[k].q : problem_.start;
}

// The smaller tree grows towards a sample.
void Search::Run::grow() {
  const double share = attempts[attempt_].used;
  if (static_cast<double>(used()) >= share * static_cast<double>(settings_.checks_max))
    return next_margins();
  if (used() >= next_root_ && finder_.tries(roots_.size())) {
    phase_ = Phase::more_roots;
    return;
  }
  grows_start_ = from_start_.size() <= from_goal_.size();
  Tree& tree = grows_start_ ? from_start_ : from_goal_;
  draw();
  near_ = tree.nearest(sample_);
  at_ = tree.q(near_);
  aim_ = sample_;
  if (step_towards(aim_)) ask(at_, sample_);
}

// Sets sample_ to a place at most a range from at_ towards another, where the tip keeps its
// constraints. @return whether that is nearer
bool Search::Run::step_towards(const VectorXd& to) {
  const double distance = weighted_distance(weights_, at_, to),
               longest = constraints_ != nullptr ? constrained_range : range;
  if (distance < met) return false;
  if (distance > longest)
    sample_ = at_ + longest / distance * (to - at_);
  else
    sample_ = to;
  if (constraints_ == nullptr) return true;
  if (distance > longest && !constraints_->project(sample_, box_)) return false;
  const double step = weighted_distance(weights_, at_, sample_);
  return step > met && step < 2.0 * longest &&
         weighted_distance(weights_, sample_, to) <
             distance - least_progress * std::min(distance, longest);
}

// The other tree tries the whole line to the new node, or steps towards it where the tip keeps
// constraints.
void Search::Run::connect() {
  const Tree& other = grows_start_ ? from_goal_ : from_start_;
  if (phase_ == Phase::connect) {
    near_ = other.nearest(sample_);
    aim_ = sample_;
  }
  at_ = other.q(near_);
  if (weighted_distance(weights_, at_, aim_) < met) return take_connected(true);
  if (constraints_ != nullptr && !step_towards(aim_)) {
    phase_ = Phase::grow;
    return;
  }
  ask(at_, sample_);
}

void Search::Run::take_connected(bool clear) {
  phase_ = Phase::grow;
  if (!clear) return;
  if (constraints_ != nullptr && weighted_distance(weights_, sample_, aim_) >= met) {
    near_ = (grows_start_ ? from_goal_ : from_start_).add(sample_, near_);
    phase_ = Phase::walk;
    return;
  }
  grows_start_ ? join(node_, near_) : join(near_, node_);
}

void Search::Run::join(int in_start, int in_goal) {
  std::vector<VectorXd> points;
  for (int i = in_start; i >= 0; i = from_start_.parent(i)) points.emplace_back(from_start_.q(i));
  std::reverse(points.begin(), points.end());
  for (int i = in_goal; i >= 0; i = from_goal_.parent(i))
    if ((VectorXd(from_goal_.q(i)) - points.back()).norm() > met)
      points.emplace_back(from_goal_.q(i));
  MatrixXd matrix(problem_.start.size(), static_cast<Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) matrix.col(static_cast<Index>(i)) = points[i];
  found_first(matrix);
}

void Search::Run::found_first(const MatrixXd& points) {
  path_.planned = points;
  path_.first_checks = used();
  if (!problem_.shortens || problem_.way) return finish(points);
  shortening_.begin(points);
  phase_ = Phase::shorten;
}

void Search::Run::shorten() {
  if (!shortening_.shortened()) {
    if (shortening_.propose(rng_)) ask(shortening_.from(), shortening_.to());
    return;
  }
  improve_until_ = used() + settings_.improve_checks;
  phase_ = Phase::improve;
}

void Search::Run::improve() {
  if (used() >= improve_until_ || shortening_.points().cols() <= 2)
    return finish(shortening_.points());
  if (shortening_.propose(rng_))
    ask(shortening_.from(), shortening_.to());
  else
    --improve_until_;  // a search must end although nothing is tried
}

void Search::Run::next_margins() {
  path_.states += from_start_.size() + from_goal_.size();
  from_start_.clear();
  from_goal_.clear();
  if (++attempt_ == attempts.size())
    return end(fmt::format("no path was found within {} checks", settings_.checks_max));
  set_margins();
  add_chain(head_, from_start_);
  follows_known_ = false;
  tried_ = 0;
  phase_ = Phase::straight;
}

void Search::Run::finish(const MatrixXd& points) {
  path_.points = points;
  path_.length = path_length(path_.points);
  path_.margin_m = margins_->full_m();
  path_.states += from_start_.size() + from_goal_.size();
  end({});
}

void Search::Run::end(std::string cause) {
  path_.cause = std::move(cause);
  path_.checks = used();
  path_.roots = static_cast<int>(roots_.size());
  path_.goals = finder_.figures();
  for (const Root& root : roots_)
    if (path_.points.cols() > 0 && root.q == path_.points.rightCols<1>()) path_.goal = root.goal;
  phase_ = Phase::ended;
}

}  // namespace hamelin::search
