#include "variational.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace hamelin::integration {

namespace {

// Near a root Newton contracts quadratically, and the guess is near. A first correction beyond this [rad or m], or one
// that is not well below the one before, is on its way to some other root of the step: better to halve the step.
constexpr double largest_correction = 1.0;
constexpr double contraction = 0.5;
constexpr int max_newton_updates = 30;  // at the worst contraction, from the largest correction to 1e-9

}  // namespace

Variational::Variational(const Model& model, const Options& options) : Integrator("hamel-variational", model, options) {
  const auto n = static_cast<std::size_t>(model.dof());
  if (model.planar())
    links_ = kernel::VariationalScratch<dynamics::kernel::Planar<double>>(n);
  else
    links_ = kernel::VariationalScratch<dynamics::kernel::Spatial<double>>(n);
  for (auto* x : {&delta_, &correction_, &mid_, &rate_, &minus_, &plus_, &residual_, &gradient_})
    *x = VectorXd::Zero(model.dof());
}

std::string Variational::criterion() const {
  return options_.solver == Solver::newton ? fmt::format("|error of delta|_inf <= {}", options_.tolerance)
                                           : fmt::format("|tau_e|_2 < {}", options_.feedback_tolerance);
}

void Variational::begin(State& state, const VectorXd& v0) {
  set_velocity(state, v0);
}

void Variational::velocity(const State& state, VectorXd& v) {
  dynamics::solve_mass(model_, ws_, state.q, state.p, v);
}

void Variational::kick(State& state, const VectorXd& dp) {
  state.p += dp;
}

void Variational::set_velocity(State& state, const VectorXd& v) {
  dynamics::momentum(model_, ws_, state.q, v, state.p);
  state.v = v;
  state.delta_count = -1;  // the guess is h v
}

void Variational::guess(const State& state, double h) {
  if (options_.solver == Solver::feedback) {
    delta_.setZero();  // the paper's guess θ^k
    return;
  }
  const auto& d = state.deltas;
  switch (state.delta_count) {
    case -1:
      delta_ = h * state.v;
      break;
    case 0:
      delta_.setZero();
      break;
    case 1:
      delta_ = d[0];
      break;
    case 2:
      delta_ = 2.0 * d[0] - d[1];
      break;
    case 3:
      delta_ = 3.0 * (d[0] - d[1]) + d[2];
      break;
    default:
      delta_ = 4.0 * (d[0] + d[2]) - 6.0 * d[1] - d[3];
      break;
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

bool Variational::factor(const Channels& channels, double h) {
  const double* damping = channels.damping.size() > 0 ? channels.damping.data() : nullptr;
  if (model_.planar()) return kernel::factor(std::get<1>(model_.chain()), std::get<1>(links_), h, damping);
  return kernel::factor(std::get<0>(model_.chain()), std::get<0>(links_), h, damping);
}

void Variational::correct() {
  if (model_.planar())
    kernel::correct(std::get<1>(model_.chain()), std::get<1>(links_), residual_.data(), correction_.data());
  else
    kernel::correct(std::get<0>(model_.chain()), std::get<0>(links_), residual_.data(), correction_.data());
}

// The last sweep is needed for p⁺ anyway, and the kept factors turn its residual into the error of Δ: no factorisation
// is spent on confirming.
bool Variational::solve_newton(const State& state, const Channels& channels, double h, StepReport& report) {
  double allowed = largest_correction;
  for (;;) {
    evaluate(state, channels, h);
    ++report.evaluations;
    if (!residual_.allFinite()) return false;
    if (report.factorizations > 0) {
      correct();
      report.residual = correction_.lpNorm<Eigen::Infinity>();
      if (report.residual <= options_.tolerance) {
        // The correction is at hand, so Δ takes it; taking R out of p⁺ = p⁻ + h λ·b moves p⁺ along but for its slow
        // part.
        delta_ += correction_;
        plus_ -= residual_;
        return true;
      }
    }
    if (report.updates == max_newton_updates || !factor(channels, h)) return false;
    ++report.factorizations;
    correct();
    const double size = correction_.lpNorm<Eigen::Infinity>();
    if (!(size <= allowed)) return false;
    // rounding of long chains ends the contraction, not the iteration
    allowed = std::max(contraction * size, 1e3 * options_.tolerance);
    delta_ += correction_;
    ++report.updates;
  }
}

bool Variational::solve_feedback(const State& state, const Channels& channels, double h, StepReport& report) {
  for (;;) {
    evaluate(state, channels, h);
    ++report.evaluations;
    report.residual = residual_.norm() / h;  // ‖τ_e‖
    if (!std::isfinite(report.residual)) return false;
    if (report.residual < options_.feedback_tolerance) return true;
    if (report.updates == options_.max_updates) return false;
    residual_ *= -h;  // h² M⁻¹ τ_e with τ_e = R/h, (16)
    dynamics::solve_mass(model_, ws_, state.q, residual_, correction_);
    delta_ += correction_;
    ++report.updates;
    ++report.factorizations;
  }
}

StepReport Variational::attempt(State& state, const Channels& channels, double h) {
  StepReport report;
  dynamics::gravity_torque(model_, ws_, state.q, gradient_);
  guess(state, h);
  report.converged = options_.solver == Solver::newton ? solve_newton(state, channels, h, report)
                                                       : solve_feedback(state, channels, h, report);
  if (!report.converged) return report;
  book_work(report, rate_, h);  // over the displacement that the forces were evaluated at
  // p_{k+1} = p⁺ − (h/2) ∂U(θ^{k+1}) + (h/2) F
  state.q += delta_;
  state.p = plus_ + 0.5 * h * force_;
  dynamics::gravity_torque(model_, ws_, state.q, gradient_);
  state.p -= 0.5 * h * gradient_;
  const bool same_step = state.step_previous == h && state.delta_count > 0;
  std::rotate(state.deltas.begin(), state.deltas.end() - 1, state.deltas.end());
  state.deltas[0] = delta_;
  state.delta_count = same_step ? std::min(state.delta_count + 1, 4) : 1;
  state.step_previous = h;
  return report;
}

}  // namespace hamelin::integration
