#pragma once
#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string_view>

#include "hamelin/dynamics/inverse_kinematics.hpp"
#include "hamelin/geometry/se3.hpp"
#include "hamelin/scene/goal.hpp"
#include "hamelin/scene/tip_constraint.hpp"
#include "hamelin/search/tip_constraints.hpp"
#include "hamelin/search/tip_curve.hpp"

namespace hamelin::search {

/// Makes a rotation comparable with a displacement [m].
inline constexpr double rotation_length = 0.25;
/// Share of what plans may use to which configurations are brought, so that lines between them have
/// room to bend.
inline constexpr double inner_share = 0.6;

/// How far a tip may stray, by its rotation and by its point.
struct TipStray {
  double rad = 0.0, m = 0.0;
};

/// One thing that a tip keeps. It measures a tip by a few numbers, on which a motion is proved by
/// those of its ends: in between they stray from the segment between them by so much.
class TipRule {
 public:
  using Value = Eigen::Matrix<double, 6, 1>;

  TipRule() = default;
  TipRule(const TipRule&) = delete;
  TipRule& operator=(const TipRule&) = delete;
  virtual ~TipRule() = default;

  [[nodiscard]] virtual std::string_view name() const noexcept = 0;
  [[nodiscard]] virtual Value value(const geometry::SE3& tip) const = 0;
  /// By how much the tolerance is exceeded; 0 or less: it is kept.
  [[nodiscard]] virtual double excess(const Value& value) const = 0;
  /// An upper bound of it on a motion.
  [[nodiscard]] virtual double excess(const Value& a, const Value& b,
                                      const TipStray& stray) const = 0;
  /// Whether a plan may make a motion.
  [[nodiscard]] virtual bool plan_keeps(const Value& a, const Value& b,
                                        const TipStray& stray) const = 0;
  /// Plans may also use what a start uses.
  virtual void admit(const Value& value) = 0;
  /// The share of what plans leave of the tolerance that a deviation uses.
  [[nodiscard]] virtual double reserve_used(const TipStray& deviation) const = 0;
  /// Whether it is of the rotation only.
  [[nodiscard]] virtual bool turns() const noexcept { return false; }
  /// Appends what moves the tip to where this is well kept.
  /// @param rows, error receive lines [m], from `count` on, at most six
  virtual void add_rows(const geometry::SE3& tip, const dynamics::Matrix6Xd& J,
                        Eigen::MatrixXd& rows, Eigen::VectorXd& error,
                        Eigen::Index& count) const = 0;
  /// Moves a target to where this is well kept.
  virtual void restrict(dynamics::TipTarget& target) const = 0;
};

[[nodiscard]] std::unique_ptr<TipRule> axis_rule(const scene::AxisConstraint& axis);
[[nodiscard]] std::unique_ptr<TipRule> box_rule(const scene::BoxConstraint& box);
/// @param within counts only where the tip's point is inside; none: everywhere, and the tip goes
///        on along the curve, not back
[[nodiscard]] std::unique_ptr<TipRule> curve_rule(
    const TipCurve& curve, const scene::WayTolerance& tolerance,
    const std::optional<TipConstraints::Ball>& within);

}  // namespace hamelin::search
