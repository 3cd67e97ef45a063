#include <fmt/format.h>

#include <limits>

#include "hamelin/core/error.hpp"
#include "plant.hpp"
#include "recorder.hpp"

namespace hamelin::simulation {

FreeMotion free_motion(const scene::Scene& given, const model::Model& model) {
  scene::Scene scene = given;
  scene.planner.reset();
  scene.stall.reset();
  scene.goals.clear();
  scene.map.reset();
  scene.obstacles.clear();
  scene.actuation = {};
  scene.actuation.control_period_s = scene.step_s;
  FreeMotion motion;
  motion.name = scene.name;
  motion.q0 = scene.start_q.size() > 0 ? scene.start_q : Eigen::VectorXd::Zero(model.dof());
  motion.v0 = scene.start_v.size() > 0 ? scene.start_v : Eigen::VectorXd::Zero(model.dof());
  motion.step_s = scene.step_s;
  motion.duration_s = scene.duration_s;
  motion.integrator = scene.integrator.name;
  motion.options = integration::options_from_json(scene.integrator.params, scene.name + ": /integrator/params");
  motion.damping = plant_damping(scene, model.robot());
  motion.config = resolved_config(scene);
  motion.inputs = inputs_of(scene);
  return motion;
}

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
  result.provenance = log::provenance(motion.inputs, watch.argv);
  Recorder recorder(result, watch, *integrator, motion.options, 0);
  recorder.header({{"program", "integrate"},
                   {"scene", motion.name},
                   {"config", motion.config},
                   {"robot_notes", model.robot().notes},
                   {"provenance", result.provenance}},
                  model.robot(), steps);

  integration::Channels channels;
  channels.damping = motion.damping;
  integration::State state = integrator->start(motion.q0, motion.v0);
  integration::StepReport report;
  Eigen::VectorXd v(model.dof());
  Ledger ledger;
  const auto log_tick = [&] {
    recorder.tick(state.k, {{"k", state.k},
                            {"time_s", state.time_s},
                            {"q", to_json(state.q)},
                            {"v", to_json(v)},
                            {"energy", energy_json(ledger)},
                            {"solver", solver_json(report)}});
    recorder.write_waiting_tick();
  };
  for (;;) {
    const auto energy = integrator->energy(state);
    ledger.kinetic = energy.kinetic_J;
    ledger.potential = energy.potential_J;
    recorder.node(ledger);
    const bool over = state.k == steps || recorder.stopped(state.k);
    if (recorder.logging()) {  // the velocity costs a sweep, and nothing else here asks for it
      integrator->velocity(state, v);
      recorder.observe(std::numeric_limits<double>::infinity(), true, v, motion.step_s);
      if (recorder.wants_tick(state.k) || over) log_tick();
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
      if (recorder.logging()) log_tick();
      break;
    }
  }
  if (result.outcome == log::Outcome::completed && state.k < steps) result.outcome = log::Outcome::interrupted;
  result.time_s = state.time_s;
  result.steps = state.k;
  result.q = state.q;
  integrator->velocity(state, v);
  result.v = v;
  // not looked at without a log, so not with one either
  for (auto* largest : {&result.v_abs_max, &result.a_abs_max, &result.jerk_abs_max}) largest->resize(0);
  recorder.close(ledger);
  return result;
}

}  // namespace hamelin::simulation
