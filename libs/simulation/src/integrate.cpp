#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/simulation/integrator_options.hpp"
#include "recorder.hpp"
#include "scene_values.hpp"
#include "wrench_feed.hpp"

namespace hamelin::simulation {

FreeMotion free_motion(const scene::Scene& given, const model::Model& model) {
  scene::Scene scene = given;
  scene.planner.reset();
  scene.stall.reset();
  scene.goals.clear();
  scene.map.reset();
  scene.obstacles.clear();
  scene.actuation = {};
  scene.plant = scene::PlantType::hamelin;
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
  motion.wrenches = scene.wrenches;
  motion.config = resolved_config(scene);
  motion.inputs = inputs_of(scene);
  return motion;
}

namespace {

// Under step control the number of log lines is unknown. It is estimated by the first step.
long first_steps_in(double duration_s, double step_s) {
  if (!(step_s > 0.0) || !(duration_s > 0.0) || !std::isfinite(duration_s) ||
      !std::isfinite(step_s))
    throw Error(ErrorCode::usage,
                fmt::format("step {} s and duration {} s: both must be positive and finite", step_s,
                            duration_s));
  return static_cast<long>(std::min(std::ceil(duration_s / step_s), 1e10));
}

// A state that did not converge is never used; the result is that of the node before.
std::string failure_cause(const FreeMotion& motion, const integration::Integrator& integrator,
                          long step) {
  if (integrator.adaptive())
    return fmt::format("step {}: no step length meets the tolerances", step);
  const auto* scheme = integration::find_scheme(motion.integrator);
  if (scheme->solvers.empty() && !scheme->iterates)
    return fmt::format("step {} of {} s: the state is no longer finite", step, motion.step_s);
  return fmt::format("step {} of {} s found no root, halved down to {:.3g} s", step, motion.step_s,
                     motion.step_s / static_cast<double>(1 << integrator.max_halvings()));
}

/// One free motion from its first node to its last: each node is observed, then a step is made.
class FreeRun {
 public:
  FreeRun(const model::Model& model, const FreeMotion& motion, const Watch& watch);
  log::Result run();

 private:
  void write_header(const Watch& watch);
  [[nodiscard]] bool finished() const {
    return controlled_ ? state_.time_s == motion_.duration_s : state_.k == steps_;
  }
  /// Books the node's energy and writes its line in the log. The last node is always written.
  void observe_node(bool last);
  void log_tick();
  /// Makes one step. If it finds no root, the state is unchanged and the result says what failed.
  bool step();
  void close();

  const model::Model& model_;
  const FreeMotion& motion_;
  const std::unique_ptr<integration::Integrator> integrator_;
  const bool controlled_;  ///< under step control any duration is allowed
  const long steps_;
  log::Result result_;
  Recorder recorder_;
  integration::Channels channels_;
  std::unique_ptr<WrenchFeed> wrenches_;  ///< null: there are none
  integration::State state_;
  integration::StepReport report_;
  Eigen::VectorXd v_;
  Ledger ledger_;
};

FreeRun::FreeRun(const model::Model& model, const FreeMotion& motion, const Watch& watch)
    : model_(model),
      motion_(motion),
      integrator_(integration::make_integrator(motion.integrator, model, motion.options)),
      controlled_(integrator_->adaptive()),
      steps_(controlled_ ? first_steps_in(motion.duration_s, motion.step_s)
                         : step_count(motion.duration_s, motion.step_s)),
      recorder_(result_, watch, integrator_->name(), integrator_->criterion(),
                integrator_->tolerance()),
      state_(integrator_->start(motion.q0, motion.v0)),
      v_(model.dof()) {
  channels_.damping = motion.damping;
  channels_.coulomb = motion.coulomb;
  channels_.coulomb_speed = motion.coulomb_speed;
  if (!motion.wrenches.empty())
    wrenches_ = std::make_unique<WrenchFeed>(motion.wrenches, model, motion.name + ": /wrenches");
  if (controlled_) state_.step_next = motion.step_s;
  report_.step_s = motion.step_s;  // for the observation of the first node
  write_header(watch);
}

void FreeRun::write_header(const Watch& watch) {
  result_.scene = motion_.name;
  result_.warnings = model_.robot().warnings;
  result_.provenance = log::provenance(motion_.inputs, watch.argv);
  recorder_.header({{"program", "integrate"},
                    {"scene", motion_.name},
                    {"config", motion_.config},
                    {"robot_notes", model_.robot().notes},
                    {"provenance", result_.provenance}},
                   model_.robot(), steps_);
}

log::Result FreeRun::run() {
  for (;;) {
    const bool last = finished() || recorder_.stopped(state_.k);
    observe_node(last);
    if (last || !step()) break;
  }
  close();
  return std::move(result_);
}

void FreeRun::observe_node(bool last) {
  const auto energy = integrator_->energy(state_);
  ledger_.kinetic = energy.kinetic_J;
  ledger_.potential = energy.potential_J;
  recorder_.node(ledger_);
  if (!recorder_.logging()) return;  // the velocity costs a sweep and is needed for the log only
  integrator_->velocity(state_, v_);
  recorder_.observe(infinity, true, v_, report_.step_s);
  if (recorder_.wants_tick(state_.k) || last) log_tick();
}

void FreeRun::log_tick() {
  recorder_.tick(state_.k, {{"k", state_.k},
                            {"time_s", state_.time_s},
                            {"q", to_json(state_.q)},
                            {"v", to_json(v_)},
                            {"energy", energy_json(ledger_)},
                            {"solver", solver_json(report_)}});
  recorder_.write_waiting_tick();
}

bool FreeRun::step() {
  if (wrenches_ && wrenches_->advance(state_.time_s)) channels_.wrenches = wrenches_->active();
  const double left = motion_.duration_s - state_.time_s;
  report_ = controlled_ ? integrator_->advance(state_, channels_, left)
                        : integrator_->step(state_, channels_, motion_.step_s);
  if (!controlled_)
    state_.time_s = static_cast<double>(state_.k) * motion_.step_s;
  else if (report_.step_s == left)
    state_.time_s = motion_.duration_s;
  recorder_.step(report_);
  ledger_.book(report_, false);
  recorder_.progress(state_.k, state_.time_s, motion_.duration_s);
  if (report_.converged) return true;
  result_.outcome = log::Outcome::diverged;
  result_.cause = failure_cause(motion_, *integrator_, state_.k + 1);
  if (recorder_.logging()) log_tick();
  return false;
}

void FreeRun::close() {
  if (result_.outcome == log::Outcome::completed && !finished())
    result_.outcome = log::Outcome::interrupted;
  result_.time_s = state_.time_s;
  result_.steps = state_.k;
  result_.q = state_.q;
  integrator_->velocity(state_, v_);
  result_.v = v_;
  // Without a log these are not observed, so results with a log leave them out, too.
  for (auto* largest : {&result_.v_abs_max, &result_.a_abs_max, &result_.jerk_abs_max})
    largest->resize(0);
  recorder_.close(ledger_);
}

}  // namespace

log::Result integrate(const model::Model& model, const FreeMotion& motion, const Watch& watch) {
  const auto sized = [&](const Eigen::VectorXd& x, const char* what) {
    if (x.size() != model.dof() || !x.allFinite())
      throw Error(ErrorCode::usage, fmt::format("{}: {} values given, expected {} finite ones",
                                                what, x.size(), model.dof()));
  };
  sized(motion.q0, "q0");
  sized(motion.v0, "v0");
  return FreeRun(model, motion, watch).run();
}

}  // namespace hamelin::simulation
