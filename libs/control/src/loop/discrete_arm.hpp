#pragma once
#include <Eigen/Core>
#include <memory>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/model/model.hpp"

namespace hamelin::control {

/// An arm that makes exactly the steps of an integrator, each with the channels that are set at its
/// node. A step can be tried before it is made. It belongs to a simulation, and a Controller drives
/// it. No allocation after the first step.
class DiscreteArm {
 public:
  /// @param model kept by reference
  /// @param own viscous damping and dry friction of the joints themselves
  DiscreteArm(const model::Model& model, std::unique_ptr<integration::Integrator> integrator,
              const integration::Channels& own);

  void start(const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  /// From this node on the model is another one. It has changed in place.
  void take_load(std::unique_ptr<integration::Integrator> integrator);
  /// Adds an impulse at the node [Nm s or N s].
  void kick(const Eigen::VectorXd& impulse);

  /// Makes the step on a copy. @return whether it converged; then see next_q() and next_v()
  [[nodiscard]] bool try_step(double step_s);
  [[nodiscard]] const Eigen::VectorXd& next_q() const noexcept { return next_.q; }
  [[nodiscard]] const Eigen::VectorXd& next_v() const noexcept { return next_v_; }
  /// The step that was tried will not be made.
  void forget_trial() noexcept { tried_ = false; }
  /// Makes the step, or takes over the one that was tried. @return whether it converged; if not,
  /// the state is unchanged
  [[nodiscard]] bool step(double step_s);
  /// Of the last step, made or tried.
  [[nodiscard]] const integration::StepReport& report() const noexcept { return report_; }

  const model::Model& model;
  dynamics::Workspace ws;
  std::unique_ptr<integration::Integrator> integrator;
  Eigen::VectorXd own_damping;  ///< viscous, of the joints themselves; size zero: none
  integration::State state;
  Eigen::VectorXd v;  ///< at the node
  integration::Channels
      channels;  ///< of the next step, friction and damping of the joints included
  /// What a control potential does at the end of the next step, docs/theory.md (8.1) [Nm s or N s].
  Eigen::VectorXd closing_kick;
  bool closes_with_kick = false;
  /// The node as the drive leaves it, for accounts.
  struct Departure {
    integration::Energy energy;  ///< before a node velocity is set or an impulse is added
    Eigen::VectorXd set_v;       ///< the velocity that the node was set to, within limits
    Eigen::VectorXd v;           ///< with which the arm leaves it
    bool potential = false;      ///< whether a control potential acts
  } departure;

 private:
  integration::State next_;
  Eigen::VectorXd next_v_;
  integration::StepReport report_;
  bool tried_ = false;
};

}  // namespace hamelin::control
