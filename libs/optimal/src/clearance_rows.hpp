#pragma once
#include <array>
#include <string>
#include <vector>

#include "hessian_sum.hpp"
#include "layout.hpp"

namespace hamelin::optimal {

/// Bounds of the clearance along the motion, docs/theory.md (18.7).
class ClearanceRows {
 public:
  /// Appends its rows to the bounds.
  ClearanceRows(const Problem& problem, const Layout& layout, Bounds& bounds);

  [[nodiscard]] Index rows() const noexcept { return static_cast<Index>(places_.size()) * each_; }
  /// Writes rows() numbers.
  void evaluate(const Points& points, double* values);
  /// Calls f(row, variable, derivative) at the points of the last evaluate(); with `all` also for
  /// rows at their bound, whose derivatives are zero.
  template <bool all, class F>
  void for_each_entry(F&& f) const {
    Index r = 0;
    for (const Place& place : places_)
      for (Index i = 0; i < each_; ++i, ++r) {
        if (!all && place.gradients.col(i).isZero(0.0)) continue;
        for (Index a = 0; a < 4; ++a)
          for (Index j = 0; j < layout_.joints(); ++j)
            layout_.chain(place.first + a, j, scale * place.weight(a) * place.gradients(j, i),
                          [&](Index v, double d) { f(r, v, d); });
      }
  }
  /// Adds Jᵀ diag(weights) J; the curvature of distances is left out.
  void add_hessian(const double* weights, HessianSum& out) const;
  /// "clearance after knot 7"
  [[nodiscard]] std::string describe(Index row) const;

 private:
  static constexpr double scale = 10.0;  ///< rows per metre
  /// A configuration Σ_a weights_a P_{first+a} after the knot `first`.
  struct Place {
    Index first;
    std::array<double, 4> weights;
    MatrixXd gradients;
    [[nodiscard]] double weight(Index a) const { return weights[static_cast<std::size_t>(a)]; }
  };

  [[nodiscard]] double at_least(const VectorXd& q, double margin);

  Clearance* clearance_;
  Layout layout_;
  Index each_ = 0;  ///< rows of a place
  std::vector<Place> places_;
  VectorXd distances_, q_;
};

}  // namespace hamelin::optimal
