#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/simulation/integrator_options.hpp"
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
  motion.options = integrator_options(scene.integrator.params, scene.name + ": /integrator/params");
  motion.damping = plant_damping(scene, model.robot());
  motion.coulomb = plant_friction(scene, model.robot());
  motion.coulomb_speed = scene.model.friction_speed;
  motion.config = resolved_config(scene);
  motion.inputs = inputs_of(scene);
  return motion;
}

namespace {

// How many lines a log may get where step control chooses: by the first step, for want of better.
long first_steps_in(double duration_s, double step_s) {
  if (!(step_s > 0.0) || !(duration_s > 0.0) || !std::isfinite(duration_s) || !std::isfinite(step_s))
    throw Error(ErrorCode::usage,
                fmt::format("step {} s and duration {} s: both must be positive and finite", step_s, duration_s));
  return static_cast<long>(std::min(std::ceil(duration_s / step_s), 1e10));
}

// An unconverged state is never used: the result stands at the node before.
std::string what_failed(const FreeMotion& motion, const integration::Integrator& integrator, long step) {
  if (integrator.adaptive()) return fmt::format("step {}: no length of it meets the tolerances", step);
  const auto* scheme = integration::find_scheme(motion.integrator);
  if (scheme->solvers.empty() && !scheme->iterates)
    return fmt::format("step {} of {} s left the finite numbers", step, motion.step_s);
  return fmt::format("step {} of {} s found no root, halved down to {:.3g} s", step, motion.step_s,
                     motion.step_s / static_cast<double>(1 << integrator.max_halvings()));
}

}  // namespace

log::Result integrate(const model::Model& model, const FreeMotion& motion, const Watch& watch) {
  const auto sized = [&](const Eigen::VectorXd& x, const char* what) {
    if (x.size() != model.dof() || !x.allFinite())
      throw Error(ErrorCode::usage,
                  fmt::format("{}: {} numbers given, expected {} finite ones", what, x.size(), model.dof()));
  };
  sized(motion.q0, "q0");
  sized(motion.v0, "v0");
  const auto integrator = integration::make_integrator(motion.integrator, model, motion.options);
  const bool controlled = integrator->adaptive();  // then any duration will do
  const long steps =
      controlled ? first_steps_in(motion.duration_s, motion.step_s) : step_count(motion.duration_s, motion.step_s);

  log::Result result;
  result.scene = motion.name;
  result.warnings = model::warnings(model.robot());
  result.provenance = log::provenance(motion.inputs, watch.argv);
  Recorder recorder(result, watch, *integrator);
  recorder.header({{"program", "integrate"},
                   {"scene", motion.name},
                   {"config", motion.config},
                   {"robot_notes", model.robot().notes},
                   {"provenance", result.provenance}},
                  model.robot(), steps);

  integration::Channels channels;
  channels.damping = motion.damping;
  channels.coulomb = motion.coulomb;
  channels.coulomb_speed = motion.coulomb_speed;
  integration::State state = integrator->start(motion.q0, motion.v0);
  if (controlled) state.step_next = motion.step_s;
  integration::StepReport report;
  Eigen::VectorXd v(model.dof());
  Ledger ledger;
  bool finished = false;
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
    const bool arrived = controlled ? state.time_s == motion.duration_s : state.k == steps;
    const bool over = arrived || recorder.stopped(state.k);
    if (recorder.logging()) {  // the velocity costs a sweep, and nothing else here asks for it
      integrator->velocity(state, v);
      recorder.observe(std::numeric_limits<double>::infinity(), true, v, state.k > 0 ? report.step_s : motion.step_s);
      if (recorder.wants_tick(state.k) || over) log_tick();
    }
    finished = arrived;
    if (over) break;
    const double left = motion.duration_s - state.time_s;
    report = controlled ? integrator->advance(state, channels, left) : integrator->step(state, channels, motion.step_s);
    if (!controlled)
      state.time_s = static_cast<double>(state.k) * motion.step_s;
    else if (report.step_s == left)
      state.time_s = motion.duration_s;
    recorder.step(report);
    ledger.book(report);
    recorder.progress(state.k, state.time_s, motion.duration_s);
    if (!report.converged) {
      result.outcome = log::Outcome::diverged;
      result.cause = what_failed(motion, *integrator, state.k + 1);
      if (recorder.logging()) log_tick();
      break;
    }
  }
  if (result.outcome == log::Outcome::completed && !finished) result.outcome = log::Outcome::interrupted;
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
