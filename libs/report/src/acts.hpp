#pragma once
#include <cstddef>

#include "hamelin/io/json.hpp"

namespace hamelin::report {

/// When and how the arm of a run evaded moving obstacles, from the planner's series `evasion`.
class Acts {
 public:
  explicit Acts(std::size_t acts_max) : acts_max_(acts_max) {}

  /// One tick, in the order of their times.
  /// @param number 1: stops, 2: goes back, 3: goes aside; others, NaN among them: its own way
  void add(double time_s, double number);

  /// [{t, until, act}]; `until` is the first tick without that act, or the last tick.
  [[nodiscard]] const Json& json() const noexcept { return acts_; }
  [[nodiscard]] std::size_t left_out() const noexcept { return left_out_; }

 private:
  std::size_t acts_max_, left_out_ = 0;
  Json acts_ = Json::array();
  const char* last_ = nullptr;  ///< of the previous tick; null: its own way
  bool open_ = false;           ///< whether the last act goes on
};

}  // namespace hamelin::report
