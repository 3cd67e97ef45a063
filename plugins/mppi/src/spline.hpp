#pragma once
#include <Eigen/Core>

namespace hamelin::mppi {

/// Position, velocity and acceleration of all joints [rad or m, per s, per s²].
struct JointState {
  explicit JointState(Eigen::Index dof)
      : q(Eigen::VectorXd::Zero(dof)), v(Eigen::VectorXd::Zero(dof)), a(v) {}
  Eigen::VectorXd q, v, a;
};

/// Evaluates a uniform cubic B-spline, docs/theory.md (15.1): segment i has the control points
/// (columns) i to i + 3.
/// @param u place in the segment, 0 to 1 @param spacing_s duration of a segment
template <class Points>
void evaluate(const Points& points, Eigen::Index segment, double u, double spacing_s,
              JointState& out) {
  const auto p0 = points.col(segment), p1 = points.col(segment + 1), p2 = points.col(segment + 2),
             p3 = points.col(segment + 3);
  const double w = 1.0 - u;
  out.q = (w * w * w * p0 + (4.0 - 6.0 * u * u + 3.0 * u * u * u) * p1 +
           (4.0 - 6.0 * w * w + 3.0 * w * w * w) * p2 + u * u * u * p3) /
          6.0;
  out.v =
      (w * w * (p1 - p0) + (1.0 + 2.0 * u * w) * (p2 - p1) + u * u * (p3 - p2)) / (2.0 * spacing_s);
  out.a = (w * (p0 - 2.0 * p1 + p2) + u * (p1 - 2.0 * p2 + p3)) / (spacing_s * spacing_s);
}

/// Sets the first three control points so that the spline starts in a state, docs/theory.md (15.2).
inline void set_start(const JointState& state, double spacing_s,
                      Eigen::Ref<Eigen::MatrixXd> points) {
  const double h = spacing_s;
  points.col(1) = state.q - h * h / 6.0 * state.a;
  points.col(0) = points.col(1) - h * state.v + 0.5 * h * h * state.a;
  points.col(2) = points.col(1) + h * state.v + 0.5 * h * h * state.a;
}

}  // namespace hamelin::mppi
