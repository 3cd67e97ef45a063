#include "places.hpp"

#include <fmt/format.h>

#include <limits>

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

// Cubic between two knots, with the velocities (q_{k+1} − q_{k−1})/2h at them, or those of an end.
void ClearanceRows::add_place(const Problem& problem, Index knot, double s) {
  Place place{knot, 1, {1.0}, VectorXd::Zero(layout_.n), knot, MatrixXd::Zero(layout_.n, each_)};
  if (s > 0.0) {
    const bool first = knot == 0, last = knot + 1 == layout_.intervals;
    const double r = 1.0 - s, here = (1.0 + 2.0 * s) * r * r, next = s * s * (3.0 - 2.0 * s),
                 leaving = s * r * r, arriving = -s * s * r;
    place.first = first ? knot : knot - 1;
    const std::size_t at = first ? 0 : 1;
    place.weights = {};
    place.weights[at] = here;
    place.weights[at + 1] = next;
    const auto add_velocity = [&](std::size_t before, std::size_t after, double weight) {
      place.weights[before] -= 0.5 * weight;
      place.weights[after] += 0.5 * weight;
    };
    if (first)
      place.rate += leaving * problem.v_start;
    else
      add_velocity(0, 2, leaving);
    if (last)
      place.rate += arriving * problem.v_goal;
    else
      add_velocity(at, at + 2, arriving);
    place.count = static_cast<Index>(at) + (last ? 2 : 3);
  }
  reach_ = std::max(reach_, place.count - 1);
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

void ClearanceRows::add_hessian(const double* weights, BandedMatrix& out) const {
  const Index n = layout_.n;
  MatrixXd square(n, n);
  for (const Place& place : places_) {
    square.setZero();
    for (Index i = 0; i < each_; ++i, ++weights)
      if (const auto g = place.gradients.col(i); *weights > 0.0 && !g.isZero(0.0))
        square.noalias() += (*weights * scale * scale) * g * g.transpose();
    for (Index a = 0; a < place.count; ++a) {
      if (!layout_.varies(place.first + a)) continue;
      for (Index b = 0; b <= a; ++b)
        if (layout_.varies(place.first + b))
          out.block(place.first + a - 1, place.first + b - 1) +=
              place.weight(a) * place.weight(b) * square;
      if (layout_.free_time)
        out.border().segment((place.first + a - 1) * n, n).noalias() +=
            (place.weight(a) * layout_.h_ref) * (square * place.rate);
    }
    if (layout_.free_time)
      out.corner() += layout_.h_ref * layout_.h_ref * place.rate.dot(square * place.rate);
  }
}

std::string ClearanceRows::describe(Index row) const {
  const Place& place = places_[static_cast<std::size_t>(row / each_)];
  return fmt::format("clearance {} knot {}", place.count > 1 ? "after" : "at", place.knot);
}

}  // namespace hamelin::optimal
