#pragma once
#include "banded.hpp"
#include "layout.hpp"

namespace hamelin::optimal {

/// Adds second derivatives by knots and step to a matrix over the variables.
class HessianSum {
 public:
  HessianSum(const Layout& layout, BandedMatrix& out) : layout_(layout), out_(out) {}

  /// ∂²/∂q_row∂q_column, once for each pair of knots row ≥ column.
  template <class Block>
  void add(Index row, Index column, const Block& block) {
    if (layout_.varies(row) && layout_.varies(column)) {
      out_.block(Layout::block(row), Layout::block(column)) += block;
      return;
    }
    if (!layout_.free_time) return;
    if (layout_.varies(row) && layout_.moves_with_step(column))
      border(row) += block * rate(column);
    else if (layout_.moves_with_step(row) && layout_.varies(column))
      border(column) += block.transpose() * rate(row);
    else if (layout_.moves_with_step(row) && layout_.moves_with_step(column))
      out_.corner() += (row == column ? 1.0 : 2.0) * rate(row).dot(block * rate(column));
  }
  /// ∂²/∂q_knot∂(h/h_ref)
  template <class Vector>
  void add_mixed(Index knot, const Vector& vector) {
    if (!layout_.free_time) return;
    if (layout_.varies(knot))
      border(knot) += vector;
    else if (layout_.moves_with_step(knot))
      out_.corner() += 2.0 * rate(knot).dot(vector);
  }
  /// ∂²/∂(h/h_ref)²
  void add_step(double value) {
    if (layout_.free_time) out_.corner() += value;
  }

 private:
  [[nodiscard]] VectorXd rate(Index knot) const {
    return knot == 1 ? VectorXd(layout_.h_ref * layout_.v_start)
                     : VectorXd(-layout_.h_ref * layout_.v_goal);
  }
  auto border(Index knot) {
    return out_.border().segment(Layout::block(knot) * layout_.n, layout_.n);
  }

  const Layout& layout_;
  BandedMatrix& out_;
};

}  // namespace hamelin::optimal
