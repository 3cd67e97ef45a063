#pragma once
#include <Eigen/Core>
#include <cmath>

namespace hamelin::reactive {

/// A turn of a desired velocity u in joint space, by an angle in the plane of u and a direction p:
/// u' = exp(angle S) u, where S is skew in the metric G, so that u' has the kinetic energy of u:
/// docs/theory.md (10.8).
struct Turn {
  Eigen::VectorXd direction;  ///< p, not along u
  double angle = 0.0;         ///< [rad]
  double left_s = 0.0;        ///< time for which it goes on; 0: no turn

  [[nodiscard]] bool on() const noexcept { return left_s > 0.0; }
};

/// Turns velocities. Only the constructor allocates.
class Turner {
 public:
  explicit Turner(Eigen::Index dof)
      : Gu_(Eigen::VectorXd::Zero(dof)), side_(Eigen::VectorXd::Zero(dof)), Gside_(side_) {}

  /// Turns u, which is brought to the cruise speed before and does not pass it afterwards.
  /// @param G metric, the mass matrix
  void apply(const Turn& turn, const Eigen::MatrixXd& G, double cruise_speed, Eigen::VectorXd& u) {
    const double speed = u.lpNorm<Eigen::Infinity>();
    if (!(speed > 1e-9)) return;
    u *= cruise_speed / speed;
    rotate(turn, G, u);
    const double turned = u.lpNorm<Eigen::Infinity>();
    if (turned > cruise_speed) u *= cruise_speed / turned;
  }
  /// The turn alone: u' has the energy of u.
  void rotate(const Turn& turn, const Eigen::MatrixXd& G, Eigen::VectorXd& u) {
    Gu_.noalias() = G * u;
    const double energy = u.dot(Gu_);
    if (!(energy > 0.0)) return;
    side_ = turn.direction - (turn.direction.dot(Gu_) / energy) * u;
    Gside_.noalias() = G * side_;
    const double side_energy = side_.dot(Gside_);
    if (!(side_energy > 1e-18 * energy)) return;  // u has the direction of the turn
    u *= std::cos(turn.angle);
    u += (std::sin(turn.angle) * std::sqrt(energy / side_energy)) * side_;
  }

 private:
  Eigen::VectorXd Gu_, side_, Gside_;
};

}  // namespace hamelin::reactive
