#include "clearance_rows.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "hamelin/core/numbers.hpp"
#include "hamelin/optimal/timed_motion.hpp"

namespace hamelin::optimal {

ClearanceRows::ClearanceRows(const Problem& problem, const Layout& layout, Bounds& bounds)
    : clearance_(problem.clearance), layout_(layout) {
  if (clearance_ == nullptr) return;
  each_ = clearance_->rows();
  far_ = scale * clearance_->far();
  const double inner = problem.margin_m + problem.reserve_m,
               start = std::min(inner, at_least(problem.q_start, problem.margin_m)),
               goal = std::min(inner, at_least(problem.q_goal, problem.margin_m));
  for (Index k = 0; k < layout.intervals(); ++k)
    for (int i = k == 0 ? 1 : 0; i < problem.clearance_points; ++i) {
      places_.push_back(
          {k, spline_weights(static_cast<double>(i) / problem.clearance_points), rows(), {}});
      const double bound = k == 0 ? start : k + 1 == layout.intervals() ? goal : inner;
      bounds.lower.insert(bounds.lower.end(), static_cast<std::size_t>(each_), scale * bound);
      bounds.upper.insert(bounds.upper.end(), static_cast<std::size_t>(each_), infinity);
    }
}

// The clearance at an end, or the margin if it is less.
double ClearanceRows::at_least(const VectorXd& q, double margin) {
  VectorXd distances(each_);
  MatrixXd gradients(q.size(), each_);
  clearance_->evaluate_all(q, distances, gradients);
  return each_ > 0 ? std::max(margin, distances.minCoeff()) : margin;
}

void ClearanceRows::evaluate(const Points& points, double* values) {
  for (Place& place : places_) {
    NearDistances& near = place.near;
    for (Index i = 0; i < near.size(); ++i)
      values[place.first_row + near.row(i)] = far_[near.row(i)];
    q_ = place.weight(0) * points.q.col(place.first);
    for (Index a = 1; a < 4; ++a) q_ += place.weight(a) * points.q.col(place.first + a);
    clearance_->evaluate(q_, near);
    for (Index i = 0; i < near.size(); ++i)
      values[place.first_row + near.row(i)] = scale * near.distance(i);
  }
}

void ClearanceRows::fill_far(double* values) const {
  for (const Place& place : places_) std::copy_n(far_.data(), each_, values + place.first_row);
}

void ClearanceRows::add_hessian(const double* weights, HessianSum& out) const {
  const Index n = layout_.joints();
  MatrixXd square(n, n);
  for (const Place& place : places_) {
    const NearDistances& near = place.near;
    if (near.size() == 0) continue;
    square.setZero();
    for (Index i = 0; i < near.size(); ++i) {
      const auto g = near.gradient(i);
      square.noalias() +=
          (weights[place.first_row + near.row(i)] * scale * scale) * g * g.transpose();
    }
    for (Index a = 0; a < 4; ++a)
      for (Index b = 0; b <= a; ++b)
        out.add(place.first + a, place.first + b, place.weight(a) * place.weight(b) * square);
  }
}

std::string ClearanceRows::describe(Index row) const {
  const Place& place = places_[static_cast<std::size_t>(row / each_)];
  return fmt::format("clearance after knot {}", place.first);
}

}  // namespace hamelin::optimal
