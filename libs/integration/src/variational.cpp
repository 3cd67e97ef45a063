#include "variational.hpp"

#include <fmt/format.h>

#include <cmath>

namespace hamelin::integration {

namespace {

// Newton converges quadratically; a step that needs more is not going to.
constexpr int max_newton_updates = 30;

}  // namespace

Variational::Variational(const Model& model, const Options& options)
    : Integrator("hamel-variational", model, options) {
  const auto n = static_cast<std::size_t>(model.dof());
  if (model.planar())
    links_ = kernel::VariationalScratch<dynamics::kernel::Planar<double>>(n);
  else
    links_ = kernel::VariationalScratch<dynamics::kernel::Spatial<double>>(n);
  for (auto* x : {&delta_, &correction_, &mid_, &rate_, &minus_, &plus_, &residual_, &gradient_, &torque_error_})
    *x = VectorXd::Zero(model.dof());
}

std::string Variational::criterion() const {
  return options_.solver == Solver::newton ? fmt::format("|correction of delta|_inf <= {}", options_.tolerance)
                                           : fmt::format("|tau_e|_2 < {}", options_.feedback_tolerance);
}

void Variational::begin(State& state, const VectorXd& v0) { set_velocity(state, v0); }

void Variational::velocity(const State& state, VectorXd& v) {
  dynamics::solve_mass(model_, ws_, state.q, state.p, v);
}

void Variational::kick(State& state, const VectorXd& dp) { state.p += dp; }

void Variational::set_velocity(State& state, const VectorXd& v) {
  dynamics::momentum(model_, ws_, state.q, v, state.p);
  state.v = v;
  state.delta_count = -1;  // the guess is h v
}

void Variational::guess(const State& state, double h) {
  const auto& d = state.deltas;
  switch (state.delta_count) {
    case -1: delta_ = h * state.v; break;
    case 0: delta_.setZero(); break;
    case 1: delta_ = d[0]; break;
    case 2: delta_ = 2.0 * d[0] - d[1]; break;
    default: delta_ = 3.0 * (d[0] - d[1]) + d[2]; break;
  }
  if (state.delta_count > 0 && state.step_previous != h) delta_ = d[0] * (h / state.step_previous);
}

void Variational::evaluate(const State& state, const Channels& channels, double h) {
  mid_ = state.q + 0.5 * delta_;
  rate_ = delta_ / h;
  if (model_.planar())
    kernel::momenta(std::get<1>(model_.chain()), std::get<1>(links_), mid_.data(), rate_.data(), h, minus_.data(),
                    plus_.data());
  else
    kernel::momenta(std::get<0>(model_.chain()), std::get<0>(links_), mid_.data(), rate_.data(), h, minus_.data(),
                    plus_.data());
  evaluate_forces(channels, mid_, rate_);
  residual_ = minus_ + 0.5 * h * (gradient_ - force_) - state.p;
}

StepReport Variational::attempt(State& state, const Channels& channels, double h) {
  StepReport report;
  report.converged = false;
  dynamics::gravity_torque(model_, ws_, state.q, gradient_);
  guess(state, h);
  const bool newton = options_.solver == Solver::newton;
  const double* damping = channels.damping.size() > 0 ? channels.damping.data() : nullptr;
  const int max_updates = newton ? max_newton_updates : options_.max_updates;
  for (;;) {
    evaluate(state, channels, h);
    ++report.evaluations;
    if (!residual_.allFinite()) return report;
    if (report.converged) break;  // Newton's last correction was small: this sweep was for p⁺
    if (!newton) {
      report.residual = residual_.norm() / h;
      if (report.residual < options_.feedback_tolerance) {
        report.converged = true;
        break;
      }
    }
    if (report.updates == max_updates) return report;
    if (newton) {
      const bool solved =
          model_.planar() ? kernel::newton(std::get<1>(model_.chain()), std::get<1>(links_), h, residual_.data(), damping,
                                           correction_.data())
                          : kernel::newton(std::get<0>(model_.chain()), std::get<0>(links_), h, residual_.data(), damping,
                                           correction_.data());
      if (!solved || !correction_.allFinite()) return report;
      report.residual = correction_.lpNorm<Eigen::Infinity>();
      report.converged = report.residual <= options_.tolerance;
    } else {
      torque_error_ = residual_ * (-h);  // h² M⁻¹ τ_e with τ_e = R/h, (16)
      dynamics::solve_mass(model_, ws_, state.q, torque_error_, correction_);
    }
    delta_ += correction_;
    ++report.updates;
    ++report.factorizations;
  }
  book_work(report, delta_, 1.0);
  // p_{k+1} = p⁺ − (h/2) ∂U(θ^{k+1}) + (h/2) F
  state.q += delta_;
  state.p = plus_ + 0.5 * h * force_;
  dynamics::gravity_torque(model_, ws_, state.q, gradient_);
  state.p -= 0.5 * h * gradient_;
  const bool same_step = state.step_previous == h && state.delta_count > 0;
  std::swap(state.deltas[2], state.deltas[1]);
  std::swap(state.deltas[1], state.deltas[0]);
  state.deltas[0] = delta_;
  state.delta_count = same_step ? std::min(state.delta_count + 1, 3) : 1;
  state.step_previous = h;
  return report;
}

}  // namespace hamelin::integration
