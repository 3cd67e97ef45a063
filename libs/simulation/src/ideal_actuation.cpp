#include <utility>

#include "actuation.hpp"
#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/torque_limits.hpp"
#include "hamelin/core/numbers.hpp"

namespace hamelin::simulation {

namespace {

using Eigen::VectorXd;

control::TorqueLimits torque_limits(const scene::Scene& scene, const model::Model& model) {
  return {model, control::modelled_limits(scene, model.robot()).effort_max,
          scene.actuation.torque_rate_max_Nm_s};
}

/// Each channel acts directly: the potential as half-kicks at both nodes of a step, damping and
/// gyroscopic terms at the step's own velocity, the node velocity at once: docs/theory.md
/// (8.1)–(8.3). With a shield, each step is tried first on a copy of the arm's state.
class IdealActuation final : public Actuation {
 public:
  IdealActuation(const scene::Scene& scene, SimulatedArm& arm)
      : arm_(arm), step_s_(scene.step_s), limits_(torque_limits(scene, arm.model)) {
    gradient_ = gradient_before_ = impulse_ = node_velocity_ = departure_ = v_next_ = zero_ =
        VectorXd::Zero(arm.model.dof());
  }

  // The closing half-kick of the last step uses the previous gradient; correct_kick() mends it,
  // docs/theory.md (8.4).
  void reach_node() override {
    if (kicked_) close_kick(arm_.state);
    arm_.update_velocity();
  }

  void reserve(std::size_t gyroscopic_terms) override {
    arm_.channels.gyroscopic.reserve(gyroscopic_terms);
  }
  // The planner of the arm with the other load starts from rest, so no half-kick is due.
  void take_load() override {
    kicked_ = false;
    gradient_.setZero();
    gradient_before_.setZero();
  }
  void observe(VectorXd& q, VectorXd& v) override {
    q = arm_.node().q;
    v = arm_.node().v;
  }
  bool asks_planner(long) const override { return true; }

  void book(const planning::CommandBuffers& answer, EnergyAudit& audit) override {
    correct_kick(answer);
    if (has_potential(answer)) audit.note_potential();
    audit.book_node(arm_, answer.raw().potential_J);
  }

  void apply(control::Controller& controller, EnergyAudit& audit) override {
    stopping_ = tried_ = false;
    const planning::CommandBuffers* const answer = controller.answer().channels;
    control::Shield* const shield = controller.shield();
    if (shield == nullptr) {
      prepare(*answer);
      book_prepared(*answer, audit);
      return;
    }
    at_node_ = arm_.state;
    v_ = arm_.node().v;
    if (answer != nullptr) {
      prepare(*answer);
      if (try_step(*shield, controller.surroundings())) return book_prepared(*answer, audit);
    } else {
      shield->refuse();
    }
    stop(*shield);
    audit.book_node(arm_, 0.0);
  }

  bool step(double step_s) override {
    if (!tried_) return arm_.step_channels(step_s);
    arm_.accept(after_, report_, step_s);
    return true;
  }
  bool needs_answer_at_end() const override { return kicked_; }
  bool stopping() const override { return stopping_; }

  const VectorXd& departure_velocity() override {
    if (!kicked_) return node_velocity_;
    arm_.integrator->velocity(arm_.state, departure_);
    return departure_;
  }

  void torques(const planning::CommandBuffers* answer, VectorXd& sum, Json& by_channel) override {
    sum = arm_.channels.held_torque;
    if (!sum.isZero(0.0)) by_channel[stopping_ ? "stop" : "held"] = to_json(sum);
    if (stopping_ || answer == nullptr) return;
    const auto add = [&](const char* channel, const VectorXd& torque) {
      sum += torque;
      by_channel[channel] = to_json(torque);
    };
    if (!gradient_.isZero(0.0)) add("potential", -gradient_);
    if (!answer->damping().isZero(0.0))
      add("damping", -answer->damping().cwiseProduct(arm_.node().v));
    if (!arm_.channels.gyroscopic.empty()) {
      dynamics::gyroscopic_torque(arm_.model, arm_.ws, arm_.state.q, arm_.node().v,
                                  arm_.channels.gyroscopic, impulse_);
      add("gyroscopic", impulse_);
    }
    if (answer->raw().has_node_velocity != 0) {
      // The torque that would make the node's change of velocity within one step: M (x − v) / h.
      departure_ = (node_velocity_ - arm_.node().v) / step_s_;
      dynamics::momentum(arm_.model, arm_.ws, arm_.state.q, departure_, impulse_);
      add("node", impulse_);
    }
  }

  bool saturated() const override { return saturated_; }
  bool limited() const override { return limits_.any(); }

 private:
  bool has_potential(const planning::CommandBuffers& answer) const {
    return answer.raw().potential_J != 0.0 || !gradient_.isZero(0.0);
  }

