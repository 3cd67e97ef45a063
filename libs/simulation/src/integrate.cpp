#include <fmt/format.h>

#include "hamelin/core/error.hpp"
#include "recorder.hpp"

namespace hamelin::simulation {

log::Result integrate(const model::Model& model, const FreeMotion& motion, const Watch& watch) {
  const auto sized = [&](const Eigen::VectorXd& x, const char* what) {
    if (x.size() != model.dof() || !x.allFinite())
      throw Error(ErrorCode::usage,
                  fmt::format("{}: {} numbers given, expected {} finite ones", what, x.size(), model.dof()));
  };
  sized(motion.q0, "q0");
  sized(motion.v0, "v0");
  const long steps = step_count(motion.duration_s, motion.step_s);
  const auto integrator = integration::make_integrator(motion.integrator, model, motion.options);

  log::Result result;
  result.scene = motion.name;
  result.provenance = motion.provenance;
  Recorder recorder(result, watch, *integrator, motion.options, 0);
  recorder.header({{"config",
                    {{"q0", to_json(motion.q0)},
                     {"v0", to_json(motion.v0)},
                     {"step_s", motion.step_s},
                     {"duration_s", motion.duration_s},
                     {"integrator", integrator->name()}}},
                   {"provenance", motion.provenance}});

  integration::Channels channels;
  channels.damping = motion.damping;
  integration::State state = integrator->start(motion.q0, motion.v0);
  integration::StepReport report;
  Eigen::VectorXd v(model.dof());
  Ledger ledger;
  for (;;) {
    const auto energy = integrator->energy(state);
    ledger.kinetic = energy.kinetic_J;
    ledger.potential = energy.potential_J;
    recorder.node(ledger);
    const bool over = state.k == steps || !report.converged || recorder.stopped();
    if (recorder.wants_tick(state.k) || (over && recorder.logging())) {
      integrator->velocity(state, v);
      recorder.tick(state.k, {{"k", state.k},
                              {"time_s", state.time_s},
                              {"q", to_json(state.q)},
                              {"v", to_json(v)},
                              {"energy", energy_json(ledger)},
                              {"solver", solver_json(report)}});
    }
    if (over) break;
    report = integrator->step(state, channels, motion.step_s);
    state.time_s = static_cast<double>(state.k) * motion.step_s;
    recorder.step(report);
    ledger.book(report);
    recorder.progress(state.k, state.time_s, motion.duration_s);
    if (!report.converged) {
      // An unconverged state is never used: the result stands at the node before.
      result.outcome = log::Outcome::diverged;
      result.cause = fmt::format("step {} of {} s found no root, halved down to {:.3g} s", state.k + 1, motion.step_s,
                                 motion.step_s / static_cast<double>(1 << motion.options.max_halvings));
      break;
    }
  }
  if (result.outcome == log::Outcome::completed && state.k < steps) result.outcome = log::Outcome::interrupted;
  result.time_s = state.time_s;
  result.steps = state.k;
  result.q = state.q;
  integrator->velocity(state, v);
  result.v = v;
  recorder.close(ledger);
  return result;
}

}  // namespace hamelin::simulation
