#include "turning.hpp"

#include <Eigen/Geometry>
#include <cmath>
#include <string>

namespace hamelin::gyro {

using Eigen::Vector3d;

namespace {

Variant variant_named(const std::string& name) {
  if (name == "published") return Variant::published;
  if (name == "energy-neutral") return Variant::energy_neutral;
  return name == "chang-marsden" ? Variant::chang_marsden : Variant::garimella;
}

}  // namespace

Turning::Turning(const model::Model& model, const Json& params)
    : variant_(variant_named(params.at("variant"))),
      k_obs_(params.at("k_obs").get<double>()),
      rho0_(params.at("rho0_m").get<double>()),
      rho_min_(params.at("distance_min_m").get<double>()) {
  if (model.planar()) plane_normal_ = model.root().R().col(2);
}

Vector3d Turning::rate(double distance, const Vector3d& to_obstacle,
                       const Vector3d& heading) const {
  return gain(distance, to_obstacle, heading) * axis(to_obstacle, heading);
}

/// The rate γ at which the velocity is turned [1/s]: docs/theory.md (9.11), (9.17), (9.18).
double Turning::gain(double distance, const Vector3d& to_obstacle, const Vector3d& heading) const {
  const double rho = std::max(distance, rho_min_), cosine = to_obstacle.dot(heading);
  if (variant_ == Variant::chang_marsden) return k_obs_ / rho;
  if (variant_ == Variant::garimella) return k_obs_ * (1.0 / rho - 1.0 / rho0_) * cosine * cosine;
  // The arccosine, as printed in the paper, would lose digits near zero.
  const double angle = std::atan2(to_obstacle.cross(heading).norm(), cosine);
  return k_obs_ * std::exp(angle - 1.0) / rho / (1.0 + std::exp(distance - rho0_));
}

/// The unit axis about which the velocity turns away from the obstacle: docs/theory.md (9.10).
Vector3d Turning::axis(const Vector3d& to_obstacle, const Vector3d& heading) const {
  const Vector3d turn = to_obstacle.cross(heading);
  const double sine = turn.norm();
  return sine > 1e-9 ? Vector3d(turn / sine) : head_on_axis(to_obstacle);
}

/// The axis for head-on motion, where docs/theory.md (9.10) is 0/0: the plane's normal for planar
/// arms; in space the normal of to_obstacle that is nearest to the world axis with the smallest
/// component along it, the first of equal ones.
Vector3d Turning::head_on_axis(const Vector3d& to_obstacle) const {
  if (!plane_normal_.isZero()) return plane_normal_;
  Eigen::Index axis = 0;
  to_obstacle.cwiseAbs().minCoeff(&axis);
  const Vector3d unit = Vector3d::Unit(axis);
  return (unit - to_obstacle * to_obstacle.dot(unit)).normalized();
}

}  // namespace hamelin::gyro
