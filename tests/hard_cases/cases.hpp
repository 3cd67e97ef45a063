#pragma once
#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include "hamelin/description/robot_io.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/model/make_chain.hpp"

/// Motions that are hard for integrators (docs/hard_cases.md), shared by the tests and by the table
/// of their figures.
namespace hamelin::hard_cases {

using Eigen::VectorXd;

/// The result of a motion.
struct Outcome {
  bool completed = true;  ///< if not, a step found no root and the motion ended there
  long steps = 0;
  double energy_error_J = 0.0;  ///< largest |E − E₀|
  double energy_scale_J = 0.0;  ///< largest kinetic energy
  /// Largest error of the second half over that of the first; about 1 without drift.
  double late_over_early = 0.0;
  double updates_mean = 0.0, factorizations_mean = 0.0;
  int updates_max = 0;
  long halvings = 0;
  double deepest = 0.0;  ///< largest depth inside a barrier [rad]
  VectorXd q;            ///< at the end
};

/// A potential of the joints that acts as half-kicks at both nodes of a step, as that of a planner
/// does.
struct Barrier {
  std::function<double(const VectorXd& q, VectorXd& gradient)> potential;
  std::function<double(const VectorXd& q)> depth;
};

struct Motion {
  std::string name;
  model::Model model;
  VectorXd q0, v0;
  double step_s = 1e-3;
  long steps = 1000;
  long energy_every = 1;  ///< steps between energy samples
  Barrier barrier{};
};

inline Outcome run(const Motion& motion, const std::string& scheme,
                   const integration::Parameters& parameters = {}) {
  const auto integrator = integration::make_integrator(scheme, motion.model, parameters);
  auto state = integrator->start(motion.q0, motion.v0);
  const int n = motion.model.dof();
  VectorXd gradient = VectorXd::Zero(n), kick(n);
  Outcome out;
  double value = motion.barrier.potential ? motion.barrier.potential(state.q, gradient) : 0.0;
  const double first = integrator->energy(state).total() + value;
  double early = 0.0, late = 0.0, updates = 0.0, factorizations = 0.0;
  for (long k = 0; k < motion.steps; ++k) {
    const auto half_kick = [&] {
      kick = -0.5 * motion.step_s * gradient;
      integrator->kick(state, kick);
    };
    if (motion.barrier.potential && !gradient.isZero(0.0)) half_kick();
    const auto report = integrator->step(state, {}, motion.step_s);
    updates += report.updates;
    factorizations += report.factorizations;
    out.updates_max = std::max(out.updates_max, report.updates);
    out.halvings += report.halvings;
    if (!report.converged) {
      out.completed = false;
      break;
    }
    ++out.steps;
    if (motion.barrier.potential) {
      value = motion.barrier.potential(state.q, gradient);
      if (!gradient.isZero(0.0)) half_kick();
      out.deepest = std::max(out.deepest, motion.barrier.depth(state.q));
    }
    if (out.steps % motion.energy_every != 0) continue;
    const auto energy = integrator->energy(state);
    const double error = std::abs(energy.total() + value - first);
    out.energy_scale_J = std::max(out.energy_scale_J, energy.kinetic_J);
    auto& half = 2 * out.steps <= motion.steps ? early : late;
    half = std::isfinite(error) ? std::max(half, error) : INFINITY;
  }
  const auto counted = static_cast<double>(std::max(1L, out.steps));
  out.updates_mean = updates / counted;
  out.factorizations_mean = factorizations / counted;
  out.energy_error_J = std::max(early, late);
  out.late_over_early = early > 0.0 ? late / early : 0.0;
  out.q = state.q;
  return out;
}

/// Step control with the same relative and absolute tolerance.
inline integration::Parameters controlled(double tolerance) {
  integration::Parameters parameters;
  parameters.rtol = parameters.atol = tolerance;
  return parameters;
}

/// The end of the motion by dop853 at a tolerance of 1e-12. It shares neither stages nor step
/// lengths with a variational step, nor its equations, because it uses the articulated-body
/// algorithm. Not for barriers.
inline VectorXd reference_end(const Motion& motion) {
  const auto integrator = integration::make_integrator("dop853", motion.model, controlled(1e-12));
  auto state = integrator->start(motion.q0, motion.v0);
  const auto report =
      integrator->step(state, {}, motion.step_s * static_cast<double>(motion.steps));
  return report.converged ? state.q : VectorXd::Constant(state.q.size(), std::nan(""));
}

inline model::Robot chain(int links, const std::string& axes = "x,z,x") {
  return model::make_chain({links, axes, 0.2, 1.0, 0.03});
}

/// A stretched arm is released from this singular pose.
inline Motion stretched(int links, double step_s, long steps) {
  return {
      "stretched", model::Model(chain(links)), VectorXd::Zero(links), VectorXd::Zero(links), step_s,
      steps};
}

/// No gravity: every joint turns past π again and again.
inline Motion turn_through_half_turns(double step_s, long steps) {
  return {"turning",
          model::Model(chain(3, "x,y,z"), geometry::SE3{}, Eigen::Vector3d::Zero()),
          VectorXd::Constant(3, 3.0),  // near π
          (VectorXd(3) << 6.0, -4.0, 5.0).finished(),
          step_s,
          steps};
}

/// A 7-link arm with one link that is a million times as heavy as the others.
inline Motion mass_ratio(std::size_t heavy_link, double step_s, long steps) {
  model::Robot robot = chain(7);
  robot.links[heavy_link].mass_kg *= 1e6;
  robot.links[heavy_link].inertia_kg_m2 *= 1e6;
  const VectorXd q0 = (VectorXd(7) << 0.3, -0.25, 0.4, -0.15, 0.5, -0.05, 0.6).finished();
  return {"mass ratio", model::Model(robot), q0, VectorXd::Zero(7), step_s, steps};
}

/// Example 5.1's arm falls on a spring that begins at q₁ = −0.5 rad: ½ stiffness (q₁ + 0.5)².
inline Motion falling_on_barrier(double stiffness, double step_s, long steps) {
  const auto depth = [](const VectorXd& q) { return std::max(0.0, -0.5 - q[0]); };
  Motion motion{
      "barrier",
      model::Model(description::read_robot(HAMELIN_SOURCE_DIR "/data/robots/planar3.json")),
      VectorXd::Zero(3),
      VectorXd::Zero(3),
      step_s,
      steps};
  motion.barrier.depth = depth;
  motion.barrier.potential = [depth, stiffness](const VectorXd& q, VectorXd& gradient) {
    const double d = depth(q);
    gradient.setZero();
    gradient[0] = -stiffness * d;
    return 0.5 * stiffness * d * d;
  };
  return motion;
}

/// Example 5.1 of the paper, 10⁶ steps of 10 ms.
inline Motion million_steps() {
  Motion motion{
      "10^6 steps",
      model::Model(description::read_robot(HAMELIN_SOURCE_DIR "/data/robots/planar3.json")),
      VectorXd::Zero(3),
      VectorXd::Zero(3),
      0.01,
      1000000};
  motion.energy_every = 7;  // unrelated to any period of the motion
  return motion;
}

}  // namespace hamelin::hard_cases
