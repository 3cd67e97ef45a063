#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "container.hpp"
#include "hamelin/io/json.hpp"

namespace hamelin::report {

/// The lines that a planner has drawn during a run.
class Drawings {
 public:
  /// @param points_max the largest number of points in all drawings that are kept
  explicit Drawings(std::size_t points_max) : points_max_(points_max) {}

  /// The lines of a tick, each x, y, z of its points.
  void add(double time_s, const std::vector<std::vector<double>>& lines);
  /// {t, lines, points, position_m}: time of each drawing, and how many lines it has; how many
  /// points each line has; the points. Null if there are none.
  [[nodiscard]] Json json(Container& container) const;
  [[nodiscard]] std::size_t left_out() const noexcept { return left_out_; }

 private:
  std::size_t points_max_, left_out_ = 0;
  std::vector<double> t_, lines_, points_, position_;
};

}  // namespace hamelin::report
