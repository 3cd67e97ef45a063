#include "places.hpp"

#include <fmt/format.h>

#include <limits>

namespace hamelin::optimal {

ClearanceRows::ClearanceRows(const Problem& problem, const Layout& layout, Bounds& bounds)
    : clearance_(problem.clearance), layout_(layout) {
  if (clearance_ == nullptr) return;
  each_ = clearance_->rows();
  distances_ = VectorXd::Zero(each_);
  const Index per_interval = problem.clearance_points;
  for (Index k = 0; k < layout.intervals; ++k)
    for (Index i = k == 0 ? 1 : 0; i < per_interval; ++i)
      places_.push_back({k, static_cast<double>(i) / static_cast<double>(per_interval),
                         MatrixXd::Zero(layout.n, each_)});
  for (Index r = 0; r < rows(); ++r) {
    bounds.lower.push_back(scale * problem.margin_m);
    bounds.upper.push_back(std::numeric_limits<double>::infinity());
  }
}

void ClearanceRows::evaluate(const Knots& knots, double* values) {
  for (Place& place : places_) {
    q_ = place.share(0) * knots.q.col(place.first);
    if (place.s > 0.0) q_ += place.s * knots.q.col(place.first + 1);
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
    for (Index a = 0; a < 2; ++a)
      for (Index b = 0; b <= a; ++b)
        if (place.share(a) * place.share(b) > 0.0 && layout_.varies(place.first + a) &&
            layout_.varies(place.first + b))
          out.block(place.first + a - 1, place.first + b - 1) +=
              place.share(a) * place.share(b) * square;
  }
}

std::string ClearanceRows::describe(Index row) const {
  const Place& place = places_[static_cast<std::size_t>(row / each_)];
  return fmt::format("clearance {} knot {}", place.s > 0.0 ? "after" : "at", place.first);
}

}  // namespace hamelin::optimal
