#include "guide.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace hamelin::mppi {

namespace {

constexpr int nodes_max = 3000;                // of each tree
constexpr Eigen::Index path_points_max = 200;  // of the path before it is shortened
constexpr int root_attempts = 60;
constexpr double tolerance_share_of_roots = 0.9;  // within which roots of joint goals are drawn
// Clearance of roots of a tip goal beyond what a shield keeps [m].
constexpr double root_clearance_m = 0.003, least_root_clearance_m = 0.001;
constexpr double shield_share = 0.6;  // of the margin of a shield that roots keep at least
// Share of a tip goal's tolerances within which other poses are drawn. Inverse kinematics takes the
// rest.
constexpr double tip_tolerance_share = 0.6;
constexpr double extension = 0.5;          // length of a step of a tree [rad or m]
constexpr double least_way_m = 0.02;       // ways of all points between two queries
constexpr double guide_reserve_m = 0.002;  // kept beyond the margins of rollouts
// Share of the draws around a root or the start, where ways are often narrow, and their spread [rad
// or m].
constexpr double near_share = 0.3, near_spread = 0.5;
constexpr int cuts = 120;                // attempts to shorten a path
constexpr int iterations_per_check = 4;  // of inverse kinematics count as much as one query

}  // namespace

Guide::Guide(const planning::Setup& setup, const model::Model& model, const Margins& margins,
             const dynamics::JointBox& box, const Eigen::VectorXd& levers, long budget)
    : shield_m_(std::max(setup.shield_margin_m(), setup.shield_self_margin_m())),
      kinematics_(model, box),
      box_(box),
      levers_(levers),
      margins_(margins.with_reserve(guide_reserve_m)),
      budget_(budget),
      path_(setup.dof(), path_points_max),
      draft_(setup.dof(), path_points_max),
      start_(Eigen::VectorXd::Zero(setup.dof())),
      x_(start_),
      from_(start_),
      at_(start_),
      target_(start_) {
  goal_.q = near_goal_.q = start_;
  for (auto& root : roots_) root.q = start_;
  for (auto& tree : trees_) {
    tree.q = Eigen::MatrixXd::Zero(setup.dof(), nodes_max);
    tree.parent.resize(nodes_max);
  }
}

void Guide::Tree::add(const Eigen::VectorXd& node, int from) {
  q.col(size) = node;
  parent[to_size(size++)] = from;
}

int Guide::Tree::nearest(const Eigen::VectorXd& to) const {
  Eigen::Index index = 0;
  (q.leftCols(size).colwise() - to).colwise().squaredNorm().minCoeff(&index);
  return static_cast<int>(index);
}

void Guide::begin(const Goal& goal, const Eigen::VectorXd& q, std::uint64_t seed,
                  std::uint64_t number, double reserve_m) {
  reserve_m_ = reserve_m;
  goal_ = near_goal_ = goal;
  start_ = x_ = q;
  rng_ = Rng(seed + 0x632be59bd9b4e019ULL * (number + 1));
  checks_ = 0;
  root_count_ = attempt_ = cut_ = side_ = 0;
  path_.clear();
  margins_.clear_goals();
  for (auto& tree : trees_) tree.size = 0;
  trees_[0].add(q, -1);
  phase_ = Phase::start;
}

void Guide::advance(planning::Query& query, long checks) {
  while (phase_ != Phase::idle && checks_ < checks) {
    if (phase_ == Phase::start)
      measure_start(query);
    else if (phase_ == Phase::roots)
      find_root(query);
    else if (phase_ == Phase::grow)
      grow(query);
    else
      shorten(query);
    if (phase_ != Phase::shorten && checks_ >= budget_) stop();
  }
}

double Guide::clearance(planning::Query& query, const Eigen::VectorXd& q, double at_least) {
  ++checks_;
  return query.clearance({q.data(), to_size(q.size())}, 0.0, at_least);
}

void Guide::measure_start(planning::Query& query) {
  margins_.set_start(start_, clearance(query, start_, -1.0));
  phase_ = Phase::roots;
}

// Most attempts look for places well outside the margin of a shield. The last quarter accepts those
// that a shield, which keeps less where the arm moves slowly, may yet allow.
double Guide::clearance_of_attempts(int quarter) const {
  if (quarter < 2) return shield_m_ + root_clearance_m + reserve_m_;
  return quarter == 2 ? shield_m_ + least_root_clearance_m
                      : std::max(root_clearance_m, shield_share * shield_m_);
}

void Guide::add_root(planning::Query& query, const Eigen::VectorXd& q) {
  const double distance = clearance(query, q, 0.0);
  double least = 0.0;
  if (goal_.type != HAMELIN_GOAL_JOINT) least = clearance_of_attempts(4 * attempt_ / root_attempts);
  if (distance < least) return;
  auto& root = roots_[to_size(root_count_++)];
  root.q = q;
  root.clearance = distance;
  margins_.add_goal(q, distance);
}

// Another pose within the tolerances of the goal, since the goal itself is often near an obstacle.
void Guide::draw_near_goal() {
  const auto draw = [&](double radius) -> Eigen::Vector3d {
    Eigen::Vector3d out;
    for (int i = 0; i < 3; ++i) out[i] = rng_.uniform(-1.0, 1.0);
    return out * (radius / std::max(1.0, out.norm()));
  };
  near_goal_.position = goal_.position + draw(tip_tolerance_share * goal_.tolerance_m);
  const Eigen::Vector3d turn = draw(tip_tolerance_share * goal_.tolerance_rad);
  near_goal_.rotation =
      Eigen::AngleAxisd(turn.norm(), turn.stableNormalized()).toRotationMatrix() * goal_.rotation;
}

