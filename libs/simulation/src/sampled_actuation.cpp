#include "actuation.hpp"

#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/scene/modelled.hpp"
#include "scene_values.hpp"

namespace hamelin::simulation {

namespace {

using Eigen::VectorXd;

/// Values that arrive a number of ticks after they were sent.
template <class T>
class DelayLine {
 public:
  /// @param first arrives until the first value that is sent
  DelayLine(long delay_ticks, const T& first)
      : slots_(static_cast<std::size_t>(delay_ticks) + 1, first) {}
  /// Sends a value at a tick. @return the value that arrives at this tick
  const T& exchange(long tick, const T& value) {
    slot(tick) = value;
    return slot(tick + 1);  // written `delay_ticks` ticks ago
  }

 private:
  T& slot(long tick) { return slots_[static_cast<std::size_t>(tick) % slots_.size()]; }
  std::vector<T> slots_;
};

/// A sampled controller: a plant takes one torque, which changes at ticks and arrives late.
class SampledActuation : public Actuation {
 public:
  SampledActuation(Plant& plant, long period_steps) : plant_(plant), period_steps_(period_steps) {}

  bool is_tick(long k) const override { return k % period_steps_ == 0; }
  void take(const control::Answer& answer, bool fresh) override {
    if (fresh) receive(answer, ticks_++);
    form_torque();
  }
  void book(const control::Answer& answer, bool fresh, EnergyAudit& audit) override {
    audit.book_node(plant_, 0.0);
    const bool acts = fresh && answer.channels != nullptr && !answer.stopping;
    if (acts && answer.channels->raw().has_node_velocity != 0)
      audit.book_filter(answer.channels->raw());
  }
  bool step(double step_s) override { return plant_.step(torque_, step_s); }
  const VectorXd& departure_velocity() const override { return plant_.node().v; }
  void torques(const planning::CommandBuffers* answer, VectorXd& sum, Json& by_channel) override {
    sum = torque_;
    if (!sum.isZero(0.0)) by_channel[answer == nullptr ? "stop" : "held"] = to_json(sum);
  }
  bool saturated() const override { return saturated_; }

 protected:
  /// Takes the answer of a tick.
  virtual void receive(const control::Answer& decided, long tick) = 0;
  /// Updates the torque at a node.
  virtual void form_torque() {}

  Plant& plant_;
  VectorXd torque_;
  bool saturated_ = false;

 private:
  long period_steps_, ticks_ = 0;
};

/// Joint positions as they are measured.
class Encoders {
 public:
  explicit Encoders(const scene::Scene& scene)
      : noise_rad_(scene.actuation.joint_noise_rad), random_(scene.seed) {}
  void measure(const VectorXd& q, VectorXd& measured) {
    measured = q;
    if (noise_rad_ > 0.0)
      for (auto& angle : measured) angle += noise_rad_ * random_.normal();
  }

 private:
  double noise_rad_;
  Rng random_;
};

/// The torque of a tick is held for a period, docs/theory.md (8.7).
class TorqueActuation final : public SampledActuation {
 public:
  /// @param holding the torque that acts until the first one of the controller arrives
  TorqueActuation(const scene::Scene& scene, const model::Model& model, Plant& plant,
                  long period_steps, long delay_ticks, const VectorXd& holding)
      : SampledActuation(plant, period_steps),
        limited_(scene::limits_in_force(scene.model, model.robot()).torque ||
                 scene.actuation.torque_rate_max_Nm_s),
        decided_(holding),
        encoders_(scene),
        delayed_(delay_ticks, holding) {}

  void observe(VectorXd& q, VectorXd& v) override {
    encoders_.measure(plant_.node().q, q);
    v = plant_.node().v;
  }

  bool limited() const override { return limited_; }
  const log::TorqueChange* torque_change() const override { return &change_; }

 private:
  void receive(const control::Answer& decided, long tick) override {
    if (tick > 0) change_.add((decided.torque - decided_).lpNorm<Eigen::Infinity>());
    decided_ = decided.torque;
    torque_ = delayed_.exchange(tick, decided_);
    saturated_ = decided.saturated;
  }

  bool limited_;
  VectorXd decided_;  ///< at the last tick
  log::TorqueChange change_;
  Encoders encoders_;
  DelayLine<VectorXd> delayed_;
};

/// Position servos: the set point of a tick is held for a period, and each joint follows it by
/// docs/theory.md (8.14) within its torque limit.
class ServoActuation final : public SampledActuation {
 public:
  ServoActuation(const scene::Scene& scene, const model::Model& model, Plant& plant,
                 long period_steps, long delay_ticks)
      : SampledActuation(plant, period_steps),
        kp_(servo_values(scene, scene.actuation.servo.kp, "kp", model.dof())),
        kv_(servo_values(scene, scene.actuation.servo.kv, "kv", model.dof())),
        dynamic_(scene.actuation.servo.feedforward == scene::Feedforward::dynamics),
        period_s_(scene.actuation.control_period_s),
        arm_(model),
        mass_scale_(scene.actuation.planner_mass_scale),
        nominal_(control::scaled_masses(model, mass_scale_)),
        ws_(nominal_),
        encoders_(scene),
        point_{plant.node().q, plant.node().v},
        sent_(point_),
        delayed_(delay_ticks, point_) {
    torque_ = measured_ = acceleration_ = feedforward_ = VectorXd::Zero(model.dof());
    feed_forward();
    effort_max_ = control::modelled_limits(scene, model.robot()).effort_max;
    check_stability(scene, model);
  }

