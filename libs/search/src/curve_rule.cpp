#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "hamelin/core/numbers.hpp"
#include "tip_rule.hpp"

namespace hamelin::search {

using Eigen::Vector3d;

namespace {

// Its value is the distance from the nearest place of the curve, twice the sine of half the angle
// from the rotation there, which place that is, and where the tip's point is in the ball.
class CurveRule final : public TipRule {
 public:
  CurveRule(const TipCurve& curve, const scene::WayTolerance& tolerance,
            const std::optional<TipConstraints::Ball>& within)
      : curve_(curve),
        tolerance_(tolerance),
        within_(within),
        plan_m_((1.0 - reserve_share) * tolerance.m),
        plan_chord_(turns_freely() ? infinity
                                   : 2.0 * std::sin(0.5 * (1.0 - reserve_share) * tolerance.rad)) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "way"; }
  [[nodiscard]] Value value(const geometry::SE3& tip) const override {
    const double s = curve_.nearest(tip);
    const geometry::SE3 wanted = curve_.at(s);
    const double angle = Eigen::AngleAxisd(wanted.R().transpose() * tip.R()).angle();
    Value out;
    out << (tip.p() - wanted.p()).norm(), 2.0 * std::sin(0.5 * angle), s, Vector3d::Zero();
    if (within_) out.tail<3>() = tip.p() - within_->center_m;
    return out;
  }
  // Of rotations by what they would move a point at the rotation length.
  [[nodiscard]] double excess(const Value& value) const override {
    if (within_ && value.tail<3>().norm() >= within_->radius_m)
      return within_->radius_m - value.tail<3>().norm();
    const double angle = 2.0 * std::asin(std::min(1.0, 0.5 * value[1]));
    return std::max(value[0] - tolerance_.m, rotation_length * (angle - tolerance_.rad));
  }
  [[nodiscard]] double excess(const Value& a, const Value& b,
                              const TipStray& stray) const override {
    const double ds = b[2] - a[2];
    return std::max(excess(a), excess(b)) +
           std::max(stray.m + curve_bend_m(ds), rotation_length * (stray.rad + curve_bend_rad(ds)));
  }
  // docs/theory.md (21.4)
  [[nodiscard]] bool plan_keeps(const Value& a, const Value& b,
                                const TipStray& stray) const override {
    if (within_ && nearest_to_center(a, b) - stray.m >= within_->radius_m) return true;
    const double ds = b[2] - a[2];
    return std::max(a[0], b[0]) + stray.m + curve_bend_m(ds) <= plan_m_ &&
           std::max(a[1], b[1]) + stray.rad + curve_bend_rad(ds) <= plan_chord_ &&
           (within_.has_value() || ds * curve_.length_m() >= -back_share * tolerance_.m);
  }
  void admit(const Value& /*value*/) override {}
  [[nodiscard]] double reserve_used(const TipStray& deviation) const override {
    return std::max(deviation.m / (reserve_share * tolerance_.m),
                    deviation.rad / (reserve_share * tolerance_.rad));
  }
  void add_rows(const geometry::SE3& tip, const dynamics::Matrix6Xd& J, Eigen::MatrixXd& rows,
                Eigen::VectorXd& error, Eigen::Index& count) const override {
    const Value now = value(tip);
    if (within_ && now.tail<3>().norm() >= within_->radius_m) return;
    const geometry::SE3 wanted = curve_.at(now[2]);
    if (now[0] > inner_share * plan_m_) {
      rows.middleRows<3>(count) = J.bottomRows<3>();
      error.segment<3>(count) = wanted.p() - tip.p();
      count += 3;
    }
    if (now[1] > inner_share * plan_chord_) {
      const Eigen::AngleAxisd turn(wanted.R() * tip.R().transpose());
      rows.middleRows<3>(count) = rotation_length * J.topRows<3>();
      error.segment<3>(count) = rotation_length * turn.angle() * turn.axis();
      count += 3;
    }
  }
  void restrict(dynamics::TipTarget& /*target*/) const override {}

 private:
  // What plans leave of the tolerances, for an arm that strays from its path.
  static constexpr double reserve_share = 0.3;
  // By how much of the tolerance a tip may go back along the curve.
  static constexpr double back_share = 0.5;

  [[nodiscard]] bool turns_freely() const { return tolerance_.rad >= std::numbers::pi; }
  // By how much the curve strays from its chord, and its rotation from its own.
  [[nodiscard]] double curve_bend_m(double ds) const { return 0.125 * curve_.bend_m() * ds * ds; }
  [[nodiscard]] double curve_bend_rad(double ds) const {
    const double turn = curve_.turn_rad() * ds;
    return 0.125 * turn * turn;
  }
  [[nodiscard]] static double nearest_to_center(const Value& a, const Value& b) {
    const Vector3d from = a.tail<3>(), way = b.tail<3>() - from;
    const double size = way.squaredNorm(),
                 at = size > 0.0 ? std::clamp(-from.dot(way) / size, 0.0, 1.0) : 0.0;
    return (from + at * way).norm();
  }

  TipCurve curve_;
  scene::WayTolerance tolerance_;
  std::optional<TipConstraints::Ball> within_;
  double plan_m_, plan_chord_;
};

}  // namespace

std::unique_ptr<TipRule> curve_rule(const TipCurve& curve, const scene::WayTolerance& tolerance,
                                    const std::optional<TipConstraints::Ball>& within) {
  return std::make_unique<CurveRule>(curve, tolerance, within);
}

}  // namespace hamelin::search
