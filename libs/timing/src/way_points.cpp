#include "hamelin/timing/way_points.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "hamelin/search/tip_constraints.hpp"

namespace hamelin::timing {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

constexpr TimeLaw::Grid coarse{4, 0.3};
// Blends that are new are taken to be as wide as there is room for, also beyond the middle of a
// line.
constexpr double most_share = 1.6;
// Proofs of blends begin with so much more than the width that is expected.
constexpr double more_width = 1.3;
// What is worth a proof, and what is worth a change, as shares of the duration.
constexpr double worth_proof = 0.995, worth_change = 0.998;
// The spread of the changes [rad or m], and how it follows success and failure.
constexpr double first_spread = 0.3, least_spread = 0.03, most_spread = 0.4, wider = 1.3,
                 narrower = 0.985;
// Shares of the kinds of changes: a way-point less, one more, one towards the line between its
// neighbours; the others are moved at random.
constexpr double removals = 0.08, additions = 0.16, straightenings = 0.4;
constexpr Index points_usual = 6;  // no more are added
constexpr double apart = 1e-3;     // of way-points, at least [rad or m]

Limits without_torques(Limits limits) {
  limits.torque.resize(0);
  return limits;
}

bool are_apart(const MatrixXd& points) {
  for (Index i = 1; i < points.cols(); ++i)
    if ((points.col(i) - points.col(i - 1)).norm() < apart) return false;
  return true;
}

}  // namespace

WayPoints::WayPoints(const model::Model& model, const scene::Levers& levers, const Limits& limits,
                     VectorXd q_lower, VectorXd q_upper)
    : law_(model, without_torques(limits), coarse),
      blending_(levers),
      q_lower_(std::move(q_lower)),
      q_upper_(std::move(q_upper)),
      box_(model.dof(), q_lower_, q_upper_, 0.0) {}

void WayPoints::keep_limits(Index point) {
  if (q_lower_.size() > 0)
    trial_.col(point) = trial_.col(point).cwiseMax(q_lower_).cwiseMin(q_upper_);
}

// The way-points between the lines that are new.
bool WayPoints::keep_constraints(const Change& changed, search::Query& query) {
  search::TipConstraints* constraints = query.constraints();
  for (Index i = changed.first + 1; constraints != nullptr && i <= changed.last; ++i) {
    VectorXd q = trial_.col(i);
    if (!constraints->project(q, box_)) return false;
    trial_.col(i) = q;
  }
  return true;
}

// Blends are taken to be as wide as they are now, as shares of what there is room for.
void WayPoints::predict(const BlendedPath& now, const Change& changed, BlendedPath& out) const {
  const Index more = out.corners() - now.corners();
  for (Index i = 1; i <= out.corners(); ++i) {
    Index before = i;
    if (more != 0 && i > changed.first) before = i - more;
    before = std::clamp<Index>(before, 1, now.corners());
    double share = now.half_length(before) / now.share(before);
    // what is new may be clear of what was in the way
    if (i >= changed.first && i <= changed.last + 1) share = std::max(share, most_share);
    out.set_half_length(i, std::min(out.room(i), share * out.share(i)));
  }
}

WayPoints::Change WayPoints::change(const MatrixXd& from, Index fixed, Rng& rng) {
  const Index n = from.cols(),
              inner =
                  fixed + static_cast<Index>(rng.below(static_cast<std::uint64_t>(n - 1 - fixed)));
  const double kind = rng.uniform();
  trial_ = from;
  if (kind < removals && n > 3) {
    trial_.resize(from.rows(), n - 1);
    trial_ << from.leftCols(inner), from.rightCols(n - 1 - inner);
    return {inner - 1, inner - 1};
  }
  if (kind < additions && n < points_usual) {
    const auto line =
        fixed - 1 + static_cast<Index>(rng.below(static_cast<std::uint64_t>(n - fixed)));
    trial_.resize(from.rows(), n + 1);
    trial_ << from.leftCols(line + 1), 0.5 * (from.col(line) + from.col(line + 1)),
        from.rightCols(n - 1 - line);
    for (Index j = 0; j < trial_.rows(); ++j) trial_(j, line + 1) += 0.3 * spread_ * rng.normal();
    keep_limits(line + 1);
    return {line, line + 1};
  }
  if (kind < straightenings) {
    const double place = rng.uniform(), share = rng.uniform();
    const VectorXd to = from.col(inner - 1) + place * (from.col(inner + 1) - from.col(inner - 1));
    trial_.col(inner) += share * (to - from.col(inner));
  } else {
    for (Index j = 0; j < trial_.rows(); ++j) trial_(j, inner) += spread_ * rng.normal();
    keep_limits(inner);
  }
  return {inner - 1, inner};
}

// The lines that are new, and then the blends at their ends, each beginning with a little more than
// its width is now.
bool WayPoints::prove(BlendedPath& candidate, const Change& changed, const search::Margins& margins,
                      search::Query& query) {
  query.set_margins(margins);
  for (Index line = changed.first; line <= changed.last; ++line)
    if (!query.motion_clear(trial_.col(line), trial_.col(line + 1))) return false;
  const Index first = std::max<Index>(1, changed.first),
              last = std::min(candidate.corners(), changed.last + 1);
  for (Index i = first; i <= last; ++i) {
    candidate.set_half_length(i,
                              std::min(candidate.room(i), more_width * candidate.half_length(i)));
    blending_.widen(candidate, margins, query, i, i);
  }
  return true;
}

double WayPoints::improve(BlendedPath& path, const search::Margins& margins, search::Query& query,
                          Rng& rng, const Effort& effort) {
  double best = law_.duration_s(path.curve());
  const long until = query.checks() + effort.checks;
  spread_ = first_spread;
  for (int k = 0; k < effort.tries && path.corners() >= effort.fixed && query.checks() < until;
       ++k) {
    const Change changed = change(path.points(), effort.fixed, rng);
    if (!keep_constraints(changed, query) || !are_apart(trial_)) continue;
    BlendedPath candidate(trial_);
    predict(path, changed, candidate);
    if (!(law_.duration_s(candidate.curve()) < worth_proof * best)) {
      spread_ = std::max(least_spread, narrower * spread_);
      continue;
    }
    if (!prove(candidate, changed, margins, query)) continue;
    const double duration = law_.duration_s(candidate.curve());
    if (!(duration < worth_change * best)) continue;
    path = std::move(candidate);
    best = duration;
    spread_ = std::min(most_spread, wider * spread_);
  }
  return best;
}

}  // namespace hamelin::timing
