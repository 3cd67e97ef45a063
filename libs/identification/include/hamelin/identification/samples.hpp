#pragma once
#include <Eigen/Core>
#include <optional>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/identification/record.hpp"

namespace hamelin::identification {

/// Linear equations for the parameters of an arm, one row per joint and sample:
/// A (π, d, c) = b with the inertial parameters π of all links (dynamics/regressor.hpp), and the
/// damping d and dry friction c of the row's joint. b is the torque of the motor without that of
/// the rotor's known inertia [Nm or N].
struct Samples {
  struct Joint {
    Eigen::MatrixXd A;  ///< samples × (10 dof + 2)
    Eigen::VectorXd b;  ///< samples
  };

  std::vector<Joint> joints;
  std::vector<double> time_s;  ///< of the samples; those from windows: their middles
  /// Number of samples that tell as much as one that shares no data with others; at least 1.
  double overlap = 1.0;
  double window_s = 0.0;    ///< over which the equations were averaged; 0: not at all
  Eigen::VectorXd q_noise;  ///< estimated noise of the positions, standard deviation [rad or m]

  [[nodiscard]] Eigen::Index rows() const noexcept {
    return joints.empty() ? 0 : joints.front().A.rows();
  }
};

/// Samples of known states, docs/theory.md (2.43).
/// @param q, v, a, tau dof × samples: positions [rad or m], rates, accelerations, and torques of
/// the
///        motors [Nm or N]
/// @param friction_speed of dry friction [rad/s or m/s], above 0
/// @throws Error usage for sizes that do not fit, numbers that are not finite, or the speed
[[nodiscard]] Samples exact_samples(const model::Model& model, const Eigen::MatrixXd& q,
                                    const Eigen::MatrixXd& v, const Eigen::MatrixXd& a,
                                    const Eigen::MatrixXd& tau, double friction_speed);

struct WindowOptions {
  /// Length of the windows over which the equations are averaged [s]. None: from 0.1 s on as long
  /// as the noise of the positions requires.
  std::optional<double> window_s{};
  double friction_speed = 0.01;  ///< of dry friction [rad/s or m/s], above 0
};

/// The equations of motion of a record, averaged over windows so that no acceleration is needed,
/// docs/theory.md (2.48)–(2.50). Model and windows see the same low-pass, so it biases nothing.
/// Ticks that are not usable, gaps, and the ends of the record are left out.
/// @throws Error invalid if too little is left, with the file and what was expected; usage for
///         options that are not positive and finite
[[nodiscard]] Samples windowed_samples(const model::Model& model, const Record& record,
                                       const WindowOptions& options);

/// The samples with times in [from_s, to_s).
[[nodiscard]] Samples between(const Samples& samples, double from_s, double to_s);

}  // namespace hamelin::identification
