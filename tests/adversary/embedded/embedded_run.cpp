#include "embedded_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <utility>

#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "shield/shield.hpp"

namespace hamelin::test {

using Eigen::VectorXd;

namespace {

constexpr double period_s = 0.001;
// Over more ticks without a measurement, what an estimated velocity lacks takes the prediction
// farther away than the margins for straying cover.
constexpr int blind_max_of_estimates = 10;

/// What a seed chooses.
struct Choice {
  scene::Scene scene;
  control::Controller::Options options;
  std::size_t delay_periods = 0;
  double lag_s = 0.0;
};

// A library is loaded once.
planning::Plugin plugin_of(const std::string& name) {
  static std::mutex mutex;
  static std::map<std::string, planning::Plugin> loaded;
  const std::lock_guard lock(mutex);
  const auto found = loaded.find(name);
  if (found != loaded.end()) return found->second;
  return loaded
      .emplace(name,
               planning::find_plugin(name, {HAMELIN_TEST_PLUGIN_DIR, HAMELIN_TEST_ONLY_PLUGIN_DIR}))
      .first->second;
}

// Servos that lag stray from the path of their set points by a L²/2 at an acceleration a.
void choose_drive(Choice& choice, bool position, Rng& rng) {
  scene::Actuation& actuation = choice.scene.actuation;
  actuation.type = scene::ActuationType::sampled;
  actuation.control_period_s = choice.scene.step_s = period_s;
  choice.options.position = position;
  // for planners that are told of velocities, they may be those of an estimator
  actuation.estimates_velocity = rng.below(4) == 0;
  if (!position) {
    choice.delay_periods = rng.below(2);
    actuation.delay_s = period_s * static_cast<double>(choice.delay_periods);
    if (rng.below(2) == 0) actuation.torque_rate_max_Nm_s = rng.uniform(1000.0, 4000.0);
    return;
  }
  if (rng.below(2) == 0) return;
  choice.lag_s = rng.uniform(0.002, 0.01);
  choice.scene.safety.tracking_rad =
      2e-4 + choice.options.acceleration_max.front() * choice.lag_s * choice.lag_s;
}

Choice choose(const EmbeddedRun& run, Rng& rng) {
  static constexpr std::array names{"clutter", "shelf", "shelf_carry", "pillar"};
  const std::filesystem::path folder = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/scenes";
  Choice out;
  out.scene = scene::read_scene(folder / (std::string(names[rng.below(names.size())]) + ".json"));
  scene::Scene& scene = out.scene;
  scene.seed = run.seed;
  scene.events.clear();
  scene.stall.reset();
  const bool attacks = rng.below(5) != 0;
  scene.planner = scene::Choice{attacks ? "adversary" : "hybrid", Json::object()};
  scene.model.joint_limits = scene.model.velocity_limits = scene.model.torque_limits = true;
  scene.model.self_collision = rng.below(2) == 0;
  if (!run.shielded) scene.safety.type = scene::SafetyType::none;
  control::Controller::Options& options = out.options;
  options.obstacles_max = 16;
  options.certify = false;
  options.payload_reach_m = 0.3;
  options.payload_shapes_max = 16;
  options.clock_s = Disturbances::clock_s;
  options.log_overrun = false;
  choose_drive(out, run.position, rng);
  return out;
}

/// The loop of a run.
class Loop {
 public:
  Loop(const EmbeddedRun& run, Rng& rng, Choice choice);
  EmbeddedReport run();

 private:
  void tick(int k);
  std::unique_ptr<Arm> make_arm() const;
  Bounds bounds() const;
  void note_shield(const std::string& at);
  void explain();

