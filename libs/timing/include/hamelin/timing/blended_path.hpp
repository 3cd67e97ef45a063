#pragma once
#include <Eigen/Core>

#include "hamelin/scene/levers.hpp"
#include "hamelin/search/query.hpp"
#include "hamelin/timing/curve.hpp"

namespace hamelin::timing {

/// Way-points joined by straight lines, with a blend around each corner, docs/theory.md (19.1),
/// (19.2): a curve with continuous tangent and curvature, by arc length but for the blends.
class BlendedPath {
 public:
  /// @param points dof × way-points, at least two, of which no two neighbours are equal
  explicit BlendedPath(Eigen::MatrixXd points);

  [[nodiscard]] const Eigen::MatrixXd& points() const noexcept { return points_; }
  [[nodiscard]] Eigen::Index corners() const noexcept { return points_.cols() - 2; }
  /// The length of the lines up to a way-point, which is the parameter of the curve there.
  [[nodiscard]] double begin(Eigen::Index point) const { return begin_[point]; }
  [[nodiscard]] double length() const { return begin_[points_.cols() - 1]; }
  /// Half of the length of the blend around a way-point; zero at the ends of the path.
  [[nodiscard]] double half_length(Eigen::Index point) const { return half_[point]; }
  void set_half_length(Eigen::Index point, double d) { half_[point] = d; }
  /// What the blends beside it leave.
  [[nodiscard]] double room(Eigen::Index point) const;
  /// A fair share of the lines beside it: half of one that leads to another corner.
  [[nodiscard]] double share(Eigen::Index point) const;
  /// The difference of the unit vectors along the lines before and behind it.
  [[nodiscard]] Eigen::VectorXd turn(Eigen::Index point) const;
  /// Position on the blend around a way-point. @param x from −half_length to half_length
  void blend_at(Eigen::Index point, double x, Eigen::VectorXd& q) const;
  [[nodiscard]] Curve curve() const;

 private:
  [[nodiscard]] Eigen::VectorXd direction(Eigen::Index line) const;

  Eigen::MatrixXd points_;
  Eigen::VectorXd begin_, half_;
};

/// Makes the blends of a path as wide as can be proved: docs/theory.md (19.3).
class Blending {
 public:
  /// @param levers of the model, kept by reference
  explicit Blending(const scene::Levers& levers) : levers_(levers) {}

  /// Sets the half-lengths of the corners from `first` to `last` to what can be proved, beginning
  /// with what they are.
  /// @param margins that the lines of the path are proved to keep, and the blends will
  /// @param query proves the chords; its margins are changed
  void widen(BlendedPath& path, const search::Margins& margins, search::Query& query,
             Eigen::Index first, Eigen::Index last);
  /// The same for all corners, beginning with all that there is room for.
  void widen(BlendedPath& path, const search::Margins& margins, search::Query& query);
  /// By how much the curve may be nearer to something than the margins, in the worst case [m].
  static constexpr double loss_m = 5e-4;

 private:
  [[nodiscard]] bool is_clear(const BlendedPath& path, Eigen::Index point,
                              const search::Margins& margins, search::Query& query);
  [[nodiscard]] double unproved_half_length(const Eigen::VectorXd& turn,
                                            search::Query& query) const;

  const scene::Levers& levers_;
};

}  // namespace hamelin::timing
