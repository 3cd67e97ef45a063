#include "rosenbrock.hpp"

#include <cmath>

#include "channels/kernel_arguments.hpp"
#include "finite.hpp"
#include "hamelin/core/formatted.hpp"

namespace hamelin::integration {

namespace {

constexpr double default_tolerance = 1e-10;
constexpr StepController::Rule rule{4.0, 0.9, 0.2, 6.0};

// The published coefficients in the form of rodas.f, in which no stage multiplies by the Jacobian,
// docs/theory.md (7.12), (7.13). The last two rows of a are those of the embedded and of the new
// solution, to which the fifth and the sixth stage are added with weight 1.
constexpr double gamma = 0.25;
using Row = std::array<double, 5>;
constexpr std::array<Row, 6> a{
    Row{},
    Row{1.544},
    Row{0.9466785280815826, 0.2557011698983284},
    Row{3.314825187068521, 2.896124015972201, 0.9986419139977817},
    Row{1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950},
    Row{1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1.0}};
constexpr std::array<Row, 6> c{
    Row{},
    Row{-5.6688},
    Row{-2.430093356833875, -0.2063599157091915},
    Row{-0.1073529058151375, -9.594562251023355, -20.47028614809616},
    Row{7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160},
    Row{8.083246795921522, -7.981132988064893, -31.52159432874371, 16.31930543123136,
        -6.058818238834054}};

// Sets the default tolerances: the scheme has no fixed steps.
RosenbrockOptions with_tolerances(RosenbrockOptions options) {
  if (options.rtol == 0.0 && options.atol == 0.0) options.rtol = options.atol = default_tolerance;
  return options;
}

}  // namespace

Rosenbrock::Rosenbrock(const Model& model, const RosenbrockOptions& options)
    : Rosenbrock(with_tolerances(options), model) {}

Rosenbrock::Rosenbrock(const RosenbrockOptions& options, const Model& model)
    : Explicit("rosenbrock", model,
               {.isa = options.isa, .rtol = options.rtol, .atol = options.atol}),
      derivatives_(model, options.isa),
      forces_by_(model.dof()),
      factors_(model.dof()) {
  const int n = model.dof();
  by_q_ = by_v_ = inverse_mass_ = matrix_ = Eigen::MatrixXd::Zero(n, n);
  works_by_q_ = works_by_v_ = Eigen::Matrix4Xd::Zero(4, n);
  for (auto* x : {&q_, &v_, &right_q_, &right_v_}) *x = VectorXd::Zero(n);
  dq_.fill(q_);
  dv_.fill(q_);
}

std::string Rosenbrock::criterion() const {
  return formatted("error <= {} + {} |(q, v)|, rms", settings_.atol, settings_.rtol);
}

Rosenbrock::Works Rosenbrock::derivative(const Channels& channels, const VectorXd& q,
                                         const VectorXd& v, StepReport& report) {
  accelerate(channels, q, v, report);
  StepReport power;
  forces_.add_work(power, v, 1.0);
  return {power.gyroscopic_work_J, power.dissipated_J, power.held_work_J, power.external_work_J};
}

// docs/theory.md (7.17): gyroscopic terms have no power anywhere.
void Rosenbrock::make_jacobian(const State& state, const Channels& channels, StepReport& report) {
  forces_by_.evaluate(model_, channels, ws_, state.q, state.v, *wrenches_);
  dynamics::forward_dynamics_derivatives(model_, derivatives_, state.q, state.v, forces_by_.force,
                                         acceleration_, by_q_, by_v_, inverse_mass_);
  by_q_.noalias() += inverse_mass_ * forces_by_.by_q;
  by_v_.noalias() += inverse_mass_ * forces_by_.by_v;
  ++report.evaluations;
  works_by_q_.setZero();
  works_by_v_.setZero();
  const kernel::Forces joints = joint_forces(channels);
  for (Eigen::Index i = 0; i < state.v.size(); ++i) {
    const auto joint = static_cast<std::size_t>(i);
    const double held = joints.held != nullptr ? joints.held[i] : 0.0,
                 braking = held - kernel::joint_force(joints, joint, state.v[i]);
    works_by_v_(1, i) = braking + kernel::joint_force_slope(joints, joint, state.v[i]) * state.v[i];
    works_by_v_(2, i) = held;
  }
  works_by_q_.row(3).noalias() = state.v.transpose() * forces_by_.external_by_q;
  works_by_v_.row(3).noalias() = state.v.transpose() * forces_by_.external_by_v;
  works_by_v_.row(3) += forces_by_.external.transpose();
}

// docs/theory.md (7.14): the increments (dq, dv) of a stage solve dq/(γh) − dv = r_q and
// dv/(γh) − J_q dq − J_v dv = r_v; inserting dq = γh (r_q + dv) leaves a system for dv.
void Rosenbrock::solve_stage(std::size_t stage, const Channels& channels, double h,
                             StepReport& report) {
  const double step = gamma * h;
  Works right = derivative(channels, q_, v_, report);
  right_q_ = v_;
  right_v_ = acceleration_;
  for (std::size_t j = 0; j < stage; ++j) {
    right_q_ += (c[stage][j] / h) * dq_[j];
    right_v_ += (c[stage][j] / h) * dv_[j];
    right += (c[stage][j] / h) * dworks_[j];
  }
  right_v_.noalias() += step * (by_q_ * right_q_);
  dv_[stage] = factors_.solve(right_v_);
  dq_[stage] = step * (right_q_ + dv_[stage]);
  right.noalias() += works_by_q_ * dq_[stage];
  right.noalias() += works_by_v_ * dv_[stage];
  dworks_[stage] = step * right;
}

void Rosenbrock::try_step(const State& state, const Channels& channels, double h,
                          StepReport& report) {
  const double step = gamma * h;
  matrix_ = -by_v_ - step * by_q_;
  matrix_.diagonal().array() += 1.0 / step;
  factors_.compute(matrix_);
  ++report.factorizations;
  for (std::size_t stage = 0; stage < stages; ++stage) {
    q_ = state.q;
    v_ = state.v;
    works_.setZero();
    for (std::size_t j = 0; j < stage; ++j) {
      q_ += a[stage][j] * dq_[j];
      v_ += a[stage][j] * dv_[j];
      works_ += a[stage][j] * dworks_[j];
    }
    solve_stage(stage, channels, h, report);
  }
  q_ += dq_.back();
  v_ += dv_.back();
  works_ += dworks_.back();
}

// docs/theory.md (7.15)
double Rosenbrock::error_norm(const State& state) const {
  double sum = 0.0;
  const auto add = [&](const VectorXd& before, const VectorXd& after, const VectorXd& error) {
    for (Eigen::Index i = 0; i < before.size(); ++i) {
      const double e = error[i] / (settings_.atol + settings_.rtol * std::max(std::abs(before[i]),
                                                                              std::abs(after[i])));
      sum += e * e;
    }
  };
  add(state.q, q_, dq_.back());
  add(state.v, v_, dv_.back());
  return std::sqrt(sum / static_cast<double>(2 * state.q.size()));
}

StepReport Rosenbrock::attempt(State&, const Channels&, double) {
  StepReport report;
  report.converged = false;  // the scheme has no fixed steps
  return report;
}

StepReport Rosenbrock::controlled_step(State& state, const Channels& channels, double limit) {
  StepReport report;
  report.converged = false;
  make_jacobian(state, channels, report);
  StepController control(rule, state, limit);
  while (control.has_try()) {
    try_step(state, channels, control.step(), report);
    report.residual =
        all_finite(q_) && all_finite(v_) && works_.allFinite() ? error_norm(state) : std::nan("");
    if (!control.accepts(report.residual)) continue;
    state.q = q_;
    state.v = v_;
    report.gyroscopic_work_J = works_[0];
    report.dissipated_J = works_[1];
    report.held_work_J = works_[2];
    report.external_work_J = works_[3];
    control.finish(state, report);
  }
  report.rejected = control.rejected();
  return report;
}

}  // namespace hamelin::integration
