#pragma once
#include <string>

#include "hamelin/core/numbers.hpp"
#include "hessian_sum.hpp"
#include "layout.hpp"

namespace hamelin::optimal {

/// The bound of the duration from below where the time is free, docs/theory.md (18.8): one row, the
/// step as a share of the guess's.
class StepRow {
 public:
  /// Appends its row to the bounds.
  StepRow(const Layout& layout, Bounds& bounds) : layout_(layout) {
    if (!layout.free_time()) return;
    bounds.lower.push_back(least_duration_s /
                           (layout.h_ref() * static_cast<double>(layout.intervals())));
    bounds.upper.push_back(infinity);
  }

  [[nodiscard]] Index rows() const noexcept { return layout_.free_time() ? 1 : 0; }
  /// Writes rows() numbers.
  void evaluate(const Points& points, double* values) const {
    if (layout_.free_time()) *values = points.h / layout_.h_ref();
  }
  template <class F>
  void for_each_entry(F&& f) const {
    if (layout_.free_time()) f(Index{0}, layout_.step_variable(), 1.0);
  }
  /// Adds Jᵀ diag(weights) J.
  void add_hessian(const double* weights, HessianSum& out) const {
    if (layout_.free_time()) out.add_step(*weights);
  }
  [[nodiscard]] static std::string describe() { return "least duration"; }

 private:
  Layout layout_;
};

}  // namespace hamelin::optimal
