#include "hamelin/search/tip_curve.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "hamelin/core/error.hpp"

namespace hamelin::search {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

constexpr double no_length_m = 1e-6;  // a curve that only turns is not longer
constexpr double on_a_line = 1e-6;

}  // namespace

TipCurve TipCurve::line(const geometry::SE3& from, const geometry::SE3& to) {
  TipCurve out;
  out.from_R_ = from.R();
  out.from_p_ = from.p();
  out.along_ = to.p() - from.p();
  out.length_ = out.along_.norm();
  const AngleAxisd turn(from.R().transpose() * to.R());
  out.axis_ = turn.axis();
  out.turn_ = turn.angle();
  out.frame_.setIdentity();
  out.center_.setZero();
  return out;
}

// The centre is where the bisecting planes of two chords meet the plane of the arc.
TipCurve TipCurve::arc(const geometry::SE3& from, const Vector3d& through_m,
                       const geometry::SE3& to) {
  TipCurve out = line(from, to);
  const Vector3d a = through_m - from.p(), b = out.along_, normal = a.cross(b);
  const double size = std::max(a.squaredNorm(), b.squaredNorm());
  if (!(normal.norm() > on_a_line * size))
    throw Error(ErrorCode::invalid,
                "arc: its ends and the point between them are on a line, expected three points of "
                "a circle");
  const Vector3d to_center =
      (b.squaredNorm() * a - a.squaredNorm() * b).cross(normal) / (-2.0 * normal.squaredNorm());
  out.center_ = from.p() + to_center;
  out.radius_ = to_center.norm();
  out.frame_.col(0) = -to_center.normalized();
  out.frame_.col(2) = normal.normalized();
  out.frame_.col(1) = out.frame_.col(2).cross(out.frame_.col(0));
  const auto angle_of = [&](const Vector3d& point) {
    const Vector3d x = out.frame_.transpose() * (point - out.center_);
    const double angle = std::atan2(x.y(), x.x());
    return angle > 0.0 ? angle : angle + 2.0 * std::numbers::pi;
  };
  // the arc is the one that passes the point between its ends
  out.angle_ = angle_of(to.p());
  if (angle_of(through_m) > out.angle_) {
    out.frame_.rightCols<2>() *= -1.0;
    out.angle_ = angle_of(to.p());
  }
  out.length_ = out.radius_ * out.angle_;
  return out;
}

geometry::SE3 TipCurve::at(double s) const {
  const Matrix3d R = from_R_ * AngleAxisd(s * turn_, axis_);
  if (radius_ == 0.0) return {R, from_p_ + s * along_};
  const double a = s * angle_;
  return {R, center_ + radius_ * (std::cos(a) * frame_.col(0) + std::sin(a) * frame_.col(1))};
}

double TipCurve::nearest(const geometry::SE3& tip) const {
  if (length_ > no_length_m && radius_ == 0.0)
    return std::clamp((tip.p() - from_p_).dot(along_) / (length_ * length_), 0.0, 1.0);
  if (length_ > no_length_m) {
    const Vector3d x = frame_.transpose() * (tip.p() - center_);
    double angle = std::atan2(x.y(), x.x());
    const double beyond = 0.5 * (angle_ + 2.0 * std::numbers::pi);  // nearer to the first end
    if (angle < 0.0) angle += 2.0 * std::numbers::pi;
    return angle > beyond ? 0.0 : std::min(angle / angle_, 1.0);
  }
  if (turn_ == 0.0) return 1.0;
  const Eigen::Quaterniond turned(from_R_.transpose() * tip.R());
  const double angle = 2.0 * std::atan2(turned.vec().dot(axis_), turned.w());
  return std::clamp(std::remainder(angle, 2.0 * std::numbers::pi) / turn_, 0.0, 1.0);
}

}  // namespace hamelin::search