void Guide::find_root(planning::Query& query) {
  const bool joint_goal = goal_.type == HAMELIN_GOAL_JOINT;
  if (joint_goal) {
    x_ = goal_.q;
    if (attempt_ > 0)  // the goal itself is not clear, but a place within its tolerance may be
      for (Eigen::Index i = 0; i < x_.size(); ++i)
        x_[i] += tolerance_share_of_roots * goal_.tolerance_rad * rng_.uniform(-1.0, 1.0);
    add_root(query, x_);
  } else {
    if (attempt_ > 0) draw_near_goal();
    if (kinematics_.solve(tip_target(near_goal_), x_)) add_root(query, x_);
    checks_ += kinematics_.iterations() / iterations_per_check + 1;
    box_.draw(rng_, x_);
  }
  const int enough = joint_goal ? 1 : static_cast<int>(roots_.size());
  if (++attempt_ < root_attempts && root_count_ < enough) return;
  if (root_count_ == 0) return stop();
  // The nearest root first: straight ways are tried in this order.
  std::sort(roots_.begin(), roots_.begin() + root_count_, [&](const Root& a, const Root& b) {
    return (a.q - start_).squaredNorm() < (b.q - start_).squaredNorm();
  });
  for (int i = 0; i < root_count_; ++i) trees_[1].add(root(i), -1);
  for (int i = 0; i < root_count_; ++i)
    if (motion_clear(query, start_, root(i))) {
      path_.add(start_);
      path_.add(root(i));
      return stop();
    }
  phase_ = Phase::grow;
}

bool Guide::motion_clear(planning::Query& query, const Eigen::VectorXd& from,
                         const Eigen::VectorXd& to) {
  const double way = levers_.dot((to - from).cwiseAbs());
  if (way == 0.0) return true;
  // The end first, because it is the likeliest to be in collision.
  double margin = margins_.required(to).margin_m;
  if (clearance(query, to, margin) < margin) return false;
  for (double t = std::min(least_way_m / way, 1.0); t < 1.0;) {
    at_ = from + t * (to - from);
    margin = margins_.required(at_).margin_m;
    const double distance = clearance(query, at_, margin);
    if (distance < margin) return false;
    t += std::max(least_way_m, distance - margin) / way;
  }
  return true;
}

bool Guide::extend(planning::Query& query, Tree& tree, const Eigen::VectorXd& target) {
  if (tree.size == nodes_max) return false;
  const int from = tree.nearest(target);
  from_ = tree.q.col(from);
  const double distance = (target - from_).norm();
  if (distance > extension)
    x_ = from_ + extension / distance * (target - from_);
  else
    x_ = target;
  if (!motion_clear(query, from_, x_)) return false;
  tree.add(x_, from);
  return true;
}

bool Guide::connect(planning::Query& query, Tree& tree, const Eigen::VectorXd& target) {
  do {
    if (!extend(query, tree, target)) return false;
  } while ((tree.q.col(tree.size - 1) - target).norm() > 1e-9);
  return true;
}

void Guide::draw_target() {
  box_.draw(rng_, target_);
  if (rng_.uniform() >= near_share) return;
  const auto k = static_cast<int>(rng_.below(static_cast<std::uint64_t>(root_count_) + 1));
  const Eigen::VectorXd& center = k < root_count_ ? root(k) : start_;
  for (Eigen::Index i = 0; i < target_.size(); ++i)
    target_[i] = std::clamp(center[i] + near_spread * rng_.normal(), box_.lower[i], box_.upper[i]);
}

void Guide::grow(planning::Query& query) {
  auto &tree = trees_[to_size(side_)], &other = trees_[to_size(1 - side_)];
  side_ = 1 - side_;
  draw_target();
  if (!extend(query, tree, target_)) {
    if (tree.size == nodes_max) stop();
    return;
  }
  target_ = tree.q.col(tree.size - 1);
  if (!connect(query, other, target_)) return;
  join(trees_[0].size - 1, trees_[1].size - 1);
  phase_ = path_.empty() ? Phase::idle : Phase::shorten;
}

// The path through the last nodes of both trees, which are the same place.
void Guide::join(int in_start, int in_goal) {
  draft_.clear();
  path_.clear();
  for (int node = in_start; node >= 0; node = trees_[0].parent[to_size(node)])
    draft_.add(trees_[0].q.col(node));
  for (Eigen::Index i = draft_.size(); i-- > 0;) path_.add(draft_.point(i));
  for (int node = trees_[1].parent[to_size(in_goal)]; node >= 0;
       node = trees_[1].parent[to_size(node)])
    path_.add(trees_[1].q.col(node));
  if (path_.size() == path_.capacity()) path_.clear();  // it may be incomplete
}

// Replaces a random stretch by a straight line, if this is clear.
void Guide::shorten(planning::Query& query) {
  if (++cut_ > cuts || path_.size() == 2) return stop();
  double a = rng_.uniform(0.0, path_.length()), b = rng_.uniform(0.0, path_.length());
  if (a > b) std::swap(a, b);
  path_.at(a, x_);
  path_.at(b, target_);
  if (!motion_clear(query, x_, target_)) return;
  draft_.clear();
  for (Eigen::Index i = 0; i < path_.size() && path_.arc(i) < a; ++i) draft_.add(path_.point(i));
  draft_.add(x_);
  draft_.add(target_);
  for (Eigen::Index i = 0; i < path_.size(); ++i)
    if (path_.arc(i) > b) draft_.add(path_.point(i));
  if (draft_.size() < draft_.capacity()) std::swap(path_, draft_);
}

}  // namespace hamelin::mppi
