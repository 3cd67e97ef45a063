#include "quotient_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace hamelin::optimal {

QuotientRows::QuotientRows(const Problem& problem, const Layout& layout, Bounds& bounds)
    : layout_(layout) {
  add_positions(problem.limits, bounds);
  add_velocities(problem.limits, bounds);
  add_accelerations(problem.limits, bounds);
  add_jerks(problem.limits, bounds);
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
  for (Index i = layout_.first_point(); i < layout_.points() - layout_.first_point(); ++i)
    for (Index j = 0; j < layout_.joints(); ++j) {
      const double low = limits.position_min[j], high = limits.position_max[j];
      if (!std::isfinite(low) && !std::isfinite(high)) continue;
      rows_.push_back({"position", i, 1, j, {1.0}, 0, 1.0});
      bounds.lower.push_back(low);
      bounds.upper.push_back(high);
    }
}

void QuotientRows::add_velocities(const Limits& limits, Bounds& bounds) {
  if (limits.velocity.size() == 0) return;
  for (Index i = 1; i <= layout_.intervals(); ++i)
    for (Index j = 0; j < layout_.joints(); ++j)
      add(limits.velocity, {"velocity", i, 2, j, {-1.0, 1.0}, 1, 1.0}, bounds);
}

void QuotientRows::add_accelerations(const Limits& limits, Bounds& bounds) {
  if (limits.acceleration.size() == 0) return;
  for (Index i = 0; i <= layout_.intervals(); ++i)
    for (Index j = 0; j < layout_.joints(); ++j)
      add(limits.acceleration, {"acceleration", i, 3, j, {1.0, -2.0, 1.0}, 2, 1.0}, bounds);
}

void QuotientRows::add_jerks(const Limits& limits, Bounds& bounds) {
  if (limits.jerk.size() == 0) return;
  for (Index j = 0; j < layout_.joints(); ++j)
    for (Index i = 0; i < layout_.intervals(); ++i)
      add(limits.jerk, {"jerk", i, 4, j, {-1.0, 3.0, -3.0, 1.0}, 3, 1.0}, bounds);
}

void QuotientRows::evaluate(const Points& points, double* values) {
  inverse_[0] = 1.0;
  for (std::size_t k = 1; k < inverse_.size(); ++k) inverse_[k] = inverse_[k - 1] / points.h;
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const Row& row = rows_[r];
    double sum = 0.0;
    for (Index a = 0; a < row.count; ++a)
      sum += row.coefficient[static_cast<std::size_t>(a)] * points.q(row.joint, row.first + a);
    sums_[r] = sum;
    values[r] = row.scale * sum * inverse_[static_cast<std::size_t>(row.power)];
  }
}

double QuotientRows::by_step(Index r) const {
  const Row& row = rows_[static_cast<std::size_t>(r)];
  return -layout_.h_ref() * row.scale * row.power * sums_[static_cast<std::size_t>(r)] *
         inverse_[static_cast<std::size_t>(row.power) + 1];
}

void QuotientRows::add_hessian(const double* y, const double* weights, bool curved,
                               HessianSum& out) const {
  // of one joint each, as matrices with one entry
  MatrixXd block = MatrixXd::Zero(layout_.joints(), layout_.joints());
  VectorXd mixed = VectorXd::Zero(layout_.joints());
  for (Index r = 0; r < rows(); ++r) {
    const Row& row = rows_[static_cast<std::size_t>(r)];
    double& entry = block(row.joint, row.joint);
    for (Index a = 0; a < row.count; ++a)
      for (Index b = 0; b <= a; ++b) {
        entry = weights[r] * by_knot(row, a) * by_knot(row, b);
        out.add(row.first + a, row.first + b, block);
      }
    entry = 0.0;
    if (!layout_.free_time() || row.power == 0) continue;
    const double power = row.power, step = by_step(r), slope = curved ? y[r] : 0.0,
                 by_knot_step = -power * layout_.h_ref() * inverse_[1];
    for (Index a = 0; a < row.count; ++a) {
      mixed[row.joint] = (weights[r] * step + slope * by_knot_step) * by_knot(row, a);
      out.add_mixed(row.first + a, mixed);
    }
    mixed[row.joint] = 0.0;
    out.add_step(weights[r] * step * step + slope * row.scale * layout_.h_ref() * layout_.h_ref() *
                                                power * (power + 1.0) *
                                                sums_[static_cast<std::size_t>(r)] *
                                                inverse_[static_cast<std::size_t>(row.power) + 2]);
  }
}

std::string QuotientRows::describe(Index r) const {
  const Row& row = rows_[static_cast<std::size_t>(r)];
  return fmt::format("{} of joint {} near knot {}", row.of, row.joint + 1,
                     std::max<Index>(0, row.first + row.count / 2 - 1));
}

}  // namespace hamelin::optimal
