#include "quotients.hpp"

#include <fmt/format.h>

#include <cmath>

namespace hamelin::optimal {

QuotientRows::QuotientRows(const Problem& problem, const Layout& layout, Bounds& bounds)
    : layout_(layout) {
  add_positions(problem.limits, bounds);
  add_velocities(problem.limits, bounds);
  add_accelerations(problem, bounds);
  add_jerks(problem, bounds);
  sums_.resize(rows_.size());
}

// |row| ≤ bound of the joint, as a share of the bound
void QuotientRows::add(const VectorXd& bound, Row row, Bounds& bounds) {
  const double limit = bound[row.joint];
  if (!std::isfinite(limit)) return;
  row.scale = 1.0 / limit;
  rows_.push_back(row);
  bounds.lower.push_back(-1.0);
  bounds.upper.push_back(1.0);
  reach_ = std::max(reach_, row.count - 1);
}

void QuotientRows::add_positions(const Limits& limits, Bounds& bounds) {
  if (limits.position_min.size() == 0) return;
  for (Index k = 1; k < layout_.intervals; ++k)
    for (Index j = 0; j < layout_.n; ++j) {
      const double low = limits.position_min[j], high = limits.position_max[j];
      if (!std::isfinite(low) && !std::isfinite(high)) continue;
      rows_.push_back({"position", k, 1, j, {1.0}, 0, 0.0, 1.0});
      bounds.lower.push_back(low);
      bounds.upper.push_back(high);
    }
}

void QuotientRows::add_velocities(const Limits& limits, Bounds& bounds) {
  if (limits.velocity.size() == 0) return;
  for (Index k = 0; k < layout_.intervals; ++k)
    for (Index j = 0; j < layout_.n; ++j)
      add(limits.velocity, {"velocity", k, 2, j, {-1.0, 1.0}, 1, 0.0, 1.0}, bounds);
}

// docs/theory.md (18.6): at the ends, half a step lies between the velocities
void QuotientRows::add_accelerations(const Problem& problem, Bounds& bounds) {
  const VectorXd& limit = problem.limits.acceleration;
  if (limit.size() == 0) return;
  const Index N = layout_.intervals;
  const char* const of = "acceleration";
  for (Index j = 0; j < layout_.n; ++j) {
    add(limit, {of, 0, 2, j, {-2.0, 2.0}, 2, -2.0 * problem.v_start[j], 1.0}, bounds);
    for (Index k = 1; k < N; ++k)
      add(limit, {of, k - 1, 3, j, {1.0, -2.0, 1.0}, 2, 0.0, 1.0}, bounds);
    add(limit, {of, N - 1, 2, j, {2.0, -2.0}, 2, 2.0 * problem.v_goal[j], 1.0}, bounds);
  }
}

// The change of the acceleration from knot to knot; before the first and behind the last knot it is
// zero, a step away.
void QuotientRows::add_jerks(const Problem& problem, Bounds& bounds) {
  const VectorXd& limit = problem.limits.jerk;
  if (limit.size() == 0) return;
  const Index N = layout_.intervals;
  const char* const of = "jerk";
  for (Index j = 0; j < layout_.n; ++j) {
    const double v = problem.v_start[j], w = problem.v_goal[j];
    add(limit, {of, 0, 2, j, {-2.0, 2.0}, 3, -2.0 * v, 1.0}, bounds);
    add(limit, {of, 0, 3, j, {3.0, -4.0, 1.0}, 3, 2.0 * v, 1.0}, bounds);
    for (Index k = 1; k + 1 < N; ++k)
      add(limit, {of, k - 1, 4, j, {-1.0, 3.0, -3.0, 1.0}, 3, 0.0, 1.0}, bounds);
    add(limit, {of, N - 2, 3, j, {-1.0, 4.0, -3.0}, 3, 2.0 * w, 1.0}, bounds);
    add(limit, {of, N - 1, 2, j, {-2.0, 2.0}, 3, -2.0 * w, 1.0}, bounds);
  }
}

void QuotientRows::evaluate(const Knots& knots, double* values) {
  inverse_[0] = 1.0;
  for (std::size_t k = 1; k < inverse_.size(); ++k) inverse_[k] = inverse_[k - 1] / knots.h;
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const Row& row = rows_[r];
    double sum = 0.0;
    for (Index a = 0; a < row.count; ++a)
      sum += row.coefficient[static_cast<std::size_t>(a)] * knots.q(row.joint, row.first + a);
    sums_[r] = sum;
    const auto p = static_cast<std::size_t>(row.power);
    values[r] = row.scale * (sum * inverse_[p] + (p > 0 ? row.rate * inverse_[p - 1] : 0.0));
  }
}

double QuotientRows::by_step(Index r) const {
  const Row& row = rows_[static_cast<std::size_t>(r)];
  const auto p = static_cast<std::size_t>(row.power);
  return -layout_.h_ref * row.scale *
         (row.power * sums_[static_cast<std::size_t>(r)] * inverse_[p + 1] +
          (row.power - 1) * row.rate * inverse_[p]);
}

void QuotientRows::add_hessian(const double* y, const double* weights, bool curved,
                               BandedMatrix& out) const {
  for (Index r = 0; r < rows(); ++r) {
    const Row& row = rows_[static_cast<std::size_t>(r)];
    const auto block_of = [&](Index a) { return row.first + a - 1; };
    for (Index a = 0; a < row.count; ++a)
      for (Index b = 0; b <= a; ++b)
        if (layout_.varies(row.first + a) && layout_.varies(row.first + b))
          out.block(block_of(a), block_of(b))(row.joint, row.joint) +=
              weights[r] * by_knot(row, a) * by_knot(row, b);
    if (!layout_.free_time || row.power == 0) continue;
    const auto p = static_cast<std::size_t>(row.power);
    const double power = row.power, step = by_step(r),
                 by_knot_step = -power * layout_.h_ref * inverse_[1], slope = curved ? y[r] : 0.0;
    for (Index a = 0; a < row.count; ++a)
      if (layout_.varies(row.first + a))
        out.border()[layout_.variable(row.first + a, row.joint)] +=
            (weights[r] * step + slope * by_knot_step) * by_knot(row, a);
    out.corner() += weights[r] * step * step +
                    slope * row.scale * layout_.h_ref * layout_.h_ref * power *
                        ((power + 1.0) * sums_[static_cast<std::size_t>(r)] * inverse_[p + 2] +
                         (power - 1.0) * row.rate * inverse_[p + 1]);
  }
}

std::string QuotientRows::describe(Index r) const {
  const Row& row = rows_[static_cast<std::size_t>(r)];
  return fmt::format("{} of joint {} at knot {}", row.of, row.joint + 1, row.first + row.count / 2);
}

}  // namespace hamelin::optimal
