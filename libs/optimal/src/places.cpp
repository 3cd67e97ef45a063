#include "places.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "hamelin/optimal/timed_motion.hpp"

namespace hamelin::optimal {

ClearanceRows::ClearanceRows(const Problem& problem, const Layout& layout, Bounds& bounds)
    : clearance_(problem.clearance), layout_(layout) {
  if (clearance_ == nullptr) return;
  each_ = clearance_->rows();
  distances_ = VectorXd::Zero(each_);
  for (Index k = 0; k < layout.intervals; ++k)
    for (int i = k == 0 ? 1 : 0; i < problem.clearance_points; ++i)
      add_place(problem, k, static_cast<double>(i) / problem.clearance_points);
  for (Index r = 0; r < rows(); ++r) {
    bounds.lower.push_back(scale * problem.margin_m);
    bounds.upper.push_back(std::numeric_limits<double>::infinity());
  }
}

// docs/theory.md (18.2); the control points beyond the ends are q_0 − h v and q_N + h v.
void ClearanceRows::add_place(const Problem& problem, Index knot, double s) {
  const std::array<double, 4> basis = spline_weights(s);
  const Index N = layout_.intervals, first = std::max<Index>(0, knot - 1);
  Place place{first, std::min(N, knot + 2) - first + 1, {}, VectorXd::Zero(layout_.n),
              knot,  MatrixXd::Zero(layout_.n, each_)};
  for (Index a = 0; a < 4; ++a) {
    const Index point = knot - 1 + a;
    const double weight = basis[static_cast<std::size_t>(a)];
    place.weights[static_cast<std::size_t>(std::clamp<Index>(point, 0, N) - first)] += weight;
    if (point < 0) place.rate -= weight * problem.v_start;
    if (point > N) place.rate += weight * problem.v_goal;
  }
  places_.push_back(std::move(place));
}

void ClearanceRows::evaluate(const Knots& knots, double* values) {
  for (Place& place : places_) {
    q_ = knots.h * place.rate;
    for (Index a = 0; a < place.count; ++a) q_ += place.weight(a) * knots.q.col(place.first + a);
    clearance_->evaluate(q_, distances_, place.gradients);
    for (Index i = 0; i < each_; ++i) *values++ = scale * distances_[i];
  }
}

void ClearanceRows::add_hessian(const double* weights, HessianSum& out) const {
  const Index n = layout_.n;
  MatrixXd square(n, n);
  for (const Place& place : places_) {
    square.setZero();
    for (Index i = 0; i < each_; ++i, ++weights)
      if (const auto g = place.gradients.col(i); *weights > 0.0 && !g.isZero(0.0))
        square.noalias() += (*weights * scale * scale) * g * g.transpose();
    for (Index a = 0; a < place.count; ++a) {
      for (Index b = 0; b <= a; ++b)
        out.add(place.first + a, place.first + b, place.weight(a) * place.weight(b) * square);
      if (layout_.free_time)
        out.add_mixed(place.first + a, (place.weight(a) * layout_.h_ref) * (square * place.rate));
    }
    out.add_step(layout_.h_ref * layout_.h_ref * place.rate.dot(square * place.rate));
  }
}

std::string ClearanceRows::describe(Index row) const {
  const Place& place = places_[static_cast<std::size_t>(row / each_)];
  return fmt::format("clearance after knot {}", place.knot);
}

}  // namespace hamelin::optimal
