#pragma once
#include <Eigen/Core>
#include <memory>

#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

/// Derivatives of a step (q, p) → (q⁺, p⁺): rows of q⁺ first, then rows of p⁺.
struct StepDerivatives {
  explicit StepDerivatives(Eigen::Index dof);
  double step_s = 0.0;        ///< the step's length h
  Eigen::MatrixXd by_state;   ///< ∂(q⁺, p⁺)/∂(q, p), 2 dof × 2 dof
  Eigen::MatrixXd by_torque;  ///< ∂(q⁺, p⁺)/∂u of the held torque, 2 dof × dof
  Eigen::VectorXd by_step;    ///< ∂(q⁺, p⁺)/∂h, 2 dof
};

/// Differentiates the steps of hamel-variational, or of gauss in its structure mode, exactly, by
/// the implicit function theorem at the step's solution, which the state remembers: docs/theory.md
/// (4.31)–(4.33), (5.19)–(5.22). An object belongs to one thread; it allocates nothing after its
/// construction. The model must outlive it.
class StepDifferentiator {
 public:
  virtual ~StepDifferentiator() = default;
  StepDifferentiator(const StepDifferentiator&) = delete;
  StepDifferentiator& operator=(const StepDifferentiator&) = delete;

  /// The derivatives of the last undivided step that led to a state. A step that was divided
  /// (StepReport::halvings) is several; StepDerivatives::step_s tells.
  /// @param after a state after a step of the scheme, with the options of this object
  /// @param channels those of the step, without a wrench law
  /// @param out made for as many joints; it cannot share memory with the other arguments
  /// @throws Error usage for sizes that do not fit, a state of another scheme or model
  ///         (StateOwner), or one that has not stepped since it was made or kicked or its velocity
  ///         was set; invalid if the derivative does not exist
  void differentiate(const State& after, const Channels& channels, StepDerivatives& out);

 protected:
  StepDifferentiator(const Model& model, const Options& options);
  /// The length of the last step; 0 if the state does not remember one of this scheme.
  [[nodiscard]] virtual double last_step(const State& after) const = 0;
  /// @return false if the derivative does not exist
  [[nodiscard]] virtual bool compute(const State& after, const Channels& channels,
                                     StepDerivatives& out) = 0;

  const Model& model_;
  const StateOwner owner_;
};

/// @throws Error usage for a scheme other than hamel-variational and gauss, and as make_options
[[nodiscard]] std::unique_ptr<StepDifferentiator> make_step_differentiator(const Model& model,
                                                                           const Options& options);
std::unique_ptr<StepDifferentiator> make_step_differentiator(const Model&&,
                                                             const Options&) = delete;

}  // namespace hamelin::integration
