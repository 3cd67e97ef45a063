#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/identification/fit.hpp"
#include "hamelin/io/json.hpp"

namespace hamelin::identification {

struct Options {
  WindowOptions windows;
  FitOptions fit;
  /// The share at the end of the motion that is not fitted at first, but used for a test.
  double test_share = 0.2;
};

struct Identification {
  model::Robot robot;                  ///< with what was identified
  Parameters before;                   ///< of the prior
  Fit fit;                             ///< to the whole motion
  TorqueErrors errors_before, errors;  ///< of the prior and of the fit, on the whole motion
  TorqueErrors held_out;               ///< of a fit to the first part of the motion, on the rest
  std::size_t samples = 0;
  double window_s = 0.0;    ///< over which the equations of motion were averaged
  Eigen::VectorXd q_noise;  ///< as in Samples
  std::vector<std::string> notes;
};

/// Identifies the parameters of a robot by a record of a motion.
/// @param prior the robot with approximate parameters, in its place and under its gravity
/// @throws Error as windowed_samples and fit; usage for a test share that is not in (0, 1)
[[nodiscard]] Identification identify(const model::Model& prior, const Record& record,
                                      const Options& options);

/// The error of the identified parameters on another motion of the robot.
/// @param model the robot in its place and under its gravity there; its parameters do not count
/// @throws Error as windowed_samples
[[nodiscard]] TorqueErrors test(const model::Model& model, const Identification& identified,
                                const Record& record, const WindowOptions& options);

/// As a document, with units in the names of its fields.
/// @param test errors on another motion; none: null
[[nodiscard]] Json to_json(const Identification& identified,
                           const std::optional<TorqueErrors>& test);
/// As a table.
[[nodiscard]] std::string to_table(const Identification& identified,
                                   const std::optional<TorqueErrors>& test);

}  // namespace hamelin::identification
