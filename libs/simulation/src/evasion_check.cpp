#include "evasion_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "scene_values.hpp"
#include "shield/fail_safe.hpp"

namespace hamelin::simulation {

using Eigen::VectorXd;

namespace {

// Motions are sampled this finely, and must keep this distance, which covers what lies between two
// samples: a point that approaches at 2 m/s comes 2 mm nearer in half the time between them.
constexpr double sample_s = 0.002, room_m = 0.002;
// No larger distance matters.
constexpr double clearance_limit_m = 0.02;
// Durations that are tried, each by this factor longer than the one before [s].
constexpr double shortest_s = 0.08, longest_s = 2.0, longer = 1.25;
constexpr int coarse_intervals = 16;

bool exceeds(const VectorXd& x, const VectorXd& limit) {
  return limit.size() > 0 && (x.array().abs() > limit.array()).any();
}

}  // namespace

void Evasion::at(double time_s, State& state) const {
  const double s = std::min(time_s / duration_s, 1.0);
  const auto f = control::FailSafe::profile(s);
  const double f_jerk = 60.0 + s * (360.0 * s - 360.0);
  const double integral = s * s * s * s * (2.5 + s * (s - 3.0));
  const double T = duration_s;
  state.q = q + T * (s - integral) * v + f.position * way;
  state.v = (1.0 - f.position) * v + f.velocity / T * way;
  state.a = -f.velocity / T * v + f.acceleration / (T * T) * way;
  state.jerk = -f.acceleration / (T * T) * v + f_jerk / (T * T * T) * way;
}

EvasionCheck::EvasionCheck(const scene::Scene& scene, const model::Model& model,
                           const scene::Environment& environment)
    : model_(model),
      environment_(environment),
      limits_(control::modelled_limits(scene, model.robot())),
      damping_(plant_damping(scene, model.robot())),
      friction_(plant_friction(scene, model.robot())),
      torque_rate_(std::numeric_limits<double>::infinity()),
      friction_speed_(scene.model.friction_speed),
      ws_(model),
      arm_(model),
      torque_(VectorXd::Zero(model.dof())),
      torque_before_(torque_) {
  if (scene.model.self_collision) self_.emplace(model);
  const auto& actuation = scene.actuation;
  if (actuation.type == scene::ActuationType::sampled && actuation.torque_rate_max_Nm_s)
    torque_rate_ = *actuation.torque_rate_max_Nm_s;
  if (actuation.type == scene::ActuationType::position) {
    const auto& servo = actuation.servo;
    acceleration_max_ =
        servo_values(scene, servo.acceleration_max, "acceleration_max", model.dof());
    jerk_max_ = servo_values(scene, servo.jerk_max, "jerk_max", model.dof());
  }
}

bool EvasionCheck::fit_duration(Evasion& evasion) {
  for (evasion.duration_s = shortest_s; evasion.duration_s <= longest_s;
       evasion.duration_s *= longer)
    if (is_within_limits(evasion, coarse_intervals)) return true;
  return false;
}

bool EvasionCheck::is_within_limits(const Evasion& evasion, int intervals) {
  const double step_s = evasion.duration_s / intervals;
  for (int i = 0; i <= intervals; ++i) {
    evasion.at(i * step_s, state_);
    if (!is_state_within_limits(evasion)) return false;
    torque_before_ = torque_;
    set_torque();
    if (exceeds(torque_, limits_.effort_max)) return false;
    const double change = (torque_ - torque_before_).cwiseAbs().maxCoeff();
    if (i > 0 && change > torque_rate_ * step_s) return false;
  }
  return true;
}

// Where the start is beyond a limit, the motion may not exceed it further.
bool EvasionCheck::is_state_within_limits(const Evasion& evasion) const {
  if (limits_.q_lower.size() > 0 &&
      ((state_.q.array() < limits_.q_lower.cwiseMin(evasion.q).array()).any() ||
       (state_.q.array() > limits_.q_upper.cwiseMax(evasion.q).array()).any()))
    return false;
  if (limits_.velocity_max.size() > 0 &&
      exceeds(state_.v, limits_.velocity_max.cwiseMax(evasion.v.cwiseAbs())))
    return false;
  return !exceeds(state_.a, acceleration_max_) && !exceeds(state_.jerk, jerk_max_);
}

void EvasionCheck::set_torque() {
  dynamics::inverse_dynamics(model_, ws_, state_.q, state_.v, state_.a, torque_);
  if (damping_.size() > 0) torque_ += damping_.cwiseProduct(state_.v);
  if (friction_.size() > 0)
    torque_.array() += friction_.array() * (state_.v.array() / friction_speed_).tanh();
}

bool EvasionCheck::is_clear(const Evasion& evasion, double until_s) {
  return stays_clear(evasion, until_s, nullptr) &&
         is_within_limits(evasion, static_cast<int>(std::ceil(evasion.duration_s / sample_s)));
}

bool EvasionCheck::looks_clear(const Evasion& evasion, double until_s, const Knowledge& knowledge) {
  return stays_clear(evasion, until_s, &knowledge);
}

bool EvasionCheck::stays_clear(const Evasion& evasion, double until_s, const Knowledge* knowledge) {
  const double start = clearance(evasion.q, evasion.start_s, knowledge);
  if (start <= 0.0) return false;
  const double room = std::min(room_m, 0.5 * start);
  const double span_s = std::max(until_s - evasion.start_s, evasion.duration_s);
  const int samples = static_cast<int>(std::ceil(span_s / sample_s));
  // Few samples first, because most motions that touch something do so for long.
  int done = 0;
  for (const int stride : {32, 8, 1}) {
    for (int i = 0; i <= samples; i += stride) {
      if (done > 0 && i % done == 0) continue;
      evasion.at(i * sample_s, state_);
      if (clearance(state_.q, evasion.start_s + i * sample_s, knowledge) <= room) return false;
      if (knowledge == nullptr && touches_itself()) return false;
    }
    done = stride;
  }
  return true;
}

double EvasionCheck::clearance(const VectorXd& q, double time_s, const Knowledge* knowledge) {
  dynamics::forward_kinematics(model_, ws_, q);
  arm_.place(model_, ws_);
  if (knowledge == nullptr) return environment_.clearance(arm_.view(), time_s, clearance_limit_m);
  return environment_.clearance(arm_.view(), {knowledge->time_s, time_s - knowledge->time_s},
                                clearance_limit_m, scene::View::planner, knowledge->seen);
}

bool EvasionCheck::touches_itself() {
  std::array<scene::SelfContact, 1> nearest;
  return self_ && self_->closest(arm_.view(), 0.0, nearest) > 0;
}

}  // namespace hamelin::simulation