  void close_kick(integration::State& state) {
    impulse_ = -0.5 * step_s_ * gradient_before_;
    arm_.integrator->kick(state, impulse_);
  }

  void correct_kick(const planning::CommandBuffers& answer) {
    gradient_ = answer.potential_gradient();
    if (!kicked_) return;
    impulse_ = 0.5 * step_s_ * (gradient_before_ - gradient_);
    arm_.integrator->kick(arm_.state, impulse_);
    arm_.update_velocity();
  }

  /// Sets all channels for the next step, and keeps the node's energies for the account.
  void prepare(const planning::CommandBuffers& answer) {
    correct_kick(answer);
    energy_ = arm_.energy();
    auto& channels = arm_.channels;
    channels.held_torque = answer.held_torque();
    channels.damping = answer.damping();
    control::copy_gyroscopic_terms(answer, channels.gyroscopic);
    saturated_ = limits_.limit(arm_.ws, arm_.state.q, arm_.node().v, channels);
    node_velocity_ = arm_.node().v;
    if (answer.raw().has_node_velocity != 0) set_node_velocity(answer);
    if (arm_.own_damping.size() > 0) channels.damping += arm_.own_damping;
    const bool potential = has_potential(answer);
    if (potential) {
      impulse_ = -0.5 * step_s_ * gradient_;
      arm_.integrator->kick(arm_.state, impulse_);
    }
    gradient_before_ = gradient_;
    kicked_ = kicked_ || potential;
  }

  void set_node_velocity(const planning::CommandBuffers& answer) {
    departure_ = answer.node_velocity() - arm_.node().v;
    const double share = limits_.share_of_velocity_change(arm_.ws, arm_.state.q, departure_,
                                                          step_s_, arm_.channels.held_torque);
    if (share < 1.0) {
      saturated_ = true;
      node_velocity_ += share * departure_;
    } else {
      node_velocity_ = answer.node_velocity();
    }
    arm_.integrator->set_velocity(arm_.state, node_velocity_);
  }

  void book_prepared(const planning::CommandBuffers& answer, EnergyAudit& audit) {
    if (has_potential(answer)) audit.note_potential();
    audit.book_node(arm_.node().k, energy_, answer.raw().potential_J);
    if (answer.raw().has_node_velocity == 0) return;
    const double kinetic =
        dynamics::kinetic_energy(arm_.model, arm_.ws, arm_.state.q, node_velocity_);
    audit.book_node_velocity(kinetic - energy_.kinetic_J, answer.raw());
  }

  /// Makes the step on a copy. @return whether the shield accepts it
  bool try_step(control::Shield& shield, const control::Shield::Surroundings& world) {
    after_ = arm_.state;
    report_ = arm_.integrator->step(after_, arm_.channels, step_s_);
    if (!report_.converged) {
      shield.refuse();
      return false;
    }
    if (kicked_) {
      // as reach_node() will do
      at_next_ = after_;
      close_kick(at_next_);
      arm_.integrator->velocity(at_next_, v_next_);
    } else {
      arm_.integrator->velocity(after_, v_next_);
    }
    const control::Shield::Node from{at_node_.q, v_}, to{after_.q, v_next_};
    tried_ = shield.accept(world, {from, departure_velocity(), to, zero_, zero_, zero_});
    return tried_;
  }

  /// Lets the shield's stop act instead, from the node as it was verified.
  void stop(control::Shield& shield) {
    arm_.state = at_node_;
    arm_.update_velocity();
    auto& channels = arm_.channels;
    channels.gyroscopic.clear();
    if (arm_.own_damping.size() > 0)
      channels.damping = arm_.own_damping;
    else
      channels.damping.setZero();
    shield.stop().torque({at_node_.q, v_}, zero_, zero_, channels.held_torque);
    gradient_.setZero();
    gradient_before_.setZero();
    node_velocity_ = v_;
    kicked_ = saturated_ = false;
    stopping_ = true;
  }

  SimulatedArm& arm_;
  double step_s_;
  control::TorqueLimits limits_;
  VectorXd gradient_, gradient_before_, impulse_, departure_;
  VectorXd node_velocity_;      ///< the node's velocity after limits
  integration::Energy energy_;  ///< of the node
  bool kicked_ = false;         ///< whether a closing half-kick is due
  bool saturated_ = false;

  // with a shield
  integration::State at_node_, after_, at_next_;
  VectorXd v_, v_next_, zero_;
  integration::StepReport report_;
  bool tried_ = false;     ///< whether after_ is the accepted next state
  bool stopping_ = false;  ///< whether a stop acts
};

}  // namespace

std::unique_ptr<Actuation> make_ideal_actuation(const scene::Scene& scene, SimulatedArm& arm) {
  return std::make_unique<IdealActuation>(scene, arm);
}

}  // namespace hamelin::simulation
