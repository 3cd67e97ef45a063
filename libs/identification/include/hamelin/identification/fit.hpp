#pragma once
#include <Eigen/Core>
#include <string>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/identification/samples.hpp"

namespace hamelin::identification {

struct Parameters {
  Eigen::VectorXd inertial;           ///< 10 dof, as dynamics::inertial_parameters
  Eigen::VectorXd damping, friction;  ///< dof each, at least 0 [Nm s/rad or N s/m; Nm or N]
};

/// Those of the model and of its robot's joints.
[[nodiscard]] Parameters parameters_of(const model::Model& model);

/// The robot of a model with other parameters.
/// @throws Error usage for sizes; invalid as model::check
[[nodiscard]] model::Robot with_parameters(const model::Model& model, const Parameters& parameters);

struct FitOptions {
  /// What the prior counts against the data: 1 is the data sheet whose masses have a standard
  /// error of a half.
  double prior_weight = 1.0;
};

struct Fit {
  Parameters parameters;
  Eigen::VectorXd damping_error, friction_error;  ///< standard errors; NaN: not identified
  Eigen::VectorXd sigma;    ///< of the residuals of each joint, standard deviation [Nm or N]
  int base_parameters = 0;  ///< combinations of inertial parameters that torques depend on
  int determined = 0;       ///< of these, that the samples know better than the prior
  /// Of the base parameters: the largest over the smallest singular value of the regressor, in
  /// units of the prior's parameters and the torques' root mean squares.
  double condition = 0.0;
  std::vector<int> still_joints;    ///< that do not move; their friction is that of the prior
  std::vector<int> repaired_links;  ///< whose prior inertia no body has
};

/// Least squares with a prior, docs/theory.md (2.54): the masses, centres of mass and inertias of
/// all links with mass, and damping and dry friction of all joints that move. All links are bodies
/// that can exist, and directions of the parameters that the samples do not determine stay as in
/// the model. Weights of the joints come from the residuals. The same input gives the same bytes.
/// @throws Error invalid if no joint moves or there are too few samples, with `where` in front;
/// usage
///         for samples of another model or a prior weight that is not positive and finite
[[nodiscard]] Fit fit(const model::Model& prior, const Samples& samples, const FitOptions& options,
                      const std::string& where);

/// Differences of torques, of one joint or of all.
struct TorqueError {
  double rms = 0.0;    ///< of the difference [Nm or N]; of all joints: of the norm
  double share = 0.0;  ///< of the root mean square of the torques
};

/// Torques of a robot's parameters against those of samples.
struct TorqueErrors {
  std::vector<TorqueError> joints;
  TorqueError all;  ///< over all joints together
};
[[nodiscard]] TorqueErrors torque_errors(const Samples& samples, const Parameters& parameters);

}  // namespace hamelin::identification
