#include "hamelin/optimal/timed_motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "discrete_lagrangian.hpp"
#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::optimal {

using Eigen::Index;

void TimedMotion::at(double time_s, VectorXd& q_out, VectorXd& v_out, VectorXd& a_out) const {
  const double place = std::clamp(time_s / step_s, 0.0, static_cast<double>(knots() - 1));
  const Index k = std::min(static_cast<Index>(place), knots() - 2);
  const double s = place - static_cast<double>(k), h = step_s;
  // coefficients of s³, s⁴ and s⁵ that meet position, velocity and acceleration at the next knot
  const VectorXd v0 = h * v.col(k), a0 = h * h * a.col(k),
                 dq = q.col(k + 1) - q.col(k) - v0 - 0.5 * a0, dv = h * v.col(k + 1) - v0 - a0,
                 da = h * h * a.col(k + 1) - a0;
  const VectorXd c3 = 10.0 * dq - 4.0 * dv + 0.5 * da, c4 = -15.0 * dq + 7.0 * dv - da,
                 c5 = 6.0 * dq - 3.0 * dv + 0.5 * da;
  q_out = q.col(k) + s * (v0 + s * (0.5 * a0 + s * (c3 + s * (c4 + s * c5))));
  v_out = (v0 + s * (a0 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))) / h;
  a_out = (a0 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))) / (h * h);
}

TimedMotion motion_of(const Problem& problem, const Solution& solution) {
  const model::Model& model = *problem.model;
  const Index n = model.dof(), N = solution.q.cols() - 1;
  TimedMotion out;
  out.step_s = solution.step_s;
  out.q = solution.q;
  out.torque = solution.torque;
  out.v = out.a = MatrixXd::Zero(n, N + 1);
  DiscreteLagrangian lagrangian(model);
  DiscreteLagrangian::Derivatives at(n);
  dynamics::Workspace ws(model);
  VectorXd x(n);
  out.v.col(0) = problem.v_start;
  for (Index k = 1; k < N; ++k) {
    lagrangian.evaluate(out.q.col(k), out.q.col(k + 1), out.step_s, at);
    const VectorXd p = -at.a - 0.5 * out.step_s * out.torque.col(k);
    dynamics::solve_mass(model, ws, VectorXd(out.q.col(k)), p, x);
    out.v.col(k) = x;
  }
  out.v.col(N) = problem.v_goal;
  for (Index k = 0; k <= N; ++k) {
    dynamics::forward_dynamics(model, ws, VectorXd(out.q.col(k)), VectorXd(out.v.col(k)),
                               VectorXd(out.torque.col(k)), x);
    out.a.col(k) = x;
  }
  return out;
}

MotionProof prove(const TimedMotion& motion, control::WorldView& view, double sample_s) {
  const double duration = motion.duration_s();
  const auto pieces = static_cast<long>(std::ceil(duration / sample_s - 1e-9));
  MotionProof out;
  out.sample_s = duration / static_cast<double>(pieces);
  out.margin_m = std::numeric_limits<double>::infinity();
  VectorXd q, v, a;
  motion.at(0.0, q, v, a);
  view.look(q, 0.0);
  view.depart(q, v);
  for (long i = 1; i <= pieces; ++i) {
    const double time = out.sample_s * static_cast<double>(i);
    motion.at(time, q, v, a);
    view.look(q, time);
    const auto verdict = view.certify(q, v);
    out.margin_m = std::min(out.margin_m, verdict.margin_m);
    if (!verdict.certified && out.certified) {
      out.certified = false;
      out.first_open_s = time - out.sample_s;
    }
    view.depart(q, v);
  }
  return out;
}

}  // namespace hamelin::optimal