  void take_load() override {
    nominal_ = control::scaled_masses(arm_, mass_scale_);
    ws_ = dynamics::Workspace(nominal_);
    feed_forward();
  }
  void observe(VectorXd& q, VectorXd& v) override {
    encoders_.measure(plant_.node().q, q);
    v = plant_.node().v;
  }
  bool limited() const override { return effort_max_.size() > 0; }

 private:
  struct SetPoint {
    VectorXd q, v;
  };

  // docs/theory.md (8.15) at the start: all modes are stable if 2M - diag(gain) is positive
  // definite.
  void check_stability(const scene::Scene& scene, const model::Model& model) {
    const double h = scene.step_s;
    Eigen::MatrixXd M(model.dof(), model.dof());
    dynamics::Workspace ws(model);
    dynamics::mass_matrix(model, ws, plant_.node().q, M);
    const VectorXd gain = h * kv_ + 0.5 * h * h * kp_;
    Eigen::MatrixXd rest = 2.0 * M;
    rest.diagonal() -= gain;
    if (rest.llt().info() == Eigen::Success) return;
    refuse_gains(scene, model, M, gain);
  }

  // The fastest mode, by power iteration, and the joint that contributes most to it.
  [[noreturn]] static void refuse_gains(const scene::Scene& scene, const model::Model& model,
                                        const Eigen::MatrixXd& M, const VectorXd& gain) {
    const Eigen::LLT<Eigen::MatrixXd> factor(M);
    VectorXd mode = VectorXd::Ones(model.dof()), pushed(model.dof());
    double largest = 0.0;
    for (int i = 0; i < 200; ++i) {
      pushed = gain.cwiseProduct(mode);
      mode = factor.solve(pushed);
      largest = mode.norm();
      mode /= largest;
    }
    Eigen::Index joint = 0;
    gain.cwiseProduct(mode.cwiseAbs2()).maxCoeff(&joint);
    throw Error(
        ErrorCode::invalid,
        fmt::format("{}: /actuation/servo: joint '{}' is unstable at the step {} s, "
                    "expected gains that are smaller by a factor of {:.2g}, a smaller "
                    "step or more rotor inertia",
                    scene.name, model.robot().links[static_cast<std::size_t>(joint)].joint.name,
                    scene.step_s, largest / 2.0));
  }

  void receive(const control::Answer& decided, long tick) override {
    sent_.q = decided.q_next;
    sent_.v = decided.v_next;
    const SetPoint& next = delayed_.exchange(tick, sent_);
    acceleration_ = (next.v - point_.v) / period_s_;
    point_ = next;
    feed_forward();
  }

  // The model's torque for the set point's motion, or for holding it.
  void feed_forward() {
    if (dynamic_)
      dynamics::inverse_dynamics(nominal_, ws_, point_.q, point_.v, acceleration_, feedforward_);
    else
      dynamics::gravity_torque(nominal_, ws_, point_.q, feedforward_);
  }

  void form_torque() override {
    encoders_.measure(plant_.node().q, measured_);
    torque_ = feedforward_ + kp_.cwiseProduct(point_.q - measured_) +
              kv_.cwiseProduct(point_.v - plant_.node().v);
    saturated_ = false;
    if (effort_max_.size() == 0) return;
    saturated_ = (torque_.cwiseAbs().array() > effort_max_.array()).any();
    torque_ = torque_.cwiseMin(effort_max_).cwiseMax(-effort_max_);
  }

  VectorXd kp_, kv_, effort_max_;
  bool dynamic_;  ///< whether the set point's motion is fed forward
  double period_s_;
  const model::Model& arm_;
  double mass_scale_;
  model::Model nominal_;  ///< the arm as its drives know it
  dynamics::Workspace ws_;
  Encoders encoders_;
  VectorXd measured_, acceleration_, feedforward_;
  SetPoint point_;  ///< that the servos follow now
  SetPoint sent_;   ///< the controller's last one
  DelayLine<SetPoint> delayed_;
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

std::unique_ptr<Actuation> make_sampled_actuation(const scene::Scene& scene,
                                                  const model::Model& model, Plant& plant) {
  const long period_steps = steps_per_tick(scene);
  const long delay = integer_multiple(scene.actuation.delay_s, scene.actuation.control_period_s,
                                      scene.name, "delay_s");
  if (scene.actuation.type == scene::ActuationType::position)
    return std::make_unique<ServoActuation>(scene, model, plant, period_steps, delay);
  dynamics::Workspace ws(model);
  VectorXd holding(model.dof());
  dynamics::gravity_torque(model, ws, plant.node().q, holding);
  return std::make_unique<TorqueActuation>(scene, model, plant, period_steps, delay, holding);
}

}  // namespace hamelin::simulation
