#pragma once
#include <Eigen/Core>

namespace hamelin::control {

/// Where an arm is, how fast it moves, and the acceleration that its model does not explain
/// (friction, wrong masses), from what is measured in each period: positions and velocities,
/// docs/theory.md (8.20), or positions alone. Then the estimate follows the motion that the model
/// predicts, and corrects all three by the error of the measured position; all errors decay with
/// one rate: docs/theory.md (8.16), (8.17). No allocation after construction.
class StateEstimator {
 public:
  /// For measured positions and velocities. @param period_s time between two measurements
  StateEstimator(Eigen::Index dof, double period_s);
  /// For measured positions. @param bandwidth rate at which errors decay [1/s]; a higher one
  /// follows
  ///        disturbances faster and passes on more noise, docs/theory.md (8.18)
  /// @param noise standard deviation of the measured positions [rad or m]; with it the bandwidth of
  ///        a joint rises while the error of its prediction is more than noise, docs/theory.md
  ///        (8.19). 0 keeps the bandwidth.
  StateEstimator(Eigen::Index dof, double period_s, double bandwidth, double noise = 0.0);

  /// Starts at a measured position with a velocity, and knows nothing else.
  void start(const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  /// Goes on at another position and velocity, which tell nothing of the disturbance.
  void move_to(const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  /// Advances the estimate by one period to the measurement at its end.
  /// @param q, v measured; v is not read where only positions are measured
  /// @param acceleration of the model during the period [rad/s² or m/s²]
  void update(const Eigen::VectorXd& q, const Eigen::VectorXd& v,
              const Eigen::VectorXd& acceleration);
  /// Advances it by one period without a measurement.
  void predict(const Eigen::VectorXd& acceleration);

  [[nodiscard]] const Eigen::VectorXd& q() const noexcept { return q_; }
  [[nodiscard]] const Eigen::VectorXd& v() const noexcept { return v_; }
  /// The acceleration that the model does not explain [rad/s² or m/s²].
  [[nodiscard]] const Eigen::VectorXd& disturbance() const noexcept { return disturbance_; }

 private:
  struct Gains {
    double position, velocity, disturbance;
  };
  [[nodiscard]] Gains gains(double bandwidth) const;
  void correct_by_position(const Eigen::VectorXd& q);

  double period_s_;
  double bandwidth_ = 0.0, noise_ = 0.0, smoothing_ = 0.0;  ///< zero where velocities are measured
  Gains usual_{};
  double velocity_gain_ = 0.0;  ///< zero where they are not
  Eigen::VectorXd q_, v_, disturbance_, smooth_error_;
};

}  // namespace hamelin::control
