#pragma once
#include <Eigen/Core>

namespace hamelin::control {

/// Joint velocities from measured joint positions. The estimate follows the motion that the nominal
/// model predicts and corrects position, velocity and an unexplained acceleration by the error of
/// the measured position. All errors decay with one rate: docs/theory.md (8.16), (8.17).
class StateEstimator {
 public:
  /// @param period_s time between two measurements @param bandwidth rate at which errors decay
  ///        [1/s]; a higher one follows disturbances faster and passes on more noise,
  ///        docs/theory.md (8.18)
  /// @param noise standard deviation of the measured positions [rad or m]; with it the bandwidth of
  ///        a joint rises while the error of its prediction is more than noise, docs/theory.md
  ///        (8.19). 0 keeps the bandwidth.
  StateEstimator(Eigen::Index dof, double period_s, double bandwidth, double noise = 0.0);

  /// Starts at a measured position with a velocity.
  void start(const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  /// Advances the estimate by one period to the measurement at its end.
  /// @param q measured joint positions
  /// @param acceleration of the nominal model during the period [rad/s² or m/s²]
  void update(const Eigen::VectorXd& q, const Eigen::VectorXd& acceleration);

  [[nodiscard]] const Eigen::VectorXd& q() const noexcept { return q_; }
  [[nodiscard]] const Eigen::VectorXd& v() const noexcept { return v_; }
  /// The acceleration that the model does not explain.
  [[nodiscard]] const Eigen::VectorXd& disturbance() const noexcept { return disturbance_; }

 private:
  struct Gains {
    double position, velocity, disturbance;
  };
  [[nodiscard]] Gains gains(double bandwidth) const;

  double period_s_, bandwidth_, noise_, smoothing_;
  Gains usual_;
  Eigen::VectorXd q_, v_, disturbance_, smooth_error_;
};

}  // namespace hamelin::control
