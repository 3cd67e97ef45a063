#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <string>

#include "hamelin/io/json.hpp"

namespace hamelin::report {

/// The stops of a run: what a shield let the arm do instead of the planner's answers, from the
/// ticks of a log.
class Stops {
 public:
  explicit Stops(std::size_t stops_max) : stops_max_(stops_max) {}

  /// One tick, in the order of their times.
  /// @param cause of the stop that the arm follows, null without one
  /// @param q joint positions @param q_end where the stop ends; not used without a cause
  void add(double time_s, const std::string* cause, const Eigen::VectorXd& q,
           const Eigen::VectorXd& q_end);

  /// [{t, until, cause, q, q_end}]; `until` is the first tick without that stop, or the last tick.
  [[nodiscard]] const Json& json() const noexcept { return stops_; }
  [[nodiscard]] std::size_t left_out() const noexcept { return left_out_; }

 private:
  std::size_t stops_max_, left_out_ = 0;
  Json stops_ = Json::array();
  bool open_ = false;     ///< the last stop goes on
  bool dropped_ = false;  ///< a stop that is left out goes on
  Eigen::VectorXd q_end_;
};

}  // namespace hamelin::report
