#pragma once
#include <vector>

#include "hamelin/optimal/problem.hpp"

namespace hamelin::optimal {

using Eigen::Index;

/// How the control points P_0 … P_{N+2} follow from the variables x = (inner points, h/h_ref), the
/// last only if the time is free: P_i = share · (a variable point) + constant + steps · h · v, with
/// the velocity v of an end, docs/theory.md (18.2), (18.3).
class Layout {
 public:
  explicit Layout(const Problem& problem);

  struct Source {
    Index block = -1;  ///< of the variable point; −1: none
    double share = 0.0;
    int end = 0;  ///< whose position and velocity follow: 0 the start, 1 the goal
    double position_share = 0.0;
    double steps = 0.0;  ///< 0 also if the velocity there is zero
  };

  [[nodiscard]] Index joints() const noexcept { return n_; }
  [[nodiscard]] Index intervals() const noexcept { return intervals_; }
  [[nodiscard]] Index points() const noexcept { return intervals_ + 3; }
  [[nodiscard]] Index blocks() const noexcept { return intervals_ - 1 - 2 * fixed_; }
  [[nodiscard]] bool free_time() const noexcept { return free_time_; }
  [[nodiscard]] double h_ref() const noexcept { return h_ref_; }
  [[nodiscard]] Index variables() const noexcept { return blocks() * n_ + (free_time_ ? 1 : 0); }
  [[nodiscard]] Index step_variable() const noexcept { return blocks() * n_; }
  /// The first variable point.
  [[nodiscard]] Index first_point() const noexcept { return 2 + fixed_; }
  [[nodiscard]] const Source& source(Index point) const {
    return sources_[static_cast<std::size_t>(point)];
  }
  [[nodiscard]] const VectorXd& position(const Source& s) const {
    return s.end == 0 ? q_start_ : q_goal_;
  }
  [[nodiscard]] const VectorXd& velocity(const Source& s) const {
    return s.end == 0 ? v_start_ : v_goal_;
  }
  /// Calls f(variable, derivative) for a derivative by a joint of a control point.
  template <class F>
  void chain(Index point, Index joint, double derivative, F&& f) const {
    const Source& s = source(point);
    if (s.block >= 0) f(s.block * n_ + joint, derivative * s.share);
    if (free_time_ && s.steps != 0.0)
      f(step_variable(), derivative * s.steps * h_ref_ * velocity(s)[joint]);
  }

 private:
  void set_end(int end, Index outermost, Index step);

  Index n_, intervals_;
  bool free_time_;
  double h_ref_;  ///< [s]
  /// Points at each end, besides the two outermost, that do not vary: 1 if the acceleration is zero
  /// at the ends, since jerks are bounded.
  Index fixed_;
  VectorXd q_start_, v_start_, q_goal_, v_goal_;
  std::vector<Source> sources_;
};

/// All control points, dof × (N + 3), and the step between them.
struct Points {
  MatrixXd q;
  double h = 0.0;
};

/// Bounds of rows, appended one by one.
struct Bounds {
  std::vector<double> lower, upper;
  [[nodiscard]] Index size() const noexcept { return static_cast<Index>(lower.size()); }
};

}  // namespace hamelin::optimal
