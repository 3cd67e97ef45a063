#pragma once
#include <array>
#include <string>
#include <vector>

#include "hessian_sum.hpp"
#include "layout.hpp"

namespace hamelin::optimal {

/// Bounds of positions, velocities, accelerations and jerks: of difference quotients of one joint,
/// docs/theory.md (18.8).
class QuotientRows {
 public:
  /// Appends its rows to the bounds.
  QuotientRows(const Problem& problem, const Layout& layout, Bounds& bounds);

  /// Knots that the longest quotient reaches over beyond its first.
  [[nodiscard]] Index reach() const noexcept { return reach_; }
  [[nodiscard]] Index rows() const noexcept { return static_cast<Index>(rows_.size()); }
  /// Writes rows() numbers.
  void evaluate(const Points& points, double* values);
  /// Calls f(row, variable, derivative) at the knots of the last evaluate().
  template <class F>
  void for_each_entry(F&& f) const {
    for (Index r = 0; r < rows(); ++r) {
      const Row& row = rows_[static_cast<std::size_t>(r)];
      for (Index a = 0; a < row.count; ++a)
        layout_.chain(row.first + a, row.joint, by_knot(row, a),
                      [&](Index v, double d) { f(r, v, d); });
      if (layout_.free_time() && row.power > 0) f(r, layout_.step_variable(), by_step(r));
    }
  }
  /// Adds Jᵀ diag(weights) J, and with `curved` Σ y_i ∇²c_i.
  void add_hessian(const double* y, const double* weights, bool curved, HessianSum& out) const;
  /// "velocity of joint 3 after knot 7"
  [[nodiscard]] std::string describe(Index row) const;

 private:
  /// scale Σ_a coefficient_a q_{first+a} / h^power
  struct Row {
    const char* of;
    Index first, count, joint;
    std::array<double, 4> coefficient;
    int power;
    double scale;
  };
  void add(const VectorXd& bound, Row row, Bounds& bounds);
  void add_positions(const Limits& limits, Bounds& bounds);
  void add_velocities(const Limits& limits, Bounds& bounds);
  void add_accelerations(const Limits& limits, Bounds& bounds);
  void add_jerks(const Limits& limits, Bounds& bounds);
  [[nodiscard]] double by_knot(const Row& row, Index a) const {
    return row.scale * row.coefficient[static_cast<std::size_t>(a)] *
           inverse_[static_cast<std::size_t>(row.power)];
  }
  /// By h/h_ref.
  [[nodiscard]] double by_step(Index r) const;

  Layout layout_;
  Index reach_ = 0;
  std::vector<Row> rows_;
  std::vector<double> sums_;         ///< Σ_a coefficient_a q of each row
  std::array<double, 6> inverse_{};  ///< h^−k
};

}  // namespace hamelin::optimal
