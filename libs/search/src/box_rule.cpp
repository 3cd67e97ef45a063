#include <algorithm>
#include <cmath>
#include <utility>

#include "tip_rule.hpp"

namespace hamelin::search {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

// Of a box without an end, so far from its other side configurations are brought [m].
constexpr double inner_m = 0.01;

constexpr double reserve_m = 0.003, reserve_share = 0.15;

// The part of [low, high] in which configurations are left where they are.
std::pair<double, double> inner(double low, double high) {
  const bool has_low = std::isfinite(low), has_high = std::isfinite(high);
  const double rim = has_low && has_high ? 0.5 * (1.0 - inner_share) * (high - low) : inner_m;
  return {has_low ? low + rim : low, has_high ? high - rim : high};
}

// Its value is the tip's point in the box's frame.
class BoxRule final : public TipRule {
 public:
  explicit BoxRule(const scene::BoxConstraint& box)
      : from_world_(box.pose.R().transpose()),
        origin_(box.pose.p()),
        low_(box.low_m),
        high_(box.high_m) {
    const Vector3d reserve = plan_reserve(box);
    reserve_ = reserve.minCoeff();
    plan_low_ = low_ + reserve;
    plan_high_ = high_ - reserve;
  }

  [[nodiscard]] std::string_view name() const noexcept override { return "box"; }
  [[nodiscard]] Value value(const geometry::SE3& tip) const override {
    Value out = Value::Zero();
    out.head<3>() = from_world_ * (tip.p() - origin_);
    return out;
  }
  [[nodiscard]] double excess(const Value& value) const override {
    const Vector3d at = value.head<3>();
    return (at - high_).cwiseMax(low_ - at).maxCoeff();
  }
  [[nodiscard]] double excess(const Value& a, const Value& b,
                              const TipStray& stray) const override {
    return std::max(excess(a), excess(b)) + stray.m;
  }
  // docs/theory.md (21.1), (21.2)
  [[nodiscard]] bool plan_keeps(const Value& a, const Value& b,
                                const TipStray& stray) const override {
    const Vector3d low = a.head<3>().cwiseMin(b.head<3>()),
                   high = a.head<3>().cwiseMax(b.head<3>());
    return (low.array() - stray.m >= plan_low_.array()).all() &&
           (high.array() + stray.m <= plan_high_.array()).all();
  }
  void admit(const Value& value) override {
    const Vector3d at = value.head<3>(), more = (start_share * (high_ - low_)).cwiseMin(reserve_m);
    plan_low_ = plan_low_.cwiseMin((at - more).cwiseMax(low_));
    plan_high_ = plan_high_.cwiseMax((at + more).cwiseMin(high_));
  }
  [[nodiscard]] double reserve_used(const TipStray& deviation) const override {
    return deviation.m / reserve_;
  }
  void add_rows(const geometry::SE3& tip, const dynamics::Matrix6Xd& J, Eigen::MatrixXd& rows,
                Eigen::VectorXd& error, Eigen::Index& count) const override {
    const Value now = value(tip);
    for (Index i = 0; i < 3; ++i) {
      const auto [low, high] = inner(plan_low_[i], plan_high_[i]);
      const double by = now[i] < low ? low - now[i] : std::min(0.0, high - now[i]);
      if (by == 0.0) continue;
      rows.row(count).noalias() = from_world_.row(i) * J.bottomRows<3>();
      error[count++] = by;
    }
  }
  void restrict(dynamics::TipTarget& target) const override {
    Vector3d at = from_world_ * (target.position - origin_);
    for (Index i = 0; i < 3; ++i) {
      const auto [low, high] = inner(plan_low_[i], plan_high_[i]);
      at[i] = std::clamp(at[i], low, std::max(low, high));
      if (std::isfinite(low)) target.tolerance_m = std::min(target.tolerance_m, low - plan_low_[i]);
      if (std::isfinite(high))
        target.tolerance_m = std::min(target.tolerance_m, plan_high_[i] - high);
    }
    target.position = origin_ + from_world_.transpose() * at;
  }

 private:
  // What a start may add to what it uses, as a share of a side.
  static constexpr double start_share = 0.1;

  Matrix3d from_world_;
  Vector3d origin_, low_, high_, plan_low_, plan_high_;
  double reserve_ = 0.0;
};

}  // namespace

Vector3d plan_reserve(const scene::BoxConstraint& box) noexcept {
  return (reserve_share * (box.high_m - box.low_m)).cwiseMin(reserve_m);
}

std::unique_ptr<TipRule> box_rule(const scene::BoxConstraint& box) {
  return std::make_unique<BoxRule>(box);
}

}  // namespace hamelin::search
