#pragma once
#include <Eigen/Core>
#include <vector>

#include "hamelin/scene/joint_trajectory.hpp"

namespace hamelin::timing {

/// A curve in joint space: polynomials of one degree, at most five, in the parameter σ, one after
/// the other. Positions and tangents agree where two pieces meet, and so does q″ unless the curve
/// was made of something that jumps there.
class Curve {
 public:
  static constexpr int degree_max = 5;

  Curve() = default;
  /// An empty curve, to which pieces are appended. @param degree from 1 to 5
  Curve(Eigen::Index dof, int degree);
  /// The motion of a trajectory; its parameter is the time [s], docs/theory.md (18.14), (18.15).
  explicit Curve(const scene::JointTrajectory& trajectory);

  /// Appends a curve of the same size that begins where this one ends, with the same tangent.
  void add(const Curve& curve);
  /// The part between two places, with its parameter from 0 on.
  [[nodiscard]] Curve part(double from, double to) const;
  /// A place itself if it is on a straight piece; else the first end of a piece behind it at which
  /// q″ is zero, or the end of the curve.
  [[nodiscard]] double next_straight(double from) const;
  /// Appends a piece. @param coefficients dof × (degree + 1): of (σ − its beginning)^k
  void add(double length, const Eigen::MatrixXd& coefficients);

  [[nodiscard]] Eigen::Index dof() const noexcept { return dof_; }
  [[nodiscard]] Eigen::Index pieces() const noexcept {
    return static_cast<Eigen::Index>(knots_.size()) - 1;
  }
  [[nodiscard]] int degree() const noexcept { return degree_; }
  /// Where a piece begins; at(pieces()) is where the last one ends.
  [[nodiscard]] double knot(Eigen::Index k) const { return knots_[static_cast<std::size_t>(k)]; }
  [[nodiscard]] double end() const { return knots_.back(); }
  /// Position and its first and second derivative by σ, which is clamped to the curve. No
  /// allocation if the vectors have dof numbers.
  /// @param first a piece that does not begin after σ @return the piece
  Eigen::Index at(double s, Eigen::VectorXd& q, Eigen::VectorXd& dq, Eigen::VectorXd& ddq,
                  Eigen::Index first = 0) const;
  /// Whether the tangent is the same on both sides of all places where pieces meet, to rounding.
  [[nodiscard]] bool is_smooth() const;
  /// Bounds |q″| of each joint between two places.
  void bound_bend(double from, double to, Eigen::VectorXd& bend) const;

 private:
  /// Raises it to the bound on one piece.
  void include_bend(Eigen::Index piece, double from, double to, Eigen::VectorXd& bend) const;
  [[nodiscard]] bool is_straight(Eigen::Index piece) const;
  [[nodiscard]] const double* coefficient(Eigen::Index piece, int power) const {
    return coefficients_.data() + (piece * (degree_ + 1) + power) * dof_;
  }

  Eigen::Index dof_ = 0;
  int degree_ = 1;
  std::vector<double> knots_{0.0};
  std::vector<double> coefficients_;  ///< dof × (degree + 1) pieces, by powers within a piece
};

}  // namespace hamelin::timing
