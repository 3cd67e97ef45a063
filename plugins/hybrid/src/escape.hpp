#pragma once
#include <Eigen/Core>
#include <limits>

#include "hamelin/core/rng.hpp"
#include "hamelin/planning/plugin.hpp"

namespace hamelin::hybrid {

/// Watches progress: a stall is no new best of the distance (by `step`) for a while at low speed, or for long at any.
class StallWatch {
 public:
  StallWatch(double quiet_s, double long_s) : quiet_s_(quiet_s), long_s_(long_s) {}
  void restart(double time_s) {
    best_ = 1e300;
    since_s_ = time_s;
  }
  /// @param speed |v| of the joints
  [[nodiscard]] bool stalled(double time_s, double distance, double speed) {
    if (distance < best_ - progress_step) {
      best_ = distance;
      since_s_ = time_s;
    }
    const double idle = time_s - since_s_;
    return (idle > quiet_s_ && speed < slow_speed) || idle > long_s_;
  }

 private:
  static constexpr double progress_step = 0.01, slow_speed = 0.25;
  double quiet_s_, long_s_;
  double best_ = 1e300, since_s_ = 0.0;
};

/// Escape by memory: way-points drawn around the arm, far from where it stalled before and not far from the goal.
class Escape {
 public:
  Escape(const planning::Setup& setup, const Eigen::VectorXd& weights, int max_escapes);

  [[nodiscard]] int count() const noexcept { return count_; }
  [[nodiscard]] const Eigen::VectorXd& via() const noexcept { return via_; }
  /// Forgets all stalls, e.g. at a new goal.
  void restart() { crumbs_ = 0, count_ = 0; }
  /// Draws the next way-point after a stall at q. @param goal null unless it is a joint vector
  /// @param clear whether the arm may stand at a way-point; asked for the best few only
  template <class Clear>
  void next(const Eigen::VectorXd& q, const double* goal, Clear&& clear) {
    draw_all(q, goal);
    Eigen::Index best = 0;
    scores_.maxCoeff(&best);
    const Eigen::Index first = best;
    bool found = false;
    for (int tried = 0; tried < asked && !found; ++tried) {
      scores_.maxCoeff(&best);
      via_ = drawn_.col(best);
      found = clear(via_);
      scores_[best] = -std::numeric_limits<double>::infinity();
    }
    if (!found) via_ = drawn_.col(first);
    remember(via_);
  }

 private:
  static constexpr int candidates = 64, asked = 8;
  void remember(const Eigen::VectorXd& q);
  /// Counts the stall at q, draws the candidates and scores them.
  void draw_all(const Eigen::VectorXd& q, const double* goal);
  void draw(const Eigen::VectorXd& q, double radius, Eigen::Ref<Eigen::VectorXd> out);

  Rng rng_;
  Eigen::VectorXd lower_, upper_, weights_, via_;
  Eigen::MatrixXd drawn_;  ///< one column a candidate
  Eigen::VectorXd scores_;
  Eigen::MatrixXd crumb_;  ///< where it stalled, and where it went from there
  int crumbs_ = 0, count_ = 0;
};

}  // namespace hamelin::hybrid
