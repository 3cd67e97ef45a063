#pragma once
#include <algorithm>
#include <cmath>
#include <optional>

#include "hamelin/control/live_reference.hpp"
#include "hamelin/log/result.hpp"

namespace hamelin::simulation {

/// How well the arm follows the trajectories of goals, judged by where it really is.
class TrajectoryAudit {
 public:
  /// Notes a tick. @param period_s since the last one @param q of the arm
  void observe(const scene::Goal& goal, const control::ReferenceState& reference,
               const Eigen::VectorXd& q, double period_s) {
    const bool begins = &goal != goal_;
    if (begins) out_.duration_s += goal.trajectory->duration_s();
    if (!begins && !ended_) out_.time_s += period_s;
    goal_ = &goal;
    ended_ = reference.ended;
    const double error = (q - reference.q).lpNorm<Eigen::Infinity>();
    square_sum_ += error * error;
    ++ticks_;
    out_.error_max = std::max(out_.error_max, error);
  }

  /// The figures so far; none if no trajectory was followed.
  [[nodiscard]] std::optional<log::Result::Trajectory> figures() const {
    if (ticks_ == 0) return std::nullopt;
    log::Result::Trajectory out = out_;
    out.error_rms = std::sqrt(square_sum_ / static_cast<double>(ticks_));
    return out;
  }

 private:
  const scene::Goal* goal_ = nullptr;
  bool ended_ = false;
  double square_sum_ = 0.0;
  long ticks_ = 0;
  log::Result::Trajectory out_;
};

}  // namespace hamelin::simulation
