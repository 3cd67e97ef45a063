#include "trapezoidal.hpp"

#include <cmath>
#include <limits>

namespace hamelin::optimal {

using Eigen::MatrixXd;

// Rows: 2n defects per interval, 4n ends, 3n bounds per knot, and the clearances at inner knots.
Trapezoidal::Trapezoidal(const Problem& problem)
    : problem_(problem),
      n_(problem.model->dof()),
      N_(problem.intervals),
      free_(problem.objective == Objective::time),
      ws_(*problem.model),
      weights_(VectorXd::Ones(n_)),
      a_(n_, N_ + 1) {
  constexpr double none = std::numeric_limits<double>::infinity();
  if (problem.effort_weights.size() > 0) weights_ = problem.effort_weights;
  if (problem.clearance != nullptr) {
    each_ = problem.clearance->rows();
    distances_ = VectorXd::Zero(each_);
    gradients_.assign(static_cast<std::size_t>(N_), MatrixXd::Zero(n_, each_));
  }
  const Index defects = 2 * n_ * N_, simple = defects + 4 * n_ + 3 * n_ * (N_ + 1),
              rows = simple + each_ * (N_ - 1);
  lower_ = upper_ = values_ = VectorXd::Zero(rows);
  lower_.segment(defects, 4 * n_) << problem.q_start, problem.v_start, problem.q_goal,
      problem.v_goal;
  upper_.segment(defects, 4 * n_) = lower_.segment(defects, 4 * n_);
  lower_.tail(each_ * (N_ - 1)).setConstant(distance_scale * problem.margin_m);
  upper_.tail(each_ * (N_ - 1)).setConstant(none);
  const Limits& limits = problem.limits;
  const auto bound = [&](const VectorXd& x) {
    return x.size() > 0 ? x : VectorXd(VectorXd::Constant(n_, none));
  };
  for (Index k = 0; k <= N_; ++k) {
    const Index row = defects + 4 * n_ + 3 * n_ * k;
    upper_.segment(row, n_) = bound(limits.position_max);
    lower_.segment(row, n_) = -bound(-limits.position_min);
    upper_.segment(row + n_, n_) = bound(limits.velocity);
    lower_.segment(row + n_, n_) = -bound(limits.velocity);
    upper_.segment(row + 2 * n_, n_) = bound(limits.torque);
    lower_.segment(row + 2 * n_, n_) = -bound(limits.torque);
  }
  a_q_.assign(static_cast<std::size_t>(N_ + 1), MatrixXd::Zero(n_, n_));
  a_v_ = a_tau_ = a_q_;
}

Eigen::VectorXd Trapezoidal::guess(const MatrixXd& knots) const {
  VectorXd x = VectorXd::Zero(variables());
  const double h = problem_.duration_s / static_cast<double>(N_);
  dynamics::Workspace ws(*problem_.model);
  VectorXd v = problem_.v_start, a(n_), tau(n_);
  for (Index k = 0; k <= N_; ++k) {
    if (k > 0 && k < N_) v = (knots.col(k + 1) - knots.col(k - 1)) / (2.0 * h);
    if (k == N_) v = problem_.v_goal;
    a.setZero();
    if (k > 0 && k < N_) a = (knots.col(k + 1) - 2.0 * knots.col(k) + knots.col(k - 1)) / (h * h);
    dynamics::inverse_dynamics(*problem_.model, ws, VectorXd(knots.col(k)), v, a, tau);
    x.segment(q_of(k), n_) = knots.col(k);
    x.segment(v_of(k), n_) = v;
    x.segment(tau_of(k), n_) = tau;
  }
  if (free_) x[variables() - 1] = 1.0;
  return x;
}

bool Trapezoidal::evaluate(const VectorXd& x) {
  x_ = x;
  h_ = problem_.duration_s / static_cast<double>(N_) * (free_ ? x[variables() - 1] : 1.0);
  effort_ = 0.0;
  VectorXd a(n_);
  for (Index k = 0; k <= N_; ++k) {
    const auto i = static_cast<std::size_t>(k);
    dynamics::forward_dynamics_derivatives(
        *problem_.model, ws_, VectorXd(x.segment(q_of(k), n_)), VectorXd(x.segment(v_of(k), n_)),
        VectorXd(x.segment(tau_of(k), n_)), a, a_q_[i], a_v_[i], a_tau_[i]);
    a_.col(k) = a;
    effort_ += (k == 0 || k == N_ ? 0.5 : 1.0) * x.segment(tau_of(k), n_).cwiseAbs2().dot(weights_);
  }
  for (Index k = 0; k < N_; ++k) {
    values_.segment(2 * n_ * k, n_) =
        x.segment(q_of(k + 1), n_) - x.segment(q_of(k), n_) -
        0.5 * h_ * (x.segment(v_of(k), n_) + x.segment(v_of(k + 1), n_));
    values_.segment(2 * n_ * k + n_, n_) = x.segment(v_of(k + 1), n_) - x.segment(v_of(k), n_) -
                                           0.5 * h_ * (a_.col(k) + a_.col(k + 1));
  }
  const Index ends = 2 * n_ * N_;
  values_.segment(ends, 2 * n_) = x.segment(0, 2 * n_);
  values_.segment(ends + 2 * n_, 2 * n_) = x.segment(q_of(N_), 2 * n_);
  values_.segment(ends + 4 * n_, 3 * n_ * (N_ + 1)) = x.head(3 * n_ * (N_ + 1));
  for (Index k = 1; each_ > 0 && k < N_; ++k) {
    problem_.clearance->evaluate_all(VectorXd(x.segment(q_of(k), n_)), distances_,
                                     gradients_[static_cast<std::size_t>(k)]);
    values_.segment(first_distance() + each_ * (k - 1), each_) = distance_scale * distances_;
  }
  const double T = h_ * static_cast<double>(N_);
  cost_ =
      free_ ? T + problem_.time_effort_weight / static_cast<double>(N_) * effort_ : h_ * effort_;
  return values_.allFinite();
}

void Trapezoidal::gradient(VectorXd& out) const {
  out.setZero();
  const double factor = free_ ? problem_.time_effort_weight / static_cast<double>(N_) : h_;
  for (Index k = 0; k <= N_; ++k)
    out.segment(tau_of(k), n_) = 2.0 * factor * (k == 0 || k == N_ ? 0.5 : 1.0) *
                                 x_.segment(tau_of(k), n_).cwiseProduct(weights_);
  if (free_) out[variables() - 1] = problem_.duration_s;
}

template <class F>
void Trapezoidal::for_each_entry(F&& f) const {
  const double h_ref = problem_.duration_s / static_cast<double>(N_);
  for (Index k = 0; k < N_; ++k)
    for (Index i = 0; i < n_; ++i) {
      const Index row = 2 * n_ * k + i, force_row = row + n_;
      f(row, q_of(k + 1) + i, 1.0);
      f(row, q_of(k) + i, -1.0);
      f(row, v_of(k) + i, -0.5 * h_);
      f(row, v_of(k + 1) + i, -0.5 * h_);
      f(force_row, v_of(k + 1) + i, 1.0);
      f(force_row, v_of(k) + i, -1.0);
      for (Index end = k; end <= k + 1; ++end)
        for (Index j = 0; j < n_; ++j) {
          const auto e = static_cast<std::size_t>(end);
          f(force_row, q_of(end) + j, -0.5 * h_ * a_q_[e](i, j));
          f(force_row, v_of(end) + j, -0.5 * h_ * a_v_[e](i, j));
          f(force_row, tau_of(end) + j, -0.5 * h_ * a_tau_[e](i, j));
        }
      if (!free_) continue;
      f(row, variables() - 1, -0.5 * h_ref * (x_[v_of(k) + i] + x_[v_of(k + 1) + i]));
      f(force_row, variables() - 1, -0.5 * h_ref * (a_(i, k) + a_(i, k + 1)));
    }
  const Index ends = 2 * n_ * N_;
  for (Index i = 0; i < 2 * n_; ++i) {
    f(ends + i, i, 1.0);
    f(ends + 2 * n_ + i, q_of(N_) + i, 1.0);
  }
  for (Index i = 0; i < 3 * n_ * (N_ + 1); ++i) f(ends + 4 * n_ + i, i, 1.0);
  for (Index k = 1; each_ > 0 && k < N_; ++k)
    for (Index i = 0; i < each_; ++i)
      for (Index j = 0; j < n_; ++j)
        f(first_distance() + each_ * (k - 1) + i, q_of(k) + j,
          distance_scale * gradients_[static_cast<std::size_t>(k)](j, i));
}

std::vector<NonlinearProgram::Entry> Trapezoidal::jacobian_entries() const {
  std::vector<Entry> out;
  for_each_entry([&](Index r, Index c, double) { out.push_back({r, c}); });
  return out;
}

void Trapezoidal::jacobian(double* values) const {
  for_each_entry([&](Index, Index, double x) { *values++ = x; });
}

double Trapezoidal::violation() const {
  return std::max((lower_ - values_).maxCoeff(), (values_ - upper_).maxCoeff());
}

Eigen::MatrixXd Trapezoidal::torques() const {
  MatrixXd out(n_, N_ + 1);
  for (Index k = 0; k <= N_; ++k) out.col(k) = x_.segment(tau_of(k), n_);
  return out;
}

}  // namespace hamelin::optimal
