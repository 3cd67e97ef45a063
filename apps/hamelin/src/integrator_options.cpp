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
  integrator_name(
      command.add_option("--integrator", flags.integrator, "time stepping (default the scene's or hamel-variational)"));
  command.add_option("--alpha", flags.alpha, "hamel: where in the step velocities are taken, 0 to 1 (default 0.5)")
      ->type_name("A");
  one_of(command.add_option("--start", flags.start, "of hamel and hamel-midpoint (default consistent)"),
         {"published", "consistent"});
  one_of(command.add_option("--solver", flags.solver, "root-finding (default the integrator's own)"),
         {"newton", "feedback", "riqn"});
  command
      .add_option("--tolerance", flags.tolerance,
                  "of root-finding: newton, riqn, gauss |delta|_inf [rad or m] (1e-12), feedback |tau_e| [Nm] (1e-8)")
      ->type_name("E");
  command.add_option("--order", flags.order, "composition: 4, 6 or 8 (default 4); gauss: even, 4 to 16 (default 8)")
      ->type_name("P");
  command
      .add_option(
          "--rtol", flags.rtol,
          "step control (dop853, gauss, rosenbrock): relative error allowed in a step; --step is then the first "
          "step. Alone it sets --atol to the same number")
      ->type_name("E");
  command.add_option("--atol", flags.atol, "absolute error allowed in a step [rad or m, and per second]")
      ->type_name("E");
}

Json integrator_params(const IntegratorFlags& flags, const std::string& integrator, Json params) {
  const bool hamel = integrator == "hamel", midpoint = integrator == "hamel-midpoint";
  const auto* scheme = integration::find_scheme(integrator);
  if (scheme == nullptr) return params;  // make_integrator says what is known
  if (flags.alpha) params["alpha"] = *flags.alpha;
  if (flags.alpha && !hamel) say_unused("--alpha", integrator);
  if (flags.start) params["start"] = *flags.start;
  if (flags.start && !hamel && !midpoint) say_unused("--start", integrator);
  if (flags.solver) {
    require(!scheme->solvers.empty(), "--solver", integrator);
    params["solver"] = *flags.solver;
  }
  if (flags.tolerance) {
    require(scheme->iterates, "--tolerance", integrator);
    // each solver reads its own
    params["tolerance"] = *flags.tolerance;
    params["feedback_tolerance"] = *flags.tolerance;
  }
  if (flags.order) {
    require(!scheme->orders.empty(), "--order", integrator);
    params["order"] = *flags.order;
  }
  if (flags.rtol) {
    require(scheme->step_control, "--rtol", integrator);
    params["rtol"] = *flags.rtol;
  }
  if (flags.atol) {
    require(scheme->step_control, "--atol", integrator);
    params["atol"] = *flags.atol;
  }
  return params;
}

}  // namespace hamelin::app
