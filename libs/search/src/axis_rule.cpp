#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "hamelin/geometry/so3.hpp"
#include "tip_rule.hpp"

namespace hamelin::search {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

Matrix3d frame_along(const Vector3d& direction) {
  return geometry::rotation_between(direction, Vector3d::UnitZ());
}

double angle_of(const Vector3d& value) {
  return std::atan2(value.head<2>().norm(), value.z());
}

// About which a vector turns towards z, by its components.
Vector3d turn_axis(const Vector3d& value) {
  const double across = value.head<2>().norm();
  return across > 1e-9 ? Vector3d(value.y() / across, -value.x() / across, 0.0) : Vector3d::UnitX();
}

// Its value is the axis by its components in a frame whose z is the direction.
class AxisRule final : public TipRule {
 public:
  explicit AxisRule(const scene::AxisConstraint& given)
      : axis_(given.axis.normalized()),
        from_world_(frame_along(given.direction.normalized())),
        angle_(given.angle_rad),
        reserve_(plan_reserve(given)),
        plan_angle_(angle_ - reserve_) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "axis"; }
  [[nodiscard]] bool turns() const noexcept override { return true; }
  [[nodiscard]] Value value(const geometry::SE3& tip) const override {
    Value out = Value::Zero();
    out.head<3>() = from_world_ * tip.R() * axis_;
    return out;
  }
  [[nodiscard]] double excess(const Value& value) const override {
    return angle_of(value.head<3>()) - angle_;
  }
  // Of all unit vectors that are no farther than the stray from the segment between two.
  [[nodiscard]] double excess(const Value& a, const Value& b,
                              const TipStray& stray) const override {
    const double most = std::max(excess(a), excess(b)),
                 across = std::max(a.head<2>().norm(), b.head<2>().norm());
    if (!(a.z() > 0.0 && b.z() > 0.0) || stray.rad == 0.0) return most + stray.rad;
    return std::max(most, std::asin(std::min(1.0, across + stray.rad)) - angle_);
  }
  // docs/theory.md (21.1), (21.2)
  [[nodiscard]] bool plan_keeps(const Value& a, const Value& b,
                                const TipStray& stray) const override {
    return a.z() > 0.0 && b.z() > 0.0 &&
           std::max(a.head<2>().norm(), b.head<2>().norm()) + stray.rad <= std::sin(plan_angle_);
  }
  void admit(const Value& value) override {
    plan_angle_ =
        std::max(plan_angle_, std::min(angle_, angle_of(value.head<3>()) + start_share * angle_));
  }
  [[nodiscard]] double reserve_used(const TipStray& deviation) const override {
    return deviation.rad / reserve_;
  }
  void add_rows(const geometry::SE3& tip, const dynamics::Matrix6Xd& J, Eigen::MatrixXd& rows,
                Eigen::VectorXd& error, Eigen::Index& count) const override {
    const Vector3d now = value(tip).head<3>();
    const double by = angle_of(now) - inner_share * plan_angle_;
    if (by <= 0.0) return;
    const Vector3d about = from_world_.transpose() * turn_axis(now);
    rows.row(count).noalias() = rotation_length * (about.transpose() * J.topRows<3>());
    error[count++] = rotation_length * by;
  }
  void restrict(dynamics::TipTarget& target) const override {
    const Vector3d now = from_world_ * target.rotation * axis_;
    const double by = angle_of(now) - inner_share * plan_angle_;
    if (by > 0.0) {
      const Vector3d about = from_world_.transpose() * turn_axis(now);
      target.rotation = Eigen::AngleAxisd(by, about).toRotationMatrix() * target.rotation;
    }
    target.tolerance_rad = std::min(target.tolerance_rad, (1.0 - inner_share) * plan_angle_);
  }

 private:
  // What a start may add to what it uses, as a share of the angle.
  static constexpr double start_share = 0.1;

  Vector3d axis_;  ///< in the tip's frame
  Matrix3d from_world_;
  double angle_, reserve_, plan_angle_;
};

}  // namespace

double plan_reserve(const scene::AxisConstraint& axis) noexcept {
  constexpr double most_rad = 0.02, most_share = 0.3;
  return std::min(most_rad, most_share * axis.angle_rad);
}

std::unique_ptr<TipRule> axis_rule(const scene::AxisConstraint& axis) {
  return std::make_unique<AxisRule>(axis);
}

}  // namespace hamelin::search
