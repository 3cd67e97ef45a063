#include "actuation.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/scene/modelled.hpp"

namespace hamelin::simulation {

namespace {

using Eigen::VectorXd;

/// The controller has set what acts on the arm.
class IdealActuation final : public Actuation {
 public:
  IdealActuation(const scene::Scene& scene, SimulatedArm& plant)
      : plant_(plant),
        arm_(plant.arm()),
        step_s_(scene.step_s),
        limited_(scene::limits_in_force(scene.model, arm_.model.robot()).torque ||
                 scene.actuation.torque_rate_max_Nm_s) {
    part_ = change_ = VectorXd::Zero(arm_.model.dof());
  }

  void observe(VectorXd& q, VectorXd& v) override {
    q = plant_.node().q;
    v = plant_.node().v;
  }
  bool is_tick(long) const override { return true; }

  void take(const control::Answer& answer, bool) override {
    plant_.update_velocity();  // the half-kick that closed the last step has been mended
    saturated_ = answer.saturated;
  }
  void book(const control::Answer& answer, bool, EnergyAudit& audit) override {
    if (answer.channels == nullptr || answer.stopping) return audit.book_node(plant_, 0.0);
    const hamelin_command& command = answer.channels->raw();
    if (arm_.departure.potential) audit.note_potential();
    audit.book_node(plant_.node().k, arm_.departure.energy, command.potential_J);
    if (command.has_node_velocity == 0) return;
    const double kinetic =
        dynamics::kinetic_energy(arm_.model, arm_.ws, arm_.state.q, arm_.departure.set_v);
    audit.book_node_velocity(kinetic - arm_.departure.energy.kinetic_J, command);
  }

  bool step(double step_s) override { return plant_.make_step(step_s); }
  bool needs_answer_at_end() const override { return arm_.closes_with_kick; }
  const VectorXd& departure_velocity() const override { return arm_.departure.v; }

  void torques(const planning::CommandBuffers* answer, VectorXd& sum, Json& by_channel) override {
    sum = arm_.channels.held_torque;
    if (!sum.isZero(0.0)) by_channel[answer == nullptr ? "stop" : "held"] = to_json(sum);
    if (answer == nullptr) return;
    const auto add = [&](const char* channel, const VectorXd& torque) {
      sum += torque;
      by_channel[channel] = to_json(torque);
    };
    const VectorXd &v = plant_.node().v, &gradient = answer->potential_gradient();
    if (!gradient.isZero(0.0)) add("potential", -gradient);
    if (!answer->damping().isZero(0.0)) add("damping", -answer->damping().cwiseProduct(v));
    if (!arm_.channels.gyroscopic.empty()) {
      dynamics::gyroscopic_torque(arm_.model, arm_.ws, arm_.state.q, v, arm_.channels.gyroscopic,
                                  part_);
      add("gyroscopic", part_);
    }
    if (answer->raw().has_node_velocity != 0) {
      // The torque that would make the node's change of velocity within one step: M (x − v) / h.
      change_ = (arm_.departure.set_v - v) / step_s_;
      dynamics::momentum(arm_.model, arm_.ws, arm_.state.q, change_, part_);
      add("node", part_);
    }
  }

  bool saturated() const override { return saturated_; }
  bool limited() const override { return limited_; }

 private:
  SimulatedArm& plant_;
  control::DiscreteArm& arm_;
  double step_s_;
  bool limited_, saturated_ = false;
  VectorXd part_, change_;
};

}  // namespace

std::unique_ptr<Actuation> make_ideal_actuation(const scene::Scene& scene, SimulatedArm& arm) {
  return std::make_unique<IdealActuation>(scene, arm);
}

}  // namespace hamelin::simulation
