#include "shield/line_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "hamelin/core/numbers.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

// Distances are searched this much beyond what is needed, so that later calls need no query [m].
constexpr double reserve_m = 0.1;
// Bounds from anchors are reduced by this, far above what rounding can add [m].
constexpr double rounding_m = 1e-12;
// The share of the margin that must be left at the start of a line that does not lead away; the
// other part is what the arm may have strayed. A line leads away if its distance grows by this
// share of its length.
constexpr double left_share = 0.5, away_share = 0.25;
// The share of the margin by which lines that begin too near may begin nearer than earlier ones.
constexpr double drift_share = 0.25;
// In how many pieces a line is divided, one after the other, until it is proved.
constexpr std::array<int, 3> sphere_pieces{1, 2, 8};
constexpr std::array<int, 3> two_ended_pieces{1, 4, 16};

/// What a line must keep of its distance, docs/theory.md (14.9).
class Keep {
 public:
  /// @param need what is needed @param least what is needed in any case: need without the margin
  Keep(double need, double least) : need_(need), least_(least) {}
  /// If the line begins nearer than need be, nothing may be nearer still.
  /// @param before lines of that kind before this one @return whether it may begin there
  bool begin(double distance, LineCheck::Begun& before) {
    if (distance >= need_) return true;
    const double margin = need_ - least_;
    if (distance >= before.need) before = {};
    missing_ = before.distance - drift_share * margin - distance;
    if (missing_ > 0.0) return false;
    before = {std::max(before.distance, distance), std::max(before.need, need_)};
    missing_ = need_ - distance;
    from_ = distance;
    leads_away_ = distance - least_ < left_share * margin;
    need_ = std::max(least_, distance - rounding_m);
    return true;
  }
  [[nodiscard]] double need() const noexcept { return need_; }
  [[nodiscard]] double least() const noexcept { return least_; }
  [[nodiscard]] bool leads_away() const noexcept { return leads_away_; }
  /// What a line that leads away needs at its end. @param way from its start
  [[nodiscard]] double at_end(double way) const noexcept { return from_ + away_share * way; }
  /// By how much the line begins too near.
  [[nodiscard]] double missing() const noexcept { return missing_; }

 private:
  double need_, least_, from_ = infinity, missing_ = 0.0;
  bool leads_away_ = false;
};

/// Distances at the ends of the pieces of a line, one after the other: docs/theory.md (14.7).
class TwoEnded {
 public:
  /// @param way the longest way on a piece
  TwoEnded(const Keep& keep, double way, int pieces, LineCheck::Begun& before)
      : keep_(keep), before_(before), way_(way), pieces_(pieces) {}
  /// @param chord of the piece that ends here @return whether it is clear so far
  bool goes_on(double distance, double chord) {
    const double last = std::exchange(last_, distance);
    if (ends_++ == 0) return begin(distance);
    gone_ += chord;
    const double bound = 0.5 * (last + distance - chord);
    missing_ = std::max({missing_, keep_.need() - distance, between_ - bound});
    if (distance <= keep_.need() || bound <= between_) return false;
    if (ends_ <= pieces_ || !keep_.leads_away()) return true;
    missing_ = std::max(missing_, keep_.at_end(gone_) - distance);
    return distance >= keep_.at_end(gone_);
  }
  /// By how much the line falls short of what it needs.
  [[nodiscard]] double missing() const noexcept { return missing_; }

 private:
  bool begin(double distance) {
    between_ = keep_.need();
    if (distance > between_) return true;
    const bool may_begin = keep_.begin(distance, before_);
    missing_ = keep_.missing();
    between_ = std::max(keep_.least(), keep_.need() - way_);
    return may_begin && way_ > 0.0 && keep_.need() > keep_.least();
  }

  Keep keep_;
  LineCheck::Begun& before_;
  double between_ = 0.0, way_, last_ = 0.0, gone_ = 0.0, missing_ = 0.0;
  int ends_ = 0, pieces_;
};

}  // namespace

LineCheck::LineCheck(const model::Model& model, const scene::Levers& levers,
                     const scene::SelfField* self)
    : model_(model),
      levers_(levers),
      self_(self),
      anchors_(model.shapes().size()),
      begun_(model.shapes().size()),
      pairs_begun_(static_cast<std::size_t>(levers.pairs().rows())),
      divisions_(pieces_max - 1,
                 Division{VectorXd::Zero(model.dof()), scene::PlacedShapes(model)}) {
  const Index n = model.dof(), shapes = static_cast<Index>(model.shapes().size()),
              pairs = levers.pairs().rows();
  for (auto* x : {&dq_, &curvature_, &tube_, &way_}) x->setZero(n);
  bend_ = straying_ = VectorXd::Zero(shapes);
  pair_stray_ = VectorXd::Zero(pairs);
  pair_q_.setZero(n, pairs);
  pair_distance_.setConstant(pairs, -1.0);
}

void LineCheck::forget() {
  for (Anchor& anchor : anchors_) anchor = {};
  for (Begun& begun : begun_) begun = {};
}

