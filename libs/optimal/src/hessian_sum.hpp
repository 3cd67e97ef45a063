#pragma once
#include <algorithm>

#include "banded.hpp"
#include "layout.hpp"

namespace hamelin::optimal {

/// Adds second derivatives by control points and step to a matrix over the variables.
class HessianSum {
  // Clang needs its type before it is used.
  auto border(const Layout::Source& s) {
    return out_.border().segment(s.block * layout_.joints(), layout_.joints());
  }

 public:
  HessianSum(const Layout& layout, BandedMatrix& out) : layout_(layout), out_(out) {}

  /// ∂²/∂P_row∂P_column, once for each pair of points row ≥ column.
  template <class Block>
  void add(Index row, Index column, const Block& block) {
    const auto &r = layout_.source(row), &c = layout_.source(column);
    if (r.block >= 0 && c.block >= 0) add_block(row, column, r, c, block);
    if (!layout_.free_time()) return;
    if (r.block >= 0 && c.steps != 0.0) border(r) += r.share * (block * rate(c));
    if (row == column) {
      if (r.steps != 0.0) out_.corner() += rate(r).dot(block * rate(r));
      return;
    }
    if (c.block >= 0 && r.steps != 0.0) border(c) += c.share * (block.transpose() * rate(r));
    if (r.steps != 0.0 && c.steps != 0.0) out_.corner() += 2.0 * rate(r).dot(block * rate(c));
  }
  /// ∂²/∂P_point∂(h/h_ref)
  template <class Vector>
  void add_mixed(Index point, const Vector& vector) {
    if (!layout_.free_time()) return;
    const auto& s = layout_.source(point);
    if (s.block >= 0) border(s) += s.share * vector;
    if (s.steps != 0.0) out_.corner() += 2.0 * rate(s).dot(vector);
  }
  /// ∂²/∂(h/h_ref)²
  void add_step(double value) {
    if (layout_.free_time()) out_.corner() += value;
  }

 private:
  /// Two points may follow from one variable point, and a pair of points stands for both orders.
  template <class Block>
  void add_block(Index row, Index column, const Layout::Source& r, const Layout::Source& c,
                 const Block& block) {
    const double share = r.share * c.share;
    if (r.block == c.block) {
      out_.block(r.block, r.block) += share * block;
      if (row != column) out_.block(r.block, r.block) += share * block.transpose();
    } else if (r.block > c.block) {
      out_.block(r.block, c.block) += share * block;
    } else {
      out_.block(c.block, r.block) += share * block.transpose();
    }
  }
  [[nodiscard]] VectorXd rate(const Layout::Source& s) const {
    return s.steps * layout_.h_ref() * layout_.velocity(s);
  }

  const Layout& layout_;
  BandedMatrix& out_;
};

}  // namespace hamelin::optimal
