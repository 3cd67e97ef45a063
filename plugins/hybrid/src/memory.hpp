#pragma once
#include <Eigen/Core>
#include <limits>

#include "hamelin/core/rng.hpp"
#include "hamelin/planning/plugin.hpp"
#include "roots.hpp"

namespace hamelin::hybrid {

/// Escape by memory: random way-points around the arm that are far from its earlier stalls and not
/// far from the goal.
class EscapeMemory {
 public:
  EscapeMemory(const planning::Setup& setup, const JointBox& box, int max_escapes);

  [[nodiscard]] int count() const noexcept { return count_; }
  [[nodiscard]] const Eigen::VectorXd& via() const noexcept { return via_; }
  /// Forgets all stalls, for instance at a new goal.
  void restart() { visited_count_ = 0, count_ = 0; }
  /// Also repeats the random numbers from the first one on.
  void reset() {
    restart();
    rng_ = Rng(seed_);
  }
  /// Chooses the next way-point after a stall at q, by the score of docs/theory.md (10.28).
  /// @param distance function: distance of a way-point from the target
  /// @param clear function: whether a way-point is clear of obstacles; called for the best few only
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
    for (int checked = 0; checked < max_checked && !found; ++checked) {
      scores_.maxCoeff(&best);
      via_ = drawn_.col(best);
      found = clear(via_);
      scores_[best] = -std::numeric_limits<double>::infinity();
    }
    if (!found) via_ = drawn_.col(first);
    remember(via_);
  }

 private:
  static constexpr int candidates = 64, max_checked = 8;
  void remember(const Eigen::VectorXd& q);
  /// Counts the stall at q, draws the candidates and scores them by their distance from all visited
  /// configurations.
  void draw_all(const Eigen::VectorXd& q);

  const JointBox& box_;
  std::uint64_t seed_;
  Rng rng_;
  Eigen::VectorXd via_, draw_;
  Eigen::MatrixXd drawn_;  ///< one column per candidate
  Eigen::VectorXd scores_;
  Eigen::MatrixXd visited_;  ///< configurations of stalls, and the way-points chosen there
  int visited_count_ = 0, count_ = 0;
};

}  // namespace hamelin::hybrid