std::optional<LineCheck::Blocker> LineCheck::check(dynamics::Workspace& ws,
                                                   const scene::Environment* obstacles,
                                                   double time_s, const End& from, const End& to,
                                                   const Stray& stray) {
  ws_ = &ws;
  obstacles_ = obstacles;
  time_s_ = time_s;
  margin_ = stray.margin_m;
  from_ = &from;
  to_ = &to;
  dq_ = to.q - from.q;
  for (Division& division : divisions_) division.placed = false;
  Blocker blocker;
  pair_stray_.noalias() = levers_.pairs() * stray.joints;
  if (stray.shapes_m.size() > 0)
    for (Index k = 0; k < pair_stray_.size(); ++k) pair_stray_[k] += pair_addition(k, stray);
  for (std::size_t k = 0; k < static_cast<std::size_t>(pair_stray_.size()); ++k)
    if (!pair_is_clear(k, blocker)) return blocker;
  if (obstacles_ == nullptr) return std::nullopt;
  levers_.curvature(dq_, curvature_);
  tube_ = 0.125 * curvature_;
  bend_.noalias() = levers_.shapes() * tube_;
  straying_.noalias() = levers_.shapes() * stray.joints;
  if (stray.shapes_m.size() > 0) straying_ += stray.shapes_m;
  for (std::size_t i = 0; i < anchors_.size(); ++i)
    if (!shape_is_clear(i, blocker)) return blocker;
  return std::nullopt;
}

double LineCheck::largest_pair_stray(const Stray& stray) const {
  double most = 0.0;
  for (Index k = 0; k < levers_.pairs().rows(); ++k)
    most = std::max(most, levers_.pairs().row(k).dot(stray.joints) +
                              (stray.shapes_m.size() > 0 ? pair_addition(k, stray) : 0.0));
  return most + stray.margin_m;
}

// docs/theory.md (14.40): by the joints between the parts, or by all that moves either of them.
double LineCheck::pair_addition(Index pair, const Stray& stray) const {
  const auto largest = [&](int part) {
    double most = 0.0;
    for (const int s : self_->parts()[static_cast<std::size_t>(part)].shapes)
      if (s >= 0) most = std::max(most, stray.shapes_m[s]);
    return most;
  };
  const auto& both = self_->pairs()[static_cast<std::size_t>(pair)];
  return std::min(levers_.pairs().row(pair).dot(stray.errors),
                  largest(both.part_a) + largest(both.part_b));
}

double LineCheck::need(std::size_t shape, int pieces) const {
  const auto i = static_cast<Index>(shape);
  return model_.shapes()[shape].radius + margin_ + straying_[i] +
         bend_[i] / (static_cast<double>(pieces) * pieces);
}

double LineCheck::least(std::size_t shape, int pieces) const {
  return model_.shapes()[shape].radius +
         bend_[static_cast<Index>(shape)] / (static_cast<double>(pieces) * pieces);
}

double LineCheck::moved(std::size_t shape, const scene::Shapes& from,
                        const scene::Shapes& to) const {
  const Anchor& anchor = anchors_[shape];
  if (!from.is_capsule(shape))
    return std::sqrt(std::max((from.centers[shape] - anchor.a).squaredNorm(),
                              (to.centers[shape] - anchor.b).squaredNorm()));
  return std::sqrt(std::max(
      {(from.from(shape) - anchor.a).squaredNorm(), (from.to(shape) - anchor.b).squaredNorm(),
       (to.from(shape) - anchor.a).squaredNorm(), (to.to(shape) - anchor.b).squaredNorm()}));
}

double LineCheck::anchored_bound(std::size_t shape, const End& from, const End& to) const {
  return anchors_[shape].distance - moved(shape, from.arm, to.arm) - rounding_m;
}

bool LineCheck::shape_is_clear(std::size_t shape, Blocker& blocker) {
  const double bound = anchored_bound(shape, *from_, *to_);
  if (bound > begun_[shape].need) begun_[shape] = {};
  if (bound > need(shape, 1)) return true;
  return from_->arm.is_capsule(shape) ? capsule_is_clear(shape, blocker)
                                      : sphere_is_clear(shape, blocker);
}

scene::Environment::Standing LineCheck::query(const Vector3d& a, const Vector3d& b, double limit,
                                              std::int32_t& hint) {
  ++queries_;
  return obstacles_->nearest_standing(a, b, limit, time_s_, hint);
}

scene::Shapes LineCheck::at(int i, int pieces) {
  if (i == 0) return from_->arm;
  if (i == pieces) return to_->arm;
  const int slot = i * (pieces_max / pieces);
  Division& division = divisions_[static_cast<std::size_t>(slot - 1)];
  if (!division.placed) {
    division.q = from_->q + (static_cast<double>(slot) / pieces_max) * dq_;
    dynamics::forward_kinematics(model_, *ws_, division.q);
    division.arm.place(model_, *ws_);
    division.placed = true;
  }
  return division.arm.view();
}

