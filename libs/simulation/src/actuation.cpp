#include "actuation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "plant.hpp"

namespace hamelin::simulation {

namespace {

using Eigen::VectorXd;

control::TorqueLimits torque_limits(const scene::Scene& scene, const model::Model& model) {
  return {model,
          scene.model.torque_limits
              ? control::joint_limits(model.robot(), &model::Joint::effort_max, infinity)
              : VectorXd(),
          scene.actuation.torque_rate_max_Nm_s};
}

/// Each channel acts directly: the potential as half-kicks at both nodes of a step, damping and
/// gyroscopic terms at the step's own velocity, the node velocity at once: docs/theory.md
/// (8.1)–(8.3).
class IdealActuation final : public Actuation {
 public:
  IdealActuation(const scene::Scene& scene, const model::Model& model)
      : step_s_(scene.step_s), limits_(torque_limits(scene, model)) {
    gradient_ = gradient_before_ = impulse_ = node_velocity_ = departure_ =
        VectorXd::Zero(model.dof());
  }

  // The closing half-kick of the last step uses the previous gradient; book() corrects it,
  // docs/theory.md (8.4).
  void reach_node(SimulatedArm& arm) override {
    if (kicked_) {
      impulse_ = -0.5 * step_s_ * gradient_before_;
      arm.integrator->kick(arm.state, impulse_);
    }
    arm.integrator->velocity(arm.state, arm.v);
  }

  bool asks_planner(long) const override { return true; }

  void book(SimulatedArm& arm, const planning::CommandBuffers& answer,
            EnergyAudit& audit) override {
    gradient_ = answer.potential_gradient();
    if (kicked_) {
      impulse_ = 0.5 * step_s_ * (gradient_before_ - gradient_);
      arm.integrator->kick(arm.state, impulse_);
      arm.integrator->velocity(arm.state, arm.v);
    }
    if (has_potential(answer)) audit.note_potential();
    audit.book_node(arm, answer.raw().potential_J);
  }

  void apply(SimulatedArm& arm, const control::Answer& decided, EnergyAudit& audit) override {
    const planning::CommandBuffers& answer = *decided.channels;
    auto& channels = arm.channels;
    channels.held_torque = answer.held_torque();
    channels.damping = answer.damping();
    control::copy_gyroscopic_terms(answer, channels.gyroscopic);
    saturated_ = limits_.limit(arm.ws, arm.state.q, arm.v, channels);
    node_velocity_ = arm.v;
    if (answer.raw().has_node_velocity != 0) set_node_velocity(arm, answer, audit);
    if (arm.own_damping.size() > 0) channels.damping += arm.own_damping;
    const bool potential = has_potential(answer);
    if (potential) {
      impulse_ = -0.5 * step_s_ * gradient_;
      arm.integrator->kick(arm.state, impulse_);
    }
    gradient_before_ = gradient_;
    kicked_ = kicked_ || potential;
  }

  bool needs_answer_at_end() const override { return kicked_; }

  const VectorXd& departure_velocity(SimulatedArm& arm) override {
    if (!kicked_) return node_velocity_;
    arm.integrator->velocity(arm.state, departure_);
    return departure_;
  }

  void torques(SimulatedArm& arm, const planning::CommandBuffers& answer, VectorXd& sum,
               Json& by_channel) override {
    sum = arm.channels.held_torque;
    if (!sum.isZero(0.0)) by_channel["held"] = to_json(sum);
    const auto add = [&](const char* channel, const VectorXd& torque) {
      sum += torque;
      by_channel[channel] = to_json(torque);
    };
    if (!gradient_.isZero(0.0)) add("potential", -gradient_);
    if (!answer.damping().isZero(0.0)) add("damping", -answer.damping().cwiseProduct(arm.v));
    if (!arm.channels.gyroscopic.empty()) {
      dynamics::gyroscopic_torque(arm.model, arm.ws, arm.state.q, arm.v, arm.channels.gyroscopic,
                                  impulse_);
      add("gyroscopic", impulse_);
    }
    if (answer.raw().has_node_velocity != 0) {
      // The torque that would make the node's change of velocity within one step: M (x − v) / h.
      departure_ = (node_velocity_ - arm.v) / step_s_;
      dynamics::momentum(arm.model, arm.ws, arm.state.q, departure_, impulse_);
      add("node", impulse_);
    }
  }

  bool saturated() const override { return saturated_; }
  bool limited() const override { return limits_.any(); }

 private:
  bool has_potential(const planning::CommandBuffers& answer) const {
    return answer.raw().potential_J != 0.0 || !gradient_.isZero(0.0);
  }

