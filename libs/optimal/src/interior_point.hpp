#pragma once
#include "filter.hpp"
#include "hamelin/optimal/solve.hpp"
#include "transcription.hpp"

namespace hamelin::optimal {

/// A primal-dual interior-point method with slacks for all bounds, docs/theory.md (18.9)–(18.12).
class InteriorPoint {
 public:
  struct Start {
    double mu;  ///< of the barrier
    /// Least slack at the guess, as a share of a bound: how far rows near their bounds may move in
    /// the first steps.
    double slack;
  };
  InteriorPoint(Transcription& program, const SolveOptions& options, const Start& start);
  /// From x; the program is at the last iterate that was accepted afterwards.
  Solution solve(VectorXd x);
  /// The last iterate that was accepted.
  [[nodiscard]] const VectorXd& x() const noexcept { return x_; }

 private:
  /// One side of all rows: sign (c − bound) = slack ≥ 0 with a multiplier; where the bound is
  /// infinite, the multiplier is 0 and the slack 1.
  struct Side {
    double sign;
    const VectorXd& bound;
    VectorXd slack{}, multiplier{}, residual{}, slack_step{}, multiplier_step{};
    std::vector<Index> rows{};  ///< those that are bounded and do not rest
    [[nodiscard]] bool bounds(Index r) const { return std::isfinite(bound[r]); }
    [[nodiscard]] double inside(const Transcription& program, Index r) const {
      return sign * (program.values()[r] - bound[r]);
    }
  };
  /// How far an iterate is from a solution of the problem with the barrier μ.
  struct Errors {
    double stationarity, violation, complementarity;
    /// A number that is not finite is never within a bound.
    [[nodiscard]] bool within(double bound) const {
      return stationarity <= bound && violation <= bound && complementarity <= bound;
    }
  };

  [[nodiscard]] bool start(VectorXd x);
  void awaken(Index row);
  void wake();
  void rest();
  void find_residuals(Side& side) const;
  [[nodiscard]] Errors errors(double mu);
  [[nodiscard]] bool cheap_enough(const Errors& now) const;
  [[nodiscard]] bool can_lower_barrier() const noexcept { return mu_ > options_.tolerance / 10.0; }
  void lower_barrier();
  [[nodiscard]] bool find_direction();
  [[nodiscard]] bool factor();
  void find_side_steps(Side& side);
  void take_slacks(Side& side, const VectorXd& before, double step) const;
  [[nodiscard]] bool take_step();
  void restore(const VectorXd& x, const VectorXd& slack_l, const VectorXd& slack_u);
  [[nodiscard]] Filter::Point filter_point() const;
  [[nodiscard]] double barrier_slope() const;
  void count_small_decreases(const Filter::Point& before, const Filter::Point& now);
  [[nodiscard]] double largest_step(const Side& side, const VectorXd& x, const VectorXd& dx) const;
  void keep_multipliers_near(Side& side) const;
  template <class F>
  void for_each_side(F&& f) {
    f(lower_);
    f(upper_);
  }
  template <class F>
  void for_each_side(F&& f) const {
    f(lower_);
    f(upper_);
  }

  Transcription& program_;
  SolveOptions options_;
  double first_slack_;
  double mu_;  ///< of the barrier
  BandedMatrix hessian_;
  Side lower_, upper_;
  VectorXd x_, dx_, gradient_, right_, row_, weights_, row_step_;
  /// Of the rows behind the steady ones, which have lower bounds: whether they do not rest. Where
  /// nothing is near, they are constant and rest, each with its slack.
  std::vector<bool> awake_;
  double resting_log_ = 0.0;       ///< Σ log(slack) of those that rest
  double scale_ = 1.0;             ///< of the cost
  double cost_before_ = infinity;  ///< of the last step
  Filter filter_;
  double first_violation_ = 1.0;  ///< at the guess, at least 1
  double bounds_ = 0.0;           ///< number of those that do not rest at the guess
  bool near_minimum_ = false;     ///< whether the last step won little beside what μ leaves open
  int small_decreases_ = 0;       ///< of cost and violation, in a row
};

}  // namespace hamelin::optimal
