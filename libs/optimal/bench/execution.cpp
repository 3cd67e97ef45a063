#include "execution.hpp"

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/optimal/timed_motion.hpp"

namespace hamelin::optimal {

using Eigen::Index;

double executed_error(const Problem& problem, const MatrixXd& torque, double h, bool held) {
  const auto plant = integration::make_integrator("gauss:8", *problem.model);
  auto state = plant->start(problem.q_start, problem.v_start);
  const int parts = held ? 10 : 100;
  integration::Channels channels;
  for (Index k = 0; k + 1 < torque.cols(); ++k)
    for (int i = 0; i < parts; ++i) {
      const double at = (i + 0.5) / parts, s = !held ? at : at < 0.5 ? 0.0 : 1.0;
      channels.held_torque = (1.0 - s) * torque.col(k) + s * torque.col(k + 1);
      if (!plant->step(state, channels, h / parts).converged) return 1e9;
    }
  return (state.q - problem.q_goal).lpNorm<Eigen::Infinity>();
}

double motion_error(const Problem& problem, const Solution& found) {
  const TimedMotion motion{found.step_s, found.control};
  constexpr Index parts = 20;
  dynamics::Workspace ws(*problem.model);
  MatrixXd torque(problem.q_start.size(), parts * motion.intervals() + 1);
  VectorXd at(problem.q_start.size());
  for (Index i = 0; i < torque.cols(); ++i) {
    torque_at(*problem.model, ws, motion, found.step_s * static_cast<double>(i) / parts, at);
    torque.col(i) = at;
  }
  return executed_error(problem, torque, found.step_s / parts, false);
}

}  // namespace hamelin::optimal
