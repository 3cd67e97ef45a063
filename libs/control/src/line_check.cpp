#include "hamelin/control/line_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>

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
// In how many pieces a line is divided, one after the other, until it is proved.
constexpr std::array<int, 3> sphere_pieces{1, 2, 8};
constexpr std::array<int, 3> two_ended_pieces{1, 4, 16};

/// Distances at the ends of the pieces of a line, one after the other: docs/theory.md (14.7). Where
/// the line begins nearer than it needs to be, it must not come nearer at any end.
class TwoEnded {
 public:
  /// @param least what is needed in any case @param way the longest way on a piece
  TwoEnded(double need, double least, double way)
      : need_(need), between_(need), least_(least), way_(way) {}
  /// @param chord of the piece that ends here @return whether it is clear so far
  bool goes_on(double distance, double chord) {
    if (first_) {
      if (distance <= need_) {
        missing_ = need_ - distance;
        need_ = distance - rounding_m;
        between_ = std::max(least_, need_ - way_);
      }
      first_ = false;
      last_ = distance;
      return way_ > 0.0 ? need_ > least_ : missing_ == 0.0;
    }
    const double bound = 0.5 * (last_ + distance - chord);
    last_ = distance;
    missing_ = std::max({missing_, need_ - distance, between_ - bound});
    return distance > need_ && bound > between_;
  }
  /// By how much the line falls short of what it needs.
  [[nodiscard]] double missing() const noexcept { return missing_; }

 private:
  double need_, between_, least_, way_, last_ = 0.0, missing_ = 0.0;
  bool first_ = true;
};

}  // namespace

LineCheck::LineCheck(const model::Model& model, const Levers& levers, const scene::SelfField* self)
    : model_(model),
      levers_(levers),
      self_(self),
      anchors_(model.shapes().size()),
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
    for (Index k = 0; k < pair_stray_.size(); ++k)
      pair_stray_[k] += pair_addition(static_cast<std::size_t>(k), stray.shapes_m);
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

double LineCheck::pair_addition(std::size_t pair, const VectorXd& shapes_m) const {
  const auto largest = [&](int part) {
    double most = 0.0;
    for (const int s : self_->parts()[static_cast<std::size_t>(part)].shapes)
      if (s >= 0) most = std::max(most, shapes_m[s]);
    return most;
  };
  const auto& both = self_->pairs()[pair];
  return largest(both.part_a) + largest(both.part_b);
}

double LineCheck::need(std::size_t shape, int pieces) const {
  const auto i = static_cast<Index>(shape);
  return model_.shapes()[shape].radius + margin_ + straying_[i] +
         bend_[i] / (static_cast<double>(pieces) * pieces);
}

double LineCheck::need_from(std::size_t shape, int pieces, double distance_at_start) const {
  const double tube = model_.shapes()[shape].radius +
                      bend_[static_cast<Index>(shape)] / (static_cast<double>(pieces) * pieces);
  return std::max(tube, std::min(need(shape, pieces), distance_at_start - rounding_m));
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
  if (anchored_bound(shape, *from_, *to_) > need(shape, 1)) return true;
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
  double start = infinity;
  for (const int pieces : sphere_pieces) {
    const double radius = need_from(shape, pieces, start);
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
    if (clear) return true;
    if (dq_.isZero(0.0)) break;
    if (pieces == 1) {
      const Vector3d& a = from_->arm.centers[shape];
      start = query(a, a, radius, anchor.hint).distance;
    }
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
    TwoEnded line(need(shape, pieces), tube, way / pieces);
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
  const auto bound = [&] {
    way_ = (from_->q - pair_q_.col(k)).cwiseAbs().cwiseMax((to_->q - pair_q_.col(k)).cwiseAbs());
    return pair_distance_[k] - lever.dot(way_) - stray - rounding_m;
  };
  if (pair_distance_[k] > 0.0 && bound() > 0.0) return true;
  // Larger distances are not asked for, because few pairs are ever nearer.
  constexpr double far_m = 0.3;
  pair_q_.col(k) = from_->q + 0.5 * dq_;
  pair_distance_[k] = self_->distance(pair, at(1, 2), far_m);
  if (bound() > 0.0) return true;
  way_ = dq_.cwiseAbs();
  const double way = lever.dot(way_);
  for (const int pieces : two_ended_pieces) {
    TwoEnded line(stray, 0.0, way / pieces);
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
