#pragma once
#include <Eigen/Core>
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
};

/// The fastest motion along a curve within the limits, from a speed to rest: docs/theory.md
/// (19.5)–(19.9), by two passes over the squared speed as in H. Pham, Q.-C. Pham, A New Approach
/// to Time-Optimal Path Parameterization Based on Reachability Analysis, IEEE Transactions on
/// Robotics 34(3), 2018, with the limits kept at both ends of each interval and examined between
/// them. One thread.
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

  /// What a motion along a curve begins with.
  struct Start {
    double speed = 0.0;      ///< dσ/dt
    double speed_max = 0.0;  ///< of the whole motion; zero: no bound
  };
  /// @param out its curve is given, the rest is set
  /// @return whether there is a motion; else see cause()
  [[nodiscard]] bool solve(TimedPath& out, const Start& start);
  [[nodiscard]] bool solve(TimedPath& out) { return solve(out, {}); }
  /// The duration of that motion, from rest and without an examination between the nodes; infinite
  /// if there is none.
  [[nodiscard]] double duration_s(const Curve& curve);
  /// One line: why the last call found no motion.
  [[nodiscard]] std::string_view cause() const noexcept { return cause_; }
  [[nodiscard]] const Limits& limits() const noexcept { return limits_; }

 private:
  /// u between two bounds for each x: what a row of limits allows on an interval.
  struct Line {
    double low, high, slope;  ///< low − slope x ≤ u ≤ high − slope x
  };
  struct Range {
    double low, high;
  };
  void set_nodes(const Curve& curve);
  void add_nodes(double from, double to, Eigen::Index count);
  /// Inertia, bias and gravity at places of the curve.
  void evaluate(const Curve& curve, const Eigen::VectorXd& places);
  /// The rows of one interval; tightens the bound of x.
  void set_lines(Eigen::Index interval, double share, double& x_max);
  void add_lines(Eigen::Index node, double lead, double share, double& x_max);
  [[nodiscard]] Range range(double x) const;
  [[nodiscard]] double largest(double x_max) const;
  [[nodiscard]] bool pass(TimedPath& out, const Start& start, double share);
  [[nodiscard]] bool backward(const Start& start, double share);
  [[nodiscard]] bool forward(TimedPath& out, const Start& start, double share);
  /// By how much limits are exceeded between the nodes, as a factor.
  [[nodiscard]] double excess(const TimedPath& motion);

  const model::Model& model_;
  Limits limits_;
  Grid grid_;
  dynamics::BatchWorkspace ws_;
  std::string_view cause_;
  std::vector<double> nodes_;
  Eigen::VectorXd places_, between_, squared_max_, controllable_;
  dynamics::StatesXd q_, dq_, ddq_, inertia_, bias_, gravity_, zero_;
  dynamics::StatesXd mid_dq_, mid_ddq_, mid_inertia_, mid_bias_, mid_gravity_;
  std::vector<Line> lines_;
  bool keeps_dynamics_ = true;  ///< although torques are not limited
  TimedPath trial_;             ///< of duration_s(), without a curve
};

}  // namespace hamelin::timing
