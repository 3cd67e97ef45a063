#include "tree.hpp"

#include <algorithm>
#include <cmath>

namespace hamelin::hybrid {

namespace {

constexpr int extend_steps = 40, connect_steps = 80, direct_tries = 4;
constexpr double join_tolerance = 0.04;
// Shares of vias from all of joint space, and of vias near a node if a path is blocked.
constexpr double tree_global_share = 0.3, local_share = 0.5;
// Range of the radius of the other vias around a node.
constexpr double near_radius = 0.3, far_radius = 2.5;
// Short cuts: lines tried, spacing of the checks, least ratio of the lengths, clearance of the
// lines.
constexpr int cut_tries = 40;
constexpr double cut_spacing = 0.03, cut_gain = 1.03;
constexpr double cut_margin_share = 0.8, cut_margin_m = 0.004;

}  // namespace

Tree::Tree(const planning::Setup& setup, Rollout& rollout, Roots& roots, const JointBox& box,
           const Margins& margins, Surroundings& surroundings, int budget)
    : box_(box),
      margins_(margins),
      rollout_(rollout),
      roots_(roots),
      surroundings_(surroundings),
      seed_(setup.seed() ^ 0x7472656573ULL),
      rng_(seed_),
      budget_(budget),
      path_(setup.dof(), budget + 2 * cut_tries + 16),
      via_(setup.dof()),
      point_(setup.dof()),
      from_(setup.dof()),
      to_(setup.dof()) {
  const int capacity = budget + Roots::max_count + 1;
  for (auto& tree : trees_) {
    tree.q.resize(setup.dof(), capacity);
    tree.parent.reserve(static_cast<std::size_t>(capacity));
  }
}

void Tree::begin(const hamelin_goal& goal, const Eigen::VectorXd& q, const JointPath* goal_path,
                 double from) {
  for (auto& tree : trees_) tree.parent.clear();
  path_.clear();
  add(0, q, -1);
  rollout_.set_goal(goal);
  roots_.begin(goal, q, goal_path, from);
  local_ = goal_path != nullptr;
  direct_ = rounds_ = 0;
  budget_left_ = budget_;
  phase_ = Phase::roots;
}

int Tree::add(int side, const Eigen::Ref<const Eigen::VectorXd>& q, int parent) {
  auto& tree = trees_[static_cast<std::size_t>(side)];
  if (tree.size() == tree.q.cols()) return parent;
  tree.q.col(tree.size()) = q;
  tree.parent.push_back(parent);
  return tree.size() - 1;
}

int Tree::nearest(int side, const Eigen::VectorXd& q) const {
  const auto& tree = trees_[static_cast<std::size_t>(side)];
  int best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < tree.size(); ++i) {
    const double distance = (tree.q.col(i) - q).cwiseProduct(box_.weights).squaredNorm();
    if (distance < least) least = distance, best = i;
  }
  return best;
}

bool Tree::advance(int units) {
  while (units > 0 && phase_ != Phase::done) {
    switch (phase_) {
      case Phase::roots: {
        const int used = roots_.advance(units, rng_);
        units -= used;
        units_ += used;
        if (!roots_.done()) break;
        for (int i = 0; i < roots_.count(); ++i) add(1, roots_.q(i), -1);
        if (roots_.count() == 0)
          phase_ = Phase::done;
        else
          start_direct();
        break;
      }
      case Phase::direct:
      case Phase::extend:
      case Phase::connect:
        --units;
        ++units_;
        if (budget_left_-- > 0)
          advance_rollout();
        else
          phase_ = Phase::done;
        break;
      case Phase::straighten:
        --units;
        ++units_;
        straighten();
        break;
      case Phase::done:
        break;
    }
  }

  return phase_ == Phase::done;
}

void Tree::start_direct() {
  phase_ = Phase::direct;
  side_ = 0;
  node_ = first_node_ = 0;
  other_ = direct_;
  point_ = trees_[0].q.col(0);
  to_ = roots_.q(direct_);
  rollout_.begin(point_, to_, connect_steps, join_tolerance);
}

