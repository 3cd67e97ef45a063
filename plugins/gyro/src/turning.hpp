#pragma once
#include <Eigen/Core>

#include "hamelin/io/json.hpp"
#include "hamelin/model/model.hpp"

namespace hamelin::gyro {

enum class Variant { published, energy_neutral, chang_marsden, garimella };

/// How the velocity of an approaching point is turned away from an obstacle: the rate and the axis.
class Turning {
 public:
  Turning(const model::Model& model, const Json& params);

  [[nodiscard]] Variant variant() const noexcept { return variant_; }
  [[nodiscard]] double range_m() const noexcept { return rho0_; }
  /// The angular velocity e = γ u of the turning [rad/s], docs/theory.md (9.10).
  /// @param distance from the obstacle [m]
  /// @param to_obstacle, heading unit vectors to the obstacle and of the velocity, less than a
  ///   right angle apart
  [[nodiscard]] Eigen::Vector3d rate(double distance, const Eigen::Vector3d& to_obstacle,
                                     const Eigen::Vector3d& heading) const;
  /// The vector w of the force w × ẋ that turns without work, docs/theory.md (9.15).
  /// @param M_x operational-space inertia at the point [kg] @param e rate()
  [[nodiscard]] static Eigen::Vector3d neutral(const Eigen::Matrix3d& M_x,
                                               const Eigen::Vector3d& e) {
    return 0.5 * (M_x.trace() * e - M_x * e);
  }

 private:
  [[nodiscard]] double gain(double distance, const Eigen::Vector3d& to_obstacle,
                            const Eigen::Vector3d& heading) const;
  [[nodiscard]] Eigen::Vector3d axis(const Eigen::Vector3d& to_obstacle,
                                     const Eigen::Vector3d& heading) const;
  [[nodiscard]] Eigen::Vector3d head_on_axis(const Eigen::Vector3d& to_obstacle) const;

  Variant variant_;
  double k_obs_, rho0_, rho_min_;
  Eigen::Vector3d plane_normal_ = Eigen::Vector3d::Zero();
};

}  // namespace hamelin::gyro
