#pragma once
#include <string>
#include <vector>

#include "discrete_lagrangian.hpp"
#include "hessian_sum.hpp"
#include "layout.hpp"

namespace hamelin::optimal {

/// The torques at the knots by the discrete equations of motion, docs/theory.md (18.4), their
/// bounds, and the effort Σ_k τ_kᵀRτ_k, in which the ends count half.
class Torques {
 public:
  /// Appends its rows to the bounds.
  Torques(const Problem& problem, const Layout& layout, Bounds& bounds);

  [[nodiscard]] Index rows() const noexcept { return static_cast<Index>(rows_.size()); }
  /// Torques, their derivatives and the effort; writes rows() numbers.
  void evaluate(const Points& points, double* values);
  [[nodiscard]] double effort() const noexcept { return effort_; }
  /// dof × (N + 1)
  [[nodiscard]] const MatrixXd& torques() const noexcept { return torques_; }
  /// Adds factor · ∂(effort).
  void add_gradient(double factor, VectorXd& out) const;
  template <class F>
  void for_each_entry(F&& f) const {
    for (Index r = 0; r < rows(); ++r) {
      const Row& row = rows_[static_cast<std::size_t>(r)];
      const Knot& knot = knots_[static_cast<std::size_t>(row.knot)];
      for (Index a = 0; a < 3; ++a)
        for (Index j = 0; j < layout_.joints(); ++j)
          layout_.chain(row.knot + a, j, row.scale * knot.by_q(row.joint, a * layout_.joints() + j),
                        [&](Index v, double d) { f(r, v, d); });
      if (layout_.free_time())
        f(r, layout_.step_variable(), row.scale * layout_.h_ref() * knot.by_h[row.joint]);
    }
  }
  /// Adds factor · ∇²(effort) + Σ y_i ∇²c_i + Jᵀ diag(weights) J, or without `curved` only the part
  /// of it that is never negative: that of the squares of first derivatives.
  void add_hessian(double factor, const double* y, const double* weights, bool curved,
                   HessianSum& out);
  [[nodiscard]] std::string describe(Index row) const;

 private:
  struct Row {
    Index knot, joint;
    double scale;
  };
  /// Derivatives of the torques at a knot by the control points before, at and after it, and by h.
  struct Knot {
    MatrixXd by_q;
    VectorXd by_h;
  };
  void add_products(const MatrixXd& weights, HessianSum& out);
  void add_curvature(const MatrixXd& y, HessianSum& out);
  /// The weight of a knot's effort.
  [[nodiscard]] double share(Index knot) const noexcept {
    return knot == 0 || knot == layout_.intervals() ? 0.5 : 1.0;
  }

  Layout layout_;
  DiscreteLagrangian lagrangian_;
  VectorXd effort_weights_;
  std::vector<Row> rows_;

  Points points_;
  double effort_ = 0.0;
  MatrixXd torques_;
  std::vector<DiscreteLagrangian::Derivatives> intervals_;
  std::vector<Knot> knots_;
  DiscreteLagrangian::Derivatives direction_;
};

}  // namespace hamelin::optimal
