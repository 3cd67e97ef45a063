#pragma once
#include <string>
#include <vector>

#include "banded.hpp"
#include "layout.hpp"

namespace hamelin::optimal {

/// Bounds of the clearance at knots and between them, docs/theory.md (17.7).
class ClearanceRows {
 public:
  ClearanceRows(const Problem& problem, const Layout& layout, Bounds& bounds);

  [[nodiscard]] Index rows() const noexcept { return static_cast<Index>(places_.size()) * each_; }
  void evaluate(const Knots& knots, double* values);
  template <class F>
  void for_each_entry(F&& f) const {
    Index r = 0;
    for (const Place& place : places_)
      for (Index i = 0; i < each_; ++i, ++r)
        for (Index a = 0; a < 2; ++a)
          if (place.share(a) > 0.0 && layout_.varies(place.first + a))
            for (Index j = 0; j < layout_.n; ++j)
              f(r, layout_.variable(place.first + a, j),
                scale * place.share(a) * place.gradients(j, i));
  }
  /// Adds Jᵀ diag(weights) J; the curvature of distances is left out.
  void add_hessian(const double* weights, BandedMatrix& out) const;
  [[nodiscard]] std::string describe(Index row) const;

 private:
  static constexpr double scale = 10.0;  ///< rows per metre
  /// The configuration `s` of the way from knot `first` to the next.
  struct Place {
    Index first;
    double s;
    MatrixXd gradients;
    [[nodiscard]] double share(Index a) const noexcept { return a == 0 ? 1.0 - s : s; }
  };

  Clearance* clearance_;
  Layout layout_;
  Index each_ = 0;  ///< rows of a place
  std::vector<Place> places_;
  VectorXd distances_, q_;
};

}  // namespace hamelin::optimal
