#include "hamelin/timing/blended_path.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "hamelin/core/numbers.hpp"
#include "hamelin/search/tip_constraints.hpp"

namespace hamelin::timing {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr double next_width = 0.6;  // factor from one try to the next
constexpr int tries = 6;
// Chords by which a blend is proved [rad or m]; at least so many.
constexpr double chord = 0.08;
constexpr int chords_least = 4;
// Share of what plans leave of the tip's tolerances that a blend may use without a proof.
constexpr double reserve_share = 0.1;

}  // namespace

BlendedPath::BlendedPath(MatrixXd points)
    : points_(std::move(points)), half_(VectorXd::Zero(points_.cols())) {
  begin_ = half_;
  for (Index i = 1; i < points_.cols(); ++i)
    begin_[i] = begin_[i - 1] + (points_.col(i) - points_.col(i - 1)).norm();
}

VectorXd BlendedPath::direction(Index line) const {
  return (points_.col(line + 1) - points_.col(line)) / (begin_[line + 1] - begin_[line]);
}

VectorXd BlendedPath::turn(Index point) const {
  return direction(point) - direction(point - 1);
}

double BlendedPath::room(Index point) const {
  return std::min(begin_[point] - begin_[point - 1] - half_[point - 1],
                  begin_[point + 1] - begin_[point] - half_[point + 1]);
}

double BlendedPath::share(Index point) const {
  const double before = begin_[point] - begin_[point - 1],
               behind = begin_[point + 1] - begin_[point];
  return std::min((point > 1 ? 0.5 : 1.0) * before,
                  (point + 2 < points_.cols() ? 0.5 : 1.0) * behind);
}

// docs/theory.md (19.1)
void BlendedPath::blend_at(Index point, double x, VectorXd& q) const {
  const double d = half_[point], rest = std::max(0.0, d - std::abs(x));
  q = points_.col(point) + x * direction(x < 0.0 ? point - 1 : point) +
      rest * rest * rest / (6.0 * d * d) * turn(point);
}

Curve BlendedPath::curve() const {
  const Index n = points_.cols();
  Curve out(points_.rows(), 3);
  MatrixXd c = MatrixXd::Zero(points_.rows(), 4);
  for (Index i = 0; i + 1 < n; ++i) {
    const VectorXd along = direction(i);
    const double d0 = half_[i], d1 = half_[i + 1], line = begin_[i + 1] - begin_[i] - d0 - d1;
    if (d0 > 0.0) {  // the second half of the blend: (d − x)³ by powers of x
      const VectorXd bend = turn(i) / (6.0 * d0 * d0);
      c.col(0) = points_.col(i) + d0 * d0 * d0 * bend;
      c.col(1) = along - 3.0 * d0 * d0 * bend;
      c.col(2) = 3.0 * d0 * bend;
      c.col(3) = -bend;
      out.add(d0, c);
    }
    c.rightCols(2).setZero();
    c.col(1) = along;
    if (line > 1e-9 * length()) {
      c.col(0) = points_.col(i) + d0 * along;
      out.add(line, c);
    }
    if (d1 > 0.0) {
      c.col(0) = points_.col(i + 1) - d1 * along;
      c.col(3) = turn(i + 1) / (6.0 * d1 * d1);
      out.add(d1, c);
    }
  }
  return out;
}

// What the blend strays from its chords is kept besides the margins.
bool Blending::is_clear(const BlendedPath& path, Index point, const search::Margins& margins,
                        search::Query& query) {
  const double d = path.half_length(point);
  const int n = std::max(chords_least, 2 * static_cast<int>(std::ceil(d / chord)));
  const double h = 2.0 * d / n;
  const VectorXd stray = h * h / (8.0 * d) * path.turn(point).cwiseAbs();
  query.set_margins(margins.raised(levers_.reach(stray) + margins.slope() * stray.norm(), stray));
  VectorXd last, next;
  path.blend_at(point, -d, last);
  for (int k = 1; k <= n; ++k) {
    path.blend_at(point, -d + k * h, next);
    if (!query.motion_clear(last, next)) return false;
    last.swap(next);
  }
  return true;
}

// The half-length of a blend that needs no proof.
double Blending::unproved_half_length(const VectorXd& turn, search::Query& query) const {
  const VectorXd size = turn.cwiseAbs();
  const double cut = levers_.reach(size) / 6.0;
  double most = cut > 0.0 ? loss_m / cut : infinity;
  if (const search::TipConstraints* constraints = query.constraints())
    if (const double used = constraints->reserve_used(size) / 6.0; used > 0.0)
      most = std::min(most, reserve_share / used);
  return most;
}

void Blending::widen(BlendedPath& path, const search::Margins& margins, search::Query& query,
                     Index first, Index last) {
  for (Index i = first; i <= last; ++i) {
    const double room = path.room(i),
                 free = std::min(room, unproved_half_length(path.turn(i), query));
    double d = std::min(path.half_length(i), room);
    path.set_half_length(i, d);
    for (int k = 0; k < tries && d > free && !is_clear(path, i, margins, query); ++k) {
      d = k + 1 < tries ? std::max(free, next_width * d) : free;
      path.set_half_length(i, d);
    }
  }
}

void Blending::widen(BlendedPath& path, const search::Margins& margins, search::Query& query) {
  for (Index i = 1; i <= path.corners(); ++i) {
    const double behind = path.begin(i + 1) - path.begin(i);
    path.set_half_length(i, std::min(path.room(i), i < path.corners() ? 0.5 * behind : behind));
    widen(path, margins, query, i, i);
  }
}

}  // namespace hamelin::timing
