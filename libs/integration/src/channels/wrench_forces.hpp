#pragma once
#include <exception>
#include <vector>

#include "hamelin/integration/integrator.hpp"
#include "kernel/forces.hpp"

namespace hamelin::integration {

/// The joint torques of a step's wrenches, docs/theory.md (2.37), at any state.
class WrenchForces {
 public:
  /// Both must outlive this.
  WrenchForces(const Model& model, dynamics::Workspace& ws);
  /// For the channels of the next step, which must stay until end().
  void begin(const Channels& channels);
  /// Throws what the wrench law has thrown.
  void end();
  /// At (q, v), valid until the next call; not a number once the law has thrown. Overwrites the
  /// poses of the workspace.
  const VectorXd& evaluate(const VectorXd& q, const VectorXd& v);
  /// The same for kernels; without wrenches it has no function.
  [[nodiscard]] kernel::ExternalTorque for_kernels() noexcept;

 private:
  const Model& model_;
  dynamics::Workspace& ws_;
  const Channels* channels_ = nullptr;
  std::vector<ExternalWrench> wrenches_;  ///< whose values the law sets
  std::exception_ptr thrown_;
  VectorXd q_, v_, torque_;
};

}  // namespace hamelin::integration
