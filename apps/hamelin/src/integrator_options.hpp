#pragma once
#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "hamelin/integration/integrator.hpp"

/// --integrator and the options of integrators.
namespace hamelin::app {

struct IntegratorFlags {
  std::optional<std::string> integrator, start, solver;
  std::optional<double> alpha, tolerance, rtol, atol;
  std::optional<int> order;
};

void add_integrator_flags(CLI::App& command, IntegratorFlags& flags);

/// The integrator's parameters: `params` of the scene, overridden by the flags.
/// @throws Error usage for a flag that the integrator does not take
[[nodiscard]] Json integrator_params(const IntegratorFlags& flags, const std::string& integrator,
                                     Json params);

}  // namespace hamelin::app
