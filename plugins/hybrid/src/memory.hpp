#pragma once
#include <Eigen/Core>
#include <limits>

#include "hamelin/core/rng.hpp"
#include "hamelin/planning/plugin.hpp"
#include "roots.hpp"

namespace hamelin::hybrid {

/// Escape by memory: way-points drawn around the arm, far from where it stalled before and not far from the goal.
class Memory {
 public:
  Memory(const planning::Setup& setup, const JointBox& box, int max_escapes);

  [[nodiscard]] int count() const noexcept { return count_; }
  [[nodiscard]] const Eigen::VectorXd& via() const noexcept { return via_; }
  /// Forgets all stalls, e.g. at a new goal.
  void restart() { crumbs_ = 0, count_ = 0; }
  /// Draws the next way-point after a stall at q.
  /// @param distance how far a way-point is from what is aimed at
  /// @param clear whether the arm may stand at a way-point; asked for the best few only
  template <class Distance, class Clear>
  void next(const Eigen::VectorXd& q, Distance&& distance, Clear&& clear) {
    draw_all(q);
    for (Eigen::Index c = 0; c < candidates; ++c) {
      via_ = drawn_.col(c);
      scores_[c] -= 0.5 * distance(via_);
    }
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
  /// Counts the stall at q, draws the candidates and scores them by how far they are from all that is remembered.
  void draw_all(const Eigen::VectorXd& q);

  const JointBox& box_;
  Rng rng_;
  Eigen::VectorXd via_, draw_;
  Eigen::MatrixXd drawn_;  ///< one column a candidate
  Eigen::VectorXd scores_;
  Eigen::MatrixXd crumb_;  ///< where it stalled, and where it went from there
  int crumbs_ = 0, count_ = 0;
};

}  // namespace hamelin::hybrid
