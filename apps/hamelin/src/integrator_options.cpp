#include "integrator_options.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "command_line.hpp"
#include "hamelin/core/error.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

void require(bool accepted, const char* flag, const std::string& integrator) {
  if (!accepted)
    throw Error(ErrorCode::usage,
                fmt::format("{}: integrator '{}' does not take this option", flag, integrator));
}

// Users compare schemes by changing the name only, so the options of the published schemes are no
// error with other schemes.
void note_unused(const char* flag, const std::string& integrator) {
  note(fmt::format("{}: has no effect with integrator '{}', ignored", flag, integrator));
}

}  // namespace

void add_integrator_flags(CLI::App& command, IntegratorFlags& flags) {
  restrict_to_integrators(command.add_option(
      "--integrator", flags.integrator,
      "time integrator (default the scene's, or hamel-variational). lie-exact: Lee and others "
      "2016, with momenta at nodes and closed-form dexp. energy-attractor: Chang and others 2016, "
      "attracts joint circles and energy, rk4"));
  command
      .add_option("--alpha", flags.alpha,
                  "hamel: point of the step at which velocities are taken, 0 to 1 (default 0.5)")
      ->type_name("A");
  restrict_values(
      command.add_option(
          "--start", flags.start,
          "hamel, hamel-midpoint: apply all forces of the first node (published) or half "
          "of them (consistent) (default consistent)"),
      {"published", "consistent"});
  restrict_values(command.add_option("--solver", flags.solver,
                                     "root-finding method (default depends on the integrator)"),
                  {"newton", "feedback", "riqn"});
  command
      .add_option("--tolerance", flags.tolerance,
                  "tolerance of the iteration: |delta|_inf [rad or m] for newton, riqn, gauss and "
                  "newmark (default "
                  "1e-12), |tau_e| [Nm] for feedback (default 1e-8)")
      ->type_name("E");
  command
      .add_option("--order", flags.order,
                  "composition: 4, 6 or 8 (default 4); gauss: even, 4 to 16 (default 8)")
      ->type_name("P");
  command
      .add_option("--rtol", flags.rtol,
                  "switch on step control (dop853, gauss, rosenbrock) with this relative error per "
                  "step; --step is then "
                  "the first step, and --atol is the same number unless given")
      ->type_name("E");
  command
      .add_option("--atol", flags.atol,
                  "absolute error per step [rad or m; rad/s or m/s], with step control")
      ->type_name("E");
}

Json integrator_params(const IntegratorFlags& flags, const std::string& integrator, Json params) {
  const bool hamel = integrator == "hamel", midpoint = integrator == "hamel-midpoint";
  const auto* scheme = integration::find_scheme(integrator);
  if (scheme == nullptr) return params;  // make_integrator reports the unknown name
  if (flags.alpha) params["alpha"] = *flags.alpha;
  if (flags.alpha && !hamel) note_unused("--alpha", integrator);
  if (flags.start) params["start"] = *flags.start;
  if (flags.start && !hamel && !midpoint) note_unused("--start", integrator);
  if (flags.solver) {
    require(!scheme->solvers.empty(), "--solver", integrator);
    params["solver"] = *flags.solver;
  }
  if (flags.tolerance) {
    require(scheme->iterates, "--tolerance", integrator);
    // Each solver reads its own key.
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
