#include "hamelin/search/edge_check.hpp"

#include <algorithm>
#include <numeric>

namespace hamelin::search {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// A sphere's tube is not asked for where it would be wider than this [m]: bisecting is cheaper.
constexpr double wide_tube_m = 0.03;
// Bounds are reduced by this, far above what rounding can add [m].
constexpr double edge_rounding_m = 1e-12;

std::size_t at(Index i) {
  return static_cast<std::size_t>(i);
}

}  // namespace

EdgeCheck::EdgeCheck(const model::Model& model, const scene::SelfField* self)
    : model_(model),
      self_(self),
      levers_(model, self),
      hints_(model.shapes().size(), -1),
      ws_(model),
      first_(model),
      last_(model),
      levels_(at(depth_max), Level{scene::PlacedShapes(model), {}, {}}) {
  all_.resize(hints_.size() + (self != nullptr ? self->pairs().size() : 0));
  std::iota(all_.begin(), all_.end(), 0);
  // Pairs first: they are few, and their distances need no map.
  std::rotate(all_.begin(), all_.begin() + shape_count(), all_.end());
  for (Level& level : levels_) level.open.reserve(all_.size());
  const Index n = model.dof();
  for (auto* x : {&start_, &end_, &dq_, &q_, &curvature_}) x->setZero(n);
  bend_ = way_ = VectorXd::Zero(shape_count());
  pair_way_ = VectorXd::Zero(levers_.pairs().rows());
}

void EdgeCheck::set_environment(const scene::Environment& environment, double time_s, bool movers) {
  environment_ = &environment;
  time_s_ = time_s;
  obstacles_ = environment.has_obstacles();
  movers_ = movers && environment.has_movers();
  std::fill(hints_.begin(), hints_.end(), -1);
}

void EdgeCheck::place(const VectorXd& q, scene::PlacedShapes& arm) {
  dynamics::forward_kinematics(model_, ws_, q);
  arm.place(model_, ws_);
  ++checks_;
}

double EdgeCheck::self_clearance(const VectorXd& q, double most_m) {
  if (self_ == nullptr) return most_m;
  place(q, last_);
  for (std::size_t pair = 0; pair < self_->pairs().size(); ++pair)
    most_m = std::min(most_m, self_->distance(pair, last_.view(), most_m));
  return most_m;
}

bool EdgeCheck::posture_clear(const VectorXd& q, double margin_m, std::span<const int> subjects) {
  place(q, last_);
  return std::all_of(subjects.begin(), subjects.end(),
                     [&](int subject) { return keeps_margin(subject, last_.view(), margin_m); });
}

bool EdgeCheck::keeps_margin(int subject, const scene::Shapes& arm, double margin_m) {
  if (subject >= shape_count()) {
    const double keep = std::min(margin_m, self_most_ + edge_rounding_m);
    return self_->distance(at(subject - shape_count()), arm, keep + edge_rounding_m) >= keep;
  }
  if (!obstacles_) return true;
  const std::size_t shape = at(subject);
  const double radius = arm.radii[shape] + margin_m;
  if (environment_
          ->nearest_standing(arm.is_capsule(shape) ? arm.from(shape) : arm.centers[shape],
                             arm.is_capsule(shape) ? arm.to(shape) : arm.centers[shape],
                             radius + edge_rounding_m, time_s_, hints_[shape])
          .distance < radius)
    return false;
  return !movers_ ||
         environment_->clearance(arm.single(shape), time_s_, margin_m + edge_rounding_m,
                                 scene::View::judge, {}, scene::Among::moving) >= margin_m;
}

void EdgeCheck::begin_motion(const VectorXd& a, const VectorXd& b, double margin_m,
                             std::span<const int> subjects) {
  subjects_ = subjects;
  open_levels_ = 0;
  begins_ = true;
  start_ = a;
  end_ = b;
  dq_ = b - a;
  margin_ = margin_m + edge_rounding_m;
  q_.setZero();
  levers_.extend_travel(a, q_);
  levers_.extend_travel(b, q_);
  levers_.curvature(dq_, curvature_);
  bend_.noalias() = 0.125 * (levers_.shapes() * curvature_);
  q_ = dq_.cwiseAbs();
  way_.noalias() = levers_.shapes() * q_;
  pair_way_.noalias() = levers_.pairs() * q_;
}

std::optional<bool> EdgeCheck::prove(long postures) {
  const long since = checks_;
  do {
    if (!next()) return false;
    if (open_levels_ == 0) return true;
  } while (checks_ - since < postures);
  return std::nullopt;
}

bool EdgeCheck::next() {
  if (begins_) {
    begins_ = false;
    // The end first, because it is the likeliest to be in collision.
    if (!posture_clear(end_, margin_, subjects_)) return false;
    place(start_, first_);
    return examine({0.0, 1.0, first_.view(), last_.view()}, subjects_);
  }
  Level& whole = levels_[at(open_levels_ - 1)];
  const Piece& piece = whole.piece;
  const scene::Shapes middle = whole.arm.view();
  const double half = 0.5 * piece.width;
  const Piece next = whole.halves++ == 0 ? Piece{piece.at + half, half, middle, piece.to}
                                         : Piece{piece.at, half, piece.from, middle};
  if (!examine(next, whole.open)) return false;
  while (open_levels_ > 0 && levels_[at(open_levels_ - 1)].halves == 2) --open_levels_;
  return true;
}

// docs/theory.md (17.2)–(17.4): a sphere strays from its chord, all else from the middle of the
// piece.
double EdgeCheck::stray(const Piece& piece, int subject) const {
  if (subject >= shape_count()) return 0.5 * piece.width * pair_way_[subject - shape_count()];
  if (piece.from.is_capsule(at(subject)) || movers_) return 0.5 * piece.width * way_[subject];
  return piece.width * piece.width * bend_[subject];
}

bool EdgeCheck::proved(const Piece& piece, int subject, const scene::Shapes& middle) {
  const bool pair = subject >= shape_count();
  const double keep =
      (pair ? std::min(margin_, self_most_ + edge_rounding_m) : margin_) + stray(piece, subject);
  if (pair)
    return self_->distance(at(subject - shape_count()), middle, keep + edge_rounding_m) > keep;
  if (!obstacles_) return true;
  const std::size_t shape = at(subject);
  if (piece.from.is_capsule(shape) || movers_)
    return environment_->clearance(middle.single(shape), time_s_, keep + edge_rounding_m) > keep;
  if (keep - margin_ > wide_tube_m) return false;
  const double radius = piece.from.radii[shape] + keep;
  return environment_
             ->nearest_standing(piece.from.centers[shape], piece.to.centers[shape],
                                radius + edge_rounding_m, time_s_, hints_[shape])
             .distance > radius;
}

bool EdgeCheck::examine(const Piece& piece, std::span<const int> subjects) {
  if (open_levels_ == depth_max) return false;
  Level& level = levels_[at(open_levels_)];
  q_ = start_ + (piece.at + 0.5 * piece.width) * dq_;
  place(q_, level.arm);
  const scene::Shapes middle = level.arm.view();
  level.open.clear();
  for (const int subject : subjects) {
    if (proved(piece, subject, middle)) continue;
    if (stray(piece, subject) <= resolution_m || !keeps_margin(subject, middle, margin_))
      return false;
    level.open.push_back(subject);
  }
  if (level.open.empty()) return true;
  level.piece = piece;
  level.halves = 0;
  ++open_levels_;
  return true;
}

}  // namespace hamelin::search
