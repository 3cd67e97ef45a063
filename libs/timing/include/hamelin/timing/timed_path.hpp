#pragma once
#include <Eigen/Core>
#include <vector>

#include "hamelin/scene/joint_trajectory.hpp"
#include "hamelin/timing/curve.hpp"

namespace hamelin::timing {

/// A motion along a curve: the third derivative of σ(t) is constant between nodes, and zero where
/// accelerations may jump; docs/theory.md (19.5), (19.12). It ends at rest.
struct TimedPath {
  Curve curve;
  Eigen::VectorXd place;   ///< σ of each node
  Eigen::VectorXd time_s;  ///< t of each node, from 0
  Eigen::VectorXd speed;   ///< dσ/dt there
  Eigen::VectorXd rate;    ///< d²σ/dt² behind each node but the last
  Eigen::VectorXd ramp;    ///< d³σ/dt³ there
  /// Torques that move the arm along the curve are inertia · d²σ/dt² + bias · (dσ/dt)² + gravity:
  /// M q′, M q″ + C(q, q′) q′ and ∂U at each node, dof × nodes [Nm or N]; docs/theory.md (19.4).
  Eigen::MatrixXd inertia, bias, gravity;
  Eigen::MatrixXd tangent, curvature;  ///< q′ and q″ at each node, dof × nodes

  [[nodiscard]] bool empty() const noexcept { return place.size() == 0; }
  [[nodiscard]] Eigen::Index nodes() const noexcept { return place.size(); }
  [[nodiscard]] double duration_s() const { return time_s[nodes() - 1]; }
  /// d²σ/dt² behind a node; at the last one, before it.
  [[nodiscard]] double rate_at(Eigen::Index node) const {
    return node + 1 < nodes() ? rate[node] : rate_at_end(node - 1);
  }
  /// d²σ/dt² before the node behind an interval.
  [[nodiscard]] double rate_at_end(Eigen::Index interval) const {
    return rate[interval] + ramp[interval] * (time_s[interval + 1] - time_s[interval]);
  }
  /// The straight line between the ends of an interval, and by how much the curve strays from it at
  /// most, per joint. No allocation if the vectors have dof numbers.
  void chord(Eigen::Index interval, Eigen::VectorXd& from, Eigen::VectorXd& to,
             Eigen::VectorXd& stray) const;
  /// Where a motion is.
  struct Cursor {
    Eigen::Index node = 0, piece = 0;  ///< the last ones that it passed
  };
  /// σ at a time, which is clamped to the motion, and dσ/dt there.
  struct Along {
    double place, speed;
  };
  [[nodiscard]] Along along(double t) const;
  /// The time at which σ is a place, which is clamped to the motion.
  [[nodiscard]] double time_at(double place) const;
  /// Position, velocity and acceleration at a time, which is clamped to the motion. No allocation
  /// if the vectors have dof numbers.
  /// @param cursor of the same or an earlier time; moved on
  void at(double t, Eigen::VectorXd& q, Eigen::VectorXd& v, Eigen::VectorXd& a,
          Cursor& cursor) const;
  /// A place on the motion, and the rate at which it is passed, as a share of its own.
  struct Place {
    double time_s = 0.0, rate = 1.0;
  };
  /// The place nearest to a state, by one Gauss–Newton step from another one; where the motion is
  /// slow, that one. Sets the position and velocity there to q and v, at full rate.
  [[nodiscard]] Place project(const Eigen::VectorXd& q_arm, const Eigen::VectorXd& v_arm,
                              const Place& near, Cursor& cursor, Eigen::VectorXd& q,
                              Eigen::VectorXd& v, Eigen::VectorXd& a) const;
  /// The motion at times that are at most `spacing_s` apart, with points before and behind each
  /// place where the acceleration jumps, between which it changes as fast.
  [[nodiscard]] scene::JointTrajectory sampled(double spacing_s) const;

 private:
  /// The times between which sampled() may space its points evenly.
  [[nodiscard]] std::vector<double> sample_breaks(double beside_s) const;
};

}  // namespace hamelin::timing
