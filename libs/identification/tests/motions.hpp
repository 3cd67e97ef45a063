#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <numbers>
#include <stdexcept>
#include <utility>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/identification/fit.hpp"
#include "hamelin/identification/record.hpp"
#include "hamelin/identification/samples.hpp"
#include "hamelin/integration/integrator.hpp"

/// Motions of simulated arms with their torques.
namespace hamelin::test {

/// A motion of a joint as a sum of sines, the first from 0.1 Hz on, within the joint's limits.
class SineMotion {
 public:
  struct State {
    Eigen::VectorXd q, v, a;
  };

  SineMotion(const model::Model& model, std::uint64_t seed) : middle_(model.dof()) {
    Rng rng(seed);
    const Eigen::Index dof = model.dof();
    amplitude_ = frequency_ = phase_ = Eigen::MatrixXd(dof, terms);
    for (Eigen::Index j = 0; j < dof; ++j) {
      const model::Joint& joint = model.robot().links[static_cast<std::size_t>(j)].joint;
      const double reach = joint.type == model::JointType::prismatic ? 0.3 : 1.2;
      const double low = std::max(joint.lower.value_or(-reach), -reach),
                   high = std::min(joint.upper.value_or(reach), reach);
      middle_[j] = 0.5 * (low + high);
      for (Eigen::Index i = 0; i < terms; ++i) {
        amplitude_(j, i) =
            0.45 * (high - low) * rng.uniform(0.5, 1.0) / (1.0 + static_cast<double>(i)) / 1.9;
        frequency_(j, i) =
            2.0 * std::numbers::pi * (0.1 + 0.17 * static_cast<double>(i) * rng.uniform(0.8, 1.2));
        phase_(j, i) = rng.uniform(0.0, 2.0 * std::numbers::pi);
      }
    }
  }

  [[nodiscard]] State at(double t) const {
    const Eigen::ArrayXXd angle = frequency_.array() * t + phase_.array();
    return {
        middle_ + (amplitude_.array() * angle.sin()).matrix().rowwise().sum(),
        (amplitude_.array() * frequency_.array() * angle.cos()).matrix().rowwise().sum(),
        -(amplitude_.array() * frequency_.array().square() * angle.sin()).matrix().rowwise().sum()};
  }

 private:
  static constexpr Eigen::Index terms = 4;
  Eigen::VectorXd middle_;
  Eigen::MatrixXd amplitude_, frequency_, phase_;
};

constexpr double friction_speed = 0.01;

/// The torque of the motors for a state.
inline Eigen::VectorXd motor_torque(const model::Model& model, dynamics::Workspace& ws,
                                    const SineMotion::State& state) {
  Eigen::VectorXd tau(model.dof());
  dynamics::inverse_dynamics(model, ws, state.q, state.v, state.a, tau);
  for (Eigen::Index j = 0; j < tau.size(); ++j) {
    const model::Joint& joint = model.robot().links[static_cast<std::size_t>(j)].joint;
    tau[j] += joint.damping * state.v[j] + joint.friction * std::tanh(state.v[j] / friction_speed);
  }
  return tau;
}

struct Recording {
  double duration_s = 10.0, period_s = 1e-3;
  double q_noise = 0.0;    ///< standard deviation [rad or m]
  double tau_noise = 0.0;  ///< relative to the torque's root mean square
  std::uint64_t seed = 1;
};

/// The arm follows the motion by the torques of its model and of springs at the ticks, which are
/// held in between; the record has what is measured at the ticks.
inline identification::Record simulated_record(const model::Model& model, const SineMotion& motion,
                                               const Recording& options) {
  const auto ticks = static_cast<Eigen::Index>(std::round(options.duration_s / options.period_s));
  const int steps = std::max(1, static_cast<int>(std::round(options.period_s / 1e-3)));
  const double step_s = options.period_s / steps;
  const auto integrator = integration::make_integrator("hamel-variational", model, {});
  dynamics::Workspace ws(model);
  const Eigen::Index dof = model.dof();
  integration::Channels channels;
  channels.damping = channels.coulomb = channels.held_torque = Eigen::VectorXd::Zero(dof);
  channels.coulomb_speed = friction_speed;
  for (Eigen::Index j = 0; j < dof; ++j) {
    channels.damping[j] = model.robot().links[static_cast<std::size_t>(j)].joint.damping;
    channels.coulomb[j] = model.robot().links[static_cast<std::size_t>(j)].joint.friction;
  }
  auto state = integrator->start(motion.at(0.0).q, motion.at(0.0).v);
  identification::Record record;
  record.where = "simulated";
  record.q = record.held = Eigen::MatrixXd(dof, ticks);
  record.usable.assign(static_cast<std::size_t>(ticks), 1);
  Rng rng(options.seed);
  Eigen::VectorXd v(dof);
  Eigen::MatrixXd M(dof, dof);
  for (Eigen::Index k = 0; k < ticks; ++k) {
    const double t = static_cast<double>(k) * options.period_s;
    auto wanted = motion.at(t);
    integrator->velocity(state, v);
    constexpr double stiffness = 100.0, rate = 20.0;
    wanted.a += stiffness * (wanted.q - state.q) + rate * (wanted.v - v);
    channels.held_torque = motor_torque(model, ws, wanted);
    record.time_s.push_back(t);
    record.held.col(k) = channels.held_torque;
    record.q.col(k) = state.q;
    for (int i = 0; i < steps; ++i) {
      const auto report = integrator->step(state, channels, step_s);
      if (!report.converged) throw std::runtime_error("the simulated arm diverged");
    }
  }
  for (double& q : record.q.reshaped()) q += options.q_noise * rng.normal();
  if (options.tau_noise > 0.0)
    for (Eigen::Index j = 0; j < dof; ++j) {
      const double size =
          options.tau_noise * record.held.row(j).norm() / std::sqrt(static_cast<double>(ticks));
      for (double& tau : record.held.row(j)) tau += size * rng.normal();
    }
  return record;
}

/// The robot with masses and inertias that are wrong by a share, up and down in turn, and without
/// friction.
inline model::Robot wrong_prior(model::Robot robot, double share) {
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    const double factor = i % 2 == 0 ? 1.0 + share : 1.0 - share;
    robot.links[i].mass_kg *= factor;
    robot.links[i].inertia_kg_m2 *= factor;
    robot.links[i].joint.damping = robot.links[i].joint.friction = 0.0;
  }
  return robot;
}

