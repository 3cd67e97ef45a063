#include "explicit.hpp"

#include "finite.hpp"

namespace hamelin::integration {

Explicit::Explicit(std::string name, const Model& model, const Settings& settings)
    : Integrator(std::move(name), model, settings),
      forces_(model, *wrenches_),
      acceleration_(VectorXd::Zero(model.dof())) {}

void Explicit::add_momentum(State& state, const ConstVectorRef& dp) {
  dynamics::solve_mass(model_, ws_, state.q, dp, acceleration_);
  state.v += acceleration_;
}

void Explicit::accelerate(const Channels& channels, const VectorXd& q, const VectorXd& v,
                          StepReport& report) {
  // without checks: model and sizes were checked when the step began
  dynamics::detail::forward_dynamics(model_, ws_, q.data(), v.data(),
                                     forces_.evaluate(channels, ws_, q, v).data(),
                                     acceleration_.data());
  ++report.evaluations;
}

SemiImplicitEuler::SemiImplicitEuler(const Model& model, const SemiImplicitEulerOptions& options)
    : Explicit("semi-implicit-euler", model, {options.isa}) {
  q_ = v_ = VectorXd::Zero(model.dof());
}

StepReport SemiImplicitEuler::attempt(State& state, const Channels& channels, double h) {
  StepReport report;
  accelerate(channels, state.q, state.v, report);
  v_ = state.v + h * acceleration_;
  q_ = state.q + h * v_;
  report.converged = all_finite(q_);  // q_ is finite only if v_ is
  if (!report.converged) return report;
  forces_.add_work(report, v_, h);
  state.q.swap(q_);
  state.v.swap(v_);
  return report;
}

Rk4::Rk4(const Model& model, const Rk4Options& options) : Explicit("rk4", model, {options.isa}) {
  q_ = v_ = q_sum_ = v_sum_ = VectorXd::Zero(model.dof());
}

StepReport Rk4::attempt(State& state, const Channels& channels, double h) {
  // stage i is evaluated at (q, v) + c_i h (v_, acceleration_) of the stage before
  static constexpr std::array<double, 4> c{0.0, 0.5, 0.5, 1.0},
      b{1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0};
  StepReport report;
  q_sum_ = state.q;
  v_sum_ = state.v;
  v_ = state.v;
  acceleration_.setZero();
  for (std::size_t i = 0; i < 4; ++i) {
    q_ = state.q + c[i] * h * v_;
    v_ = state.v + c[i] * h * acceleration_;
    accelerate(channels, q_, v_, report);
    forces_.add_work(report, v_, b[i] * h);
    q_sum_ += b[i] * h * v_;
    v_sum_ += b[i] * h * acceleration_;
  }
  report.converged = all_finite(q_sum_) && all_finite(v_sum_);
  if (!report.converged) return report;
  state.q.swap(q_sum_);
  state.v.swap(v_sum_);
  return report;
}

}  // namespace hamelin::integration
