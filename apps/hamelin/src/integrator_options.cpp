#include "integrator_options.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "command_line.hpp"
#include "hamelin/core/error.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

void require(bool takes, const char* flag, const std::string& integrator) {
  if (!takes) throw Error(ErrorCode::usage, fmt::format("{}: integrator '{}' does not take it", flag, integrator));
}

// Schemes are compared by changing their name alone, so what belongs to the published ones is no error elsewhere.
void say_unused(const char* flag, const std::string& integrator) {
  note(fmt::format("{}: means nothing to integrator '{}', ignored", flag, integrator));
}

}  // namespace

void add_integrator_flags(CLI::App& command, IntegratorFlags& flags) {
  one_of(
      command.add_option("--integrator", flags.integrator, "time stepping (default the scene's or hamel-variational)"),
      integration::integrator_names())
      ->type_name("NAME");
  command.add_option("--alpha", flags.alpha, "hamel: where in the step velocities are taken, 0 to 1 (default 0.5)")
      ->type_name("A");
  one_of(command.add_option("--start", flags.start, "of hamel and hamel-midpoint (default consistent)"),
         {"published", "consistent"});
  one_of(command.add_option("--solver", flags.solver, "root-finding (default the integrator's own)"),
         {"newton", "feedback"});
  command
      .add_option("--tolerance", flags.tolerance,
                  "of root-finding: newton |delta|_inf [rad or m] (1e-12), feedback |tau_e| [Nm] (1e-8)")
      ->type_name("E");
}

Json integrator_params(const IntegratorFlags& flags, const std::string& integrator, Json params) {
  const bool hamel = integrator == "hamel", midpoint = integrator == "hamel-midpoint";
  const bool root_finding = hamel || midpoint || integrator == "hamel-variational";
  if (flags.alpha) params["alpha"] = *flags.alpha;
  if (flags.alpha && !hamel) say_unused("--alpha", integrator);
  if (flags.start) params["start"] = *flags.start;
  if (flags.start && !hamel && !midpoint) say_unused("--start", integrator);
  if (flags.solver) {
    require(root_finding, "--solver", integrator);
    params["solver"] = *flags.solver;
  }
  if (flags.tolerance) {
    require(root_finding, "--tolerance", integrator);
    // each solver reads its own
    params["tolerance"] = *flags.tolerance;
    params["feedback_tolerance"] = *flags.tolerance;
  }
  return params;
}

}  // namespace hamelin::app