void Tree::start_extension() {
  phase_ = Phase::extend;
  side_ = rounds_++ % 2;
  const auto& tree = trees_[static_cast<std::size_t>(side_)];
  const bool local = local_ && rng_.uniform() < local_share;
  if (!local && rng_.uniform() < tree_global_share) {
    box_.draw(rng_, via_);
  } else {
    point_ =
        tree.q.col(static_cast<Eigen::Index>(rng_.below(static_cast<std::uint64_t>(tree.size()))));
    const double radius = local ? std::min(far_radius, rng_.uniform(0.2, 0.4 + 0.02 * rounds_))
                                : rng_.uniform(near_radius, far_radius);
    box_.draw_near(rng_, point_, radius, via_);
  }
  node_ = first_node_ = nearest(side_, via_);
  point_ = tree.q.col(node_);
  rollout_.begin(point_, via_, extend_steps, via_tolerance);
}

void Tree::advance_rollout() {
  using Step = Rollout::Step;
  switch (rollout_.step()) {
    case Step::moved:
      node_ = add(side_, rollout_.q(), node_);
      return;
    case Step::arrived:
      return finish_rollout(true);
    case Step::ended:
      return finish_rollout(false);
    case Step::touched: {
      // The last node is in contact, so it is removed. It has no children yet.
      auto& tree = trees_[static_cast<std::size_t>(side_)];
      if (node_ != first_node_ && node_ == tree.size() - 1) {
        node_ = tree.parent.back();
        tree.parent.pop_back();
      }
      return finish_rollout(false);
    }
  }
}

void Tree::finish_rollout(bool arrived) {
  if (phase_ == Phase::extend && node_ != first_node_) {
    phase_ = Phase::connect;
    point_ = trees_[static_cast<std::size_t>(side_)].q.col(node_);
    other_ = nearest(1 - side_, point_);
    to_ = trees_[static_cast<std::size_t>(1 - side_)].q.col(other_);
    first_node_ = node_;
    rollout_.begin(point_, to_, connect_steps, join_tolerance);
    return;
  }
  if (phase_ != Phase::extend && arrived) return join(node_, other_);
  if (phase_ == Phase::direct && ++direct_ < std::min(roots_.count(), direct_tries))
    return start_direct();
  start_extension();
}

void Tree::join(int node, int other_node) {
  const int start = side_ == 0 ? node : other_node, end = side_ == 0 ? other_node : node;
  for (int i = start; i >= 0; i = trees_[0].parent[static_cast<std::size_t>(i)])
    path_.add(trees_[0].q.col(i));
  path_.reverse();
  int root = end;
  for (int i = end; i >= 0; i = trees_[1].parent[static_cast<std::size_t>(i)]) {
    path_.add(trees_[1].q.col(i));
    root = i;
  }
  rejoin_arc_length_ = roots_.arc_length(root);
  phase_ = Phase::straighten;
  cuts_ = 0;
  next_cut();
}

void Tree::next_cut() {
  while (cuts_++ < cut_tries) {
    cut_a_ = rng_.uniform(0.0, path_.length());
    cut_b_ = rng_.uniform(0.0, path_.length());
    if (cut_a_ > cut_b_) std::swap(cut_a_, cut_b_);
    path_.at(cut_a_, from_);
    path_.at(cut_b_, to_);
    const double straight = (to_ - from_).norm();
    if (cut_b_ - cut_a_ < cut_gain * straight + 1e-9) continue;
    cut_step_ = 0;
    cut_steps_ = std::max(1, static_cast<int>(std::ceil(straight / cut_spacing)));
    return;
  }
  phase_ = Phase::done;
}

void Tree::straighten() {
  if (++cut_step_ < cut_steps_) {
    const double t = static_cast<double>(cut_step_) / cut_steps_;
    point_ = (1.0 - t) * from_ + t * to_;
    const auto& margins = margins_.params();
    const double margin = std::max(cut_margin_m, cut_margin_share * margins.full_m);
    if (!surroundings_.is_clear(point_, margin, 0.4 * margins.self_m)) next_cut();
    return;
  }
  path_.cut(cut_a_, cut_b_, from_, to_);
  next_cut();
}

}  // namespace hamelin::hybrid