  const EmbeddedRun& run_;
  Choice choice_;
  model::Model bare_;
  planning::Plugin plugin_;
  control::Controller controller_;
  std::unique_ptr<Arm> arm_;
  Judge judge_;
  Disturbances disturbances_;
  EmbeddedReport report_;
};

Loop::Loop(const EmbeddedRun& run, Rng& rng, Choice choice)
    : run_(run),
      choice_(std::move(choice)),
      bare_(control::load_model(choice_.scene)),
      plugin_(plugin_of(choice_.scene.planner->name)),
      controller_(choice_.scene, bare_, plugin_, choice_.options),
      arm_(make_arm()),
      judge_(bounds(), bare_, choice_.scene.model.self_collision),
      disturbances_(controller_, *arm_, bare_, choice_.scene.map.has_value(), rng.next()) {}

std::unique_ptr<Arm> Loop::make_arm() const {
  if (run_.position)
    return std::make_unique<ServoArm>(choice_.scene.start_q, period_s, choice_.lag_s);
  return std::make_unique<TorqueArm>(bare_, choice_.scene.start_q, period_s, choice_.delay_periods);
}

Bounds Loop::bounds() const {
  return {control::modelled_limits(choice_.scene, bare_.robot()),
          choice_.scene.actuation.torque_rate_max_Nm_s,
          run_.position,
          choice_.options.acceleration_max.front(),
          choice_.options.jerk_max.front(),
          period_s};
}

void Loop::note_shield(const std::string& at) {
  const control::Shield* const shield = controller_.shield();
  if (shield == nullptr) return explain();
  report_.overtaken = std::max(report_.overtaken, shield->counts().overtaken);
  report_.strayed_share = std::max(report_.strayed_share, shield->counts().strayed_share);
  const bool predicted = choice_.scene.actuation.estimates_velocity &&
                         disturbances_.longest_blind() > blind_max_of_estimates;
  if (!predicted) judge_.check_straying(shield->counts().strayed_share, at);
  explain();
}

// What a seed chose, and what was done before the fault.
void Loop::explain() {
  while (report_.findings.size() < judge_.findings().size())
    report_.findings.push_back(fmt::format(
        "{} ({}, {}, delay {}, rate {:.0f}, estimates {}, lag {:.4f} s, self {}, overtaken {}; {})",
        judge_.findings()[report_.findings.size()],
        std::filesystem::path(choice_.scene.name).stem().string(), plugin_.name(),
        choice_.delay_periods, choice_.scene.actuation.torque_rate_max_Nm_s.value_or(0.0),
        choice_.scene.actuation.estimates_velocity, choice_.lag_s,
        choice_.scene.model.self_collision, report_.overtaken, disturbances_.trail()));
}

void Loop::tick(int k) {
  const double time_s = period_s * k;
  const std::string at =
      fmt::format("seed {} {} tick {}", run_.seed, run_.position ? "position" : "torque", k);
  if (disturbances_.disturb(time_s)) judge_.expect_start(arm_->q());
  const Measurement measured = disturbances_.measure(time_s);
  const control::Shield* const shield = controller_.shield();
  const control::Answer& answer = controller_.tick(measured.time_s, measured.q, measured.v);
  const bool stops = answer.state == control::ControlState::stopping;
  if (disturbances_.resumes() && (controller_.shield() != shield || !stops))
    judge_.expect_resumption(arm_->q(), choice_.scene.actuation.estimates_velocity
                                            ? VectorXd(VectorXd::Zero(bare_.dof()))
                                            : arm_->v());
  if (const auto model = disturbances_.take_load()) {
    arm_->carry(*model);
    judge_.set_arm(*model);
  }
  judge_.check_output(answer, at);
  ++report_.ticks;
  if (stops || answer.stopping) ++report_.stopping;
  const VectorXd q = arm_->q(), v = arm_->v();
  const auto world = controller_.world().latest();
  arm_->step(answer);
  judge_.check_motion(q, v, arm_->q(), arm_->v(), *world, time_s, at);
  report_.path += (arm_->q() - q).lpNorm<Eigen::Infinity>();
  note_shield(at);
}

EmbeddedReport Loop::run() {
  for (int k = 0; k < run_.ticks && report_.unstarted.empty(); ++k) {
    try {
      tick(k);
    } catch (const Error& e) {
      if (k == 0) throw;
      report_.unstarted = e.what();
    }
  }
  report_.events = disturbances_.events();
  report_.least_clearance_m = judge_.least_clearance_m();
  for (std::size_t i = 0; i < faults; ++i) report_.counts[i] = judge_.count(static_cast<Fault>(i));
  return report_;
}

}  // namespace

EmbeddedReport run_embedded(const EmbeddedRun& run) {
  Rng rng(run.seed * 2 + (run.position ? 1 : 0));
  return Loop(run, rng, choose(run, rng)).run();
}

}  // namespace hamelin::test
