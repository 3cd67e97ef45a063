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
  /// Writes rows() numbers: those of distances that are at their bounds.
  void fill_far(double* values) const;
  /// Of rows() numbers, writes those that are below the bounds of their distances, or were so
  /// before.
  void evaluate(const Points& points, double* values);
  /// Calls f(row) for the rows whose distances are below their bounds.
  template <class F>
  void for_each_near(F&& f) const {
    for (const Place& place : places_)
      for (Index i = 0; i < place.near.size(); ++i) f(place.first_row + place.near.row(i));
  }
  /// Calls f(row, variable, derivative) at the points of the last evaluate(); with `all` also for
  /// rows at their bound, whose derivatives are zero.
  template <bool all, class F>
  void for_each_entry(F&& f) const {
    for (const Place& place : places_) {
      if constexpr (all) {
        MatrixXd gradients = MatrixXd::Zero(layout_.joints(), each_);
        for (Index i = 0; i < place.near.size(); ++i)
          gradients.col(place.near.row(i)) = place.near.gradient(i);
        for (Index r = 0; r < each_; ++r) add_entries(place, r, gradients.col(r), f);
      } else {
        for (Index i = 0; i < place.near.size(); ++i)
          add_entries(place, place.near.row(i), place.near.gradient(i), f);
      }
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
    Index first_row;
    NearDistances near;
    [[nodiscard]] double weight(Index a) const { return weights[static_cast<std::size_t>(a)]; }
  };

  template <class Gradient, class F>
  void add_entries(const Place& place, Index row, const Gradient& gradient, F&& f) const {
    for (Index a = 0; a < 4; ++a)
      for (Index j = 0; j < layout_.joints(); ++j)
        layout_.chain(place.first + a, j, scale * place.weight(a) * gradient[j],
                      [&](Index v, double d) { f(place.first_row + row, v, d); });
  }
  [[nodiscard]] double at_least(const VectorXd& q, double margin);

  Clearance* clearance_;
  Layout layout_;
  Index each_ = 0;  ///< rows of a place
  std::vector<Place> places_;
  VectorXd far_, q_;
};

}  // namespace hamelin::optimal
