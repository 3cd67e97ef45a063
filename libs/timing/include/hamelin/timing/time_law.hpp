#pragma once
#include <Eigen/Core>
#include <limits>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/timing/timed_path.hpp"

namespace hamelin::timing {

/// What a motion must keep, of absolute values, per joint; of size zero: no bound.
struct Limits {
  Eigen::VectorXd velocity;      ///< [rad/s or m/s]
  Eigen::VectorXd acceleration;  ///< [rad/s² or m/s²]; always given
  Eigen::VectorXd torque;        ///< [Nm or N]
  /// Rates of change; where neither is bounded, accelerations jump.
  Eigen::VectorXd jerk;                                        ///< [rad/s³ or m/s³]
  Eigen::VectorXd torque_rate;                                 ///< [Nm/s or N/s]
  double tip_speed = std::numeric_limits<double>::infinity();  ///< of the tip's point [m/s]
  [[nodiscard]] bool have_rates() const noexcept {
    return jerk.size() > 0 || torque_rate.size() > 0;
  }
};

/// The fastest motion along a curve within the limits, from a speed to rest: docs/theory.md
/// (19.5)–(19.9), (19.12), by two passes over the squared speed as in H. Pham, Q.-C. Pham, A New
/// Approach to Time-Optimal Path Parameterization Based on Reachability Analysis, IEEE Transactions
/// on Robotics 34(3), 2018, with the limits kept at both ends of each interval and examined between
/// them. Where rates are bounded, that motion is averaged over a window of time. One thread.
class TimeLaw {
 public:
  /// How densely a curve is examined.
  struct Grid {
    Eigen::Index nodes_per_bend = 8;  ///< intervals of a piece that bends, at least
    double spacing = 0.08;            ///< of nodes, at most, in units of the curve's parameter
  };
  /// @param model kept by reference
  /// @throws Error invalid for limits that do not fit the model or are not positive
  TimeLaw(const model::Model& model, Limits limits, Grid grid);
  TimeLaw(const model::Model& model, Limits limits) : TimeLaw(model, std::move(limits), Grid()) {}
  /// Deleted: a temporary model is gone before any call could use it.
  TimeLaw(const model::Model&& model, Limits limits) = delete;

  /// @param out its curve is given, the rest is set
  /// @param speed dσ/dt at the beginning; zero where rates are bounded
  /// @return whether there is a motion; else see cause()
  [[nodiscard]] bool solve(TimedPath& out, double speed = 0.0);
  /// The motion of a curve whose parameter is the time, from rest to rest, slower than it was meant
  /// where the limits ask for that: docs/theory.md (19.15). Rates must not be bounded.
  /// @param out its curve is given, the rest is set
  /// @return whether there is a motion; else see cause()
  [[nodiscard]] bool slow_down(TimedPath& out);
  /// The duration of the motion from rest if rates are not bounded, and without an examination
  /// between the nodes; infinite if there is none.
  [[nodiscard]] double duration_s(const Curve& curve);
  /// One line: why the last call found no motion.
  [[nodiscard]] std::string_view cause() const noexcept { return cause_; }
  /// At how many places of the curve the last call has evaluated torques.
  [[nodiscard]] long evaluated() const noexcept { return evaluated_; }
  [[nodiscard]] const Limits& limits() const noexcept { return limits_; }
  /// Of the following motions. @param m_s above 0; infinite: none
  void set_tip_speed(double m_s) noexcept { limits_.tip_speed = m_s; }

 private:
  /// u between two bounds for each x: what a row of limits allows on an interval.
  struct Line {
    double low, high, slope;  ///< low − slope x ≤ u ≤ high − slope x
  };
  struct Range {
    double low, high;
  };
  /// q′, q″ and, of (19.4), A, B and g at places of a curve.
  struct Rows {
    dynamics::StatesXd tangent, curvature, inertia, bias, gravity;
    Eigen::VectorXd tip;  ///< |J q′| of the tip's point, if its speed is bounded
  };
  void set_nodes(const Curve& curve);
  /// The same for one whose q″ may jump.
  void set_nodes_beside_jumps(const Curve& curve);
  /// Sets what moves the tip's point at the places of the rows.
  void evaluate_tip(Rows& out);
  void add_nodes(double from, double to, Eigen::Index count);
  /// @param torques whether A, B and g are needed
  void evaluate(const Curve& curve, const Eigen::VectorXd& places, bool torques, Rows& out);
  /// Appends the rows of an interval; tightens the bound of x.
  void add_lines(Eigen::Index interval, double& x_max);
  void add_lines(Eigen::Index node, double lead, double share, Line& level, double& x_max);
  [[nodiscard]] std::span<const Line> lines_of(Eigen::Index interval) const;
  [[nodiscard]] static Range range(std::span<const Line> lines, double x);
  /// The largest x at which there is a u.
  [[nodiscard]] static double largest(std::span<const Line> lines, double x_max);
  /// The two passes, with shares_ of the limits.
  [[nodiscard]] bool pass(TimedPath& out, double speed);
  [[nodiscard]] bool backward();
  [[nodiscard]] bool forward(TimedPath& out, double speed);
  [[nodiscard]] bool solve_with_jumps(TimedPath& out, double speed);
  [[nodiscard]] bool solve_with_ramps(TimedPath& out);
  /// The averaged motion, with acceleration_share_ of the accelerations at first.
  [[nodiscard]] bool average_until_within(TimedPath& out);
  /// What the motion uses of its limits on an interval, as factors; ramp: by d³σ/dt³ alone.
  struct Used {
    double values = 0.0, rates = 0.0, ramp = 0.0;
  };
  [[nodiscard]] Used used(const TimedPath& motion, Eigen::Index interval, const Rows& nodes) const;
  /// Sets between_ to what holds in the middle of the intervals.
  void evaluate_between(const TimedPath& motion);
  /// Lowers the shares for what contributes to an interval of the averaged motion.
  void lower_shares(const TimedPath& averaged, Eigen::Index interval, double window_s,
                    double factor);
  static void store(const Rows& nodes, TimedPath& out);

  const model::Model& model_;
  Limits limits_;
  Grid grid_;
  dynamics::BatchWorkspace ws_;
  dynamics::Workspace one_;
  std::string_view cause_;
  long evaluated_ = 0;
  std::vector<double> nodes_;
  Eigen::VectorXd places_, squared_max_, controllable_;
  Eigen::VectorXd shares_;  ///< of the limits, that the passes use on each interval
  Eigen::VectorXd lowered_;
  Rows rows_, between_, averaged_;
  dynamics::StatesXd q_, zero_;
  std::vector<Line> lines_;
  std::vector<std::size_t> first_line_;  ///< of each interval, from the last to the first
  TimedPath trial_;                      ///< without a curve
  TimedPath other_;                      ///< an averaged motion beside the best
  double acceleration_share_ = 1.0;
  /// (dσ/dt)² at most, and at the end.
  double squared_most_, squared_at_end_ = 0.0;
};

}  // namespace hamelin::timing
