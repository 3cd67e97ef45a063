#include "energy_attractor.hpp"

#include <cmath>

#include "finite.hpp"

namespace hamelin::integration {

namespace {

// κ of docs/theory.md (7.8), (7.9) [1/s]: an error fades within 0.1 s; steps to 0.1 s stay stable
constexpr double gain = 10.0;

}  // namespace

EnergyAttractor::EnergyAttractor(const Model& model, const EnergyAttractorOptions& options)
    : Explicit("energy-attractor", model, {options.isa}) {
  for (const auto& link : model.robot().links)
    revolute_.push_back(link.joint.type == model::JointType::revolute);
  for (auto* x : {&q_, &v_, &c_, &s_, &dc_, &ds_, &dv_, &c_sum_, &s_sum_, &v_sum_})
    *x = VectorXd::Zero(model.dof());
  embedded_ = VectorXd::Zero(2 * model.dof() + 1);
}

// State::memory: c and s of all joints (for a prismatic joint the coordinate and 0), then E*.
void EnergyAttractor::begin(State& state, const ConstVectorRef& v0) {
  state.memory = VectorXd::Zero(2 * model_.dof() + 1);
  Explicit::begin(state, v0);
}

void EnergyAttractor::embed(const State& state) {
  const Eigen::Index n = model_.dof();
  if (!state.jumped) {
    embedded_ = state.memory;
    return;
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    const bool revolute = revolute_[static_cast<std::size_t>(i)];
    embedded_[i] = revolute ? std::cos(state.q[i]) : state.q[i];
    embedded_[n + i] = revolute ? std::sin(state.q[i]) : 0.0;
  }
  embedded_[2 * n] = node_energy(state).total();
}

StepReport EnergyAttractor::attempt(State& state, const Channels& channels, double h) {
  static constexpr std::array<double, 4> node{0.0, 0.5, 0.5, 1.0},
      b{1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
  const Eigen::Index n = model_.dof();
  StepReport report;
  embed(state);
  const auto c0 = embedded_.head(n), s0 = embedded_.segment(n, n);
  // β of docs/theory.md (7.9). It is as small as the error of the scheme, so it may be constant
  // over the step.
  const Energy now = node_energy(state);
  const double excess = now.total() - embedded_[2 * n];
  const double energy_gain =
      excess == 0.0 ? 0.0 : gain * excess / (2.0 * now.kinetic_J + std::abs(excess));
  // the angle of a pair, counted on from the angle of the node
  const auto joint = [&](Eigen::Index i, double c, double s) {
    if (!revolute_[static_cast<std::size_t>(i)]) return c;
    return state.q[i] + std::atan2(s * c0[i] - c * s0[i], c * c0[i] + s * s0[i]);
  };
  c_sum_ = c0;
  s_sum_ = s0;
  v_sum_ = state.v;
  dc_.setZero();
  ds_.setZero();
  dv_.setZero();
  for (std::size_t stage = 0; stage < 4; ++stage) {
    const double ahead = node[stage] * h, weight = b[stage] * h;
    c_ = c0 + ahead * dc_;
    s_ = s0 + ahead * ds_;
    v_ = state.v + ahead * dv_;
    for (Eigen::Index i = 0; i < n; ++i) q_[i] = joint(i, c_[i], s_[i]);
    accelerate(channels, q_, v_, report);
    forces_.add_work(report, v_, weight);
    for (Eigen::Index i = 0; i < n; ++i) {
      if (revolute_[static_cast<std::size_t>(i)]) {
        const double off = gain * (c_[i] * c_[i] + s_[i] * s_[i] - 1.0);
        dc_[i] = -s_[i] * v_[i] - off * c_[i];
        ds_[i] = c_[i] * v_[i] - off * s_[i];
      } else {
        dc_[i] = v_[i];
      }
    }
    dv_ = acceleration_ - energy_gain * v_;
    c_sum_ += weight * dc_;
    s_sum_ += weight * ds_;
    v_sum_ += weight * dv_;
  }
  for (Eigen::Index i = 0; i < n; ++i) q_[i] = joint(i, c_sum_[i], s_sum_[i]);
  const double target = embedded_[2 * n] + report.held_work_J + report.gyroscopic_work_J +
                        report.external_work_J - report.dissipated_J;
  report.converged = all_finite(q_) && all_finite(v_sum_) && all_finite(c_sum_) &&
                     all_finite(s_sum_) && std::isfinite(target);
  if (!report.converged) return report;
  state.q = q_;
  state.v = v_sum_;
  state.memory.head(n) = c_sum_;
  state.memory.segment(n, n) = s_sum_;
  state.memory[2 * n] = target;
  return report;
}

}  // namespace hamelin::integration