  void set_node_velocity(SimulatedArm& arm, const planning::CommandBuffers& answer,
                         EnergyAudit& audit) {
    departure_ = answer.node_velocity() - arm.v;
    const double share = limits_.share_of_velocity_change(arm.ws, arm.state.q, departure_, step_s_,
                                                          arm.channels.held_torque);
    if (share < 1.0) {
      saturated_ = true;
      node_velocity_ += share * departure_;
    } else {
      node_velocity_ = answer.node_velocity();
    }
    arm.integrator->set_velocity(arm.state, node_velocity_);
    const double kinetic = dynamics::kinetic_energy(arm.model, arm.ws, arm.state.q, node_velocity_);
    audit.book_node_velocity(kinetic - audit.ledger().kinetic, answer.raw());
  }

  double step_s_;
  control::TorqueLimits limits_;
  VectorXd gradient_, gradient_before_, impulse_, departure_;
  VectorXd node_velocity_;  ///< the node's velocity after limits
  bool kicked_ = false;     ///< whether a closing half-kick is due
  bool saturated_ = false;
};

/// A sampled controller: the torque of a tick acts `delay` periods later and is held for a period,
/// docs/theory.md (8.7).
class SampledActuation final : public Actuation {
 public:
  SampledActuation(const scene::Scene& scene, SimulatedArm& arm, long period_steps,
                   long delay_periods)
      : period_steps_(period_steps),
        limited_(scene.model.torque_limits || scene.actuation.torque_rate_max_Nm_s) {
    // Until the first torque arrives the arm is held against gravity.
    VectorXd torque = VectorXd::Zero(arm.model.dof());
    dynamics::gravity_torque(arm.model, arm.ws, arm.state.q, torque);
    delayed_.assign(static_cast<std::size_t>(delay_periods) + 1, torque);
  }

  void reach_node(SimulatedArm& arm) override { arm.integrator->velocity(arm.state, arm.v); }
  bool asks_planner(long k) const override { return k % period_steps_ == 0; }

  void book(SimulatedArm& arm, const planning::CommandBuffers&, EnergyAudit& audit) override {
    audit.book_node(arm, 0.0);
  }

  void apply(SimulatedArm& arm, const control::Answer& decided, EnergyAudit& audit) override {
    if (!asks_planner(arm.state.k)) return;
    const long tick = arm.state.k / period_steps_;
    slot(tick) = decided.torque;
    if (decided.channels->raw().has_node_velocity != 0) audit.book_filter(decided.channels->raw());
    saturated_ = decided.saturated;
    if (tick > 0) change_.add((decided.torque - slot(tick - 1)).lpNorm<Eigen::Infinity>());
    // The next slot of the ring was written `delay` ticks ago.
    arm.channels.held_torque = slot(tick + 1);
  }

  bool needs_answer_at_end() const override { return false; }
  const log::TorqueChange* torque_change() const override { return &change_; }
  const VectorXd& departure_velocity(SimulatedArm& arm) override { return arm.v; }

  void torques(SimulatedArm& arm, const planning::CommandBuffers&, VectorXd& sum,
               Json& by_channel) override {
    sum = arm.channels.held_torque;
    if (!sum.isZero(0.0)) by_channel["held"] = to_json(sum);
  }

  bool saturated() const override { return saturated_; }
  bool limited() const override { return limited_; }

 private:
  VectorXd& slot(long tick) { return delayed_[static_cast<std::size_t>(tick) % delayed_.size()]; }

  long period_steps_;
  bool limited_;
  std::vector<VectorXd> delayed_;
  log::TorqueChange change_;
  bool saturated_ = false;
};

long integer_multiple(double value, double unit, const std::string& where, const char* what) {
  const double count = std::round(value / unit);
  if (std::abs(value / unit - count) > 1e-9 * std::max(1.0, count))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: /actuation/{}: {} s is not an integer multiple of {} s", where,
                            what, value, unit));
  return static_cast<long>(count);
}

}  // namespace

long steps_per_tick(const scene::Scene& scene) {
  if (scene.actuation.type == scene::ActuationType::ideal) return 1;
  return std::max(1L, integer_multiple(scene.actuation.control_period_s, scene.step_s, scene.name,
                                       "control_period_s"));
}

std::unique_ptr<Actuation> make_actuation(const scene::Scene& scene, SimulatedArm& arm) {
  if (scene.actuation.type == scene::ActuationType::ideal)
    return std::make_unique<IdealActuation>(scene, arm.model);
  const long period_steps = steps_per_tick(scene);
  const long delay = integer_multiple(scene.actuation.delay_s, scene.actuation.control_period_s,
                                      scene.name, "delay_s");
  return std::make_unique<SampledActuation>(scene, arm, period_steps, delay);
}

}  // namespace hamelin::simulation