// A sphere sweeps a tube around its chord: one query for a capsule without ends.
bool LineCheck::sphere_is_clear(std::size_t shape, Blocker& blocker) {
  Anchor& anchor = anchors_[shape];
  const Vector3d &first = from_->arm.centers[shape], &last = to_->arm.centers[shape];
  double start = infinity;
  for (const int pieces : sphere_pieces) {
    Keep keep(need(shape, pieces), least(shape, pieces));
    if (!keep.begin(start, begun_[shape])) {
      blocker.missing_m = keep.missing();
      return false;
    }
    const double radius = keep.need();
    const double limit = radius + (pieces == 1 ? reserve_m : 0.0);
    bool clear = true;
    for (int i = 0; i < pieces && clear; ++i) {
      const Vector3d& a = at(i, pieces).centers[shape];
      const Vector3d& b = at(i + 1, pieces).centers[shape];
      const auto nearest = query(a, b, limit, anchor.hint);
      clear = pieces == 1 ? nearest.distance > radius : nearest.distance >= radius;
      if (!clear) {
        blocker = {static_cast<int>(shape), nearest.obstacle, -1, radius - nearest.distance};
        anchor.distance = -1.0;
      } else if (pieces == 1) {
        anchor.a = a;
        anchor.b = b;
        anchor.distance = nearest.distance;
      }
    }
    if (clear && keep.leads_away()) {
      const double way = (last - first).norm();
      const auto nearest = query(last, last, keep.at_end(way), anchor.hint);
      const double missing = keep.at_end(way) - nearest.distance;
      clear = missing <= 0.0;
      if (!clear) blocker = {static_cast<int>(shape), nearest.obstacle, -1, missing};
    }
    if (clear) return true;
    if (dq_.isZero(0.0)) break;
    if (pieces == 1) start = query(first, first, radius, anchor.hint).distance;
  }
  return false;
}

// A capsule sweeps no simple body: distances at the ends of each piece bound those between them.
bool LineCheck::capsule_is_clear(std::size_t shape, Blocker& blocker) {
  Anchor& anchor = anchors_[shape];
  way_ = dq_.cwiseAbs();
  const double way = levers_.shapes().row(static_cast<Index>(shape)).dot(way_);
  const double tube = model_.shapes()[shape].radius;
  for (const int pieces : two_ended_pieces) {
    TwoEnded line({need(shape, pieces), tube}, way / pieces, pieces, begun_[shape]);
    bool clear = true;
    for (int i = 0; i <= pieces && clear; ++i) {
      const scene::Shapes arm = at(i, pieces);
      const auto nearest =
          query(arm.from(shape), arm.to(shape), need(shape, pieces) + reserve_m, anchor.hint);
      double chord = 0.0;
      if (i == 0) {
        anchor.a = arm.from(shape);
        anchor.b = arm.to(shape);
        anchor.distance = nearest.distance;
      } else {
        const scene::Shapes last = at(i - 1, pieces);
        chord = std::max((arm.from(shape) - last.from(shape)).norm(),
                         (arm.to(shape) - last.to(shape)).norm());
      }
      clear = line.goes_on(nearest.distance, chord);
      if (!clear) blocker = {static_cast<int>(shape), nearest.obstacle, -1, line.missing()};
    }
    if (clear) return true;
    if (dq_.isZero(0.0)) break;
  }
  return false;
}

// Only the joints between two parts change their distance: docs/theory.md (12.12).
bool LineCheck::pair_is_clear(std::size_t pair, Blocker& blocker) {
  const auto k = static_cast<Index>(pair);
  const auto lever = levers_.pairs().row(k);
  const double stray = pair_stray_[k] + margin_;
  const auto proves = [&] {
    way_ = (from_->q - pair_q_.col(k)).cwiseAbs().cwiseMax((to_->q - pair_q_.col(k)).cwiseAbs());
    const double bound = pair_distance_[k] - lever.dot(way_) - rounding_m;
    if (bound > pairs_begun_[pair].need) pairs_begun_[pair] = {};
    return bound > stray;
  };
  if (pair_distance_[k] > 0.0 && proves()) return true;
  // Larger distances are not asked for, because few pairs are ever nearer.
  constexpr double far_m = 0.3;
  pair_q_.col(k) = from_->q + 0.5 * dq_;
  pair_distance_[k] = self_->distance(pair, at(1, 2), far_m);
  if (proves()) return true;
  way_ = dq_.cwiseAbs();
  const double way = lever.dot(way_);
  for (const int pieces : two_ended_pieces) {
    TwoEnded line({stray, 0.0}, way / pieces, pieces, pairs_begun_[pair]);
    bool clear = true;
    for (int i = 0; i <= pieces && clear; ++i) {
      clear = line.goes_on(self_->distance(pair, at(i, pieces), far_m), way / pieces);
      if (!clear) blocker = {-1, scene::Contact::map, static_cast<int>(pair), line.missing()};
    }
    if (clear) return true;
    if (dq_.isZero(0.0)) break;
  }
  return false;
}

}  // namespace hamelin::control