/// The robot with friction.
inline model::Robot with_friction(model::Robot robot, double damping, double friction) {
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    const double share =
        1.0 - 0.8 * static_cast<double>(i) / static_cast<double>(robot.links.size());
    robot.links[i].joint.damping = damping * share;
    robot.links[i].joint.friction = friction * share;
  }
  return robot;
}

/// The errors of another robot's torques along a motion, against those of the true one.
inline identification::TorqueErrors errors_along(const model::Model& truth,
                                                 const model::Model& other,
                                                 const SineMotion& motion, double duration_s) {
  dynamics::Workspace ws(truth), other_ws(other);
  const Eigen::Index dof = truth.dof();
  Eigen::VectorXd differences = Eigen::VectorXd::Zero(dof), torques = differences;
  const int states = 2000;
  for (int k = 0; k < states; ++k) {
    const auto state = motion.at(duration_s * k / states);
    const Eigen::VectorXd tau = motor_torque(truth, ws, state);
    differences += (motor_torque(other, other_ws, state) - tau).cwiseAbs2();
    torques += tau.cwiseAbs2();
  }
  identification::TorqueErrors out;
  for (Eigen::Index j = 0; j < dof; ++j)
    out.joints.push_back(
        {std::sqrt(differences[j] / states), std::sqrt(differences[j] / torques[j])});
  out.all = {std::sqrt(differences.sum() / states), std::sqrt(differences.sum() / torques.sum())};
  return out;
}

/// The exact states and torques of a motion, `step_s` apart.
inline identification::Samples samples_along(const model::Model& model, const SineMotion& motion,
                                             int count, double step_s) {
  Eigen::MatrixXd q(model.dof(), count), v = q, a = q, tau = q;
  dynamics::Workspace ws(model);
  for (int k = 0; k < count; ++k) {
    const auto state = motion.at(step_s * k);
    q.col(k) = state.q;
    v.col(k) = state.v;
    a.col(k) = state.a;
    tau.col(k) = motor_torque(model, ws, state);
  }
  return identification::exact_samples(model, q, v, a, tau, friction_speed);
}

/// A robot of data/robots.
inline model::Robot data_robot(const std::filesystem::path& file) {
  const auto path = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/robots" / file;
  if (path.stem() == "panda") return description::read_robot(path, {"panda_grasptarget", {}});
  return description::read_robot(path);
}

}  // namespace hamelin::test
