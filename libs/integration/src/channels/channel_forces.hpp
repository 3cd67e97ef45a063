#pragma once
#include <array>

#include "hamelin/integration/integrator.hpp"
#include "wrench_forces.hpp"

namespace hamelin::integration {

/// The generalised force of the channels and its parts, docs/theory.md (8.2), for the schemes that
/// work on joint vectors. (The kernels of gauss and hamel-variational use kernel/forces.hpp.)
class ChannelForces {
 public:
  /// Both must outlive this. @param wrenches of the current step
  ChannelForces(const Model& model, WrenchForces& wrenches);
  ChannelForces(const ChannelForces&) = delete;
  ChannelForces& operator=(const ChannelForces&) = delete;

  /// The force at (q, v), valid until the next call.
  const VectorXd& evaluate(const Channels& channels, dynamics::Workspace& ws, const VectorXd& q,
                           const VectorXd& v) {
    if (any_ || !channels.none()) sum(channels, ws, q, v);  // otherwise it is zero already
    return total_;
  }
  [[nodiscard]] const VectorXd& total() const noexcept { return total_; }
  /// Adds the work of the last evaluated force over the displacement, times weight, to the report.
  void add_work(StepReport& report, const VectorXd& displacement, double weight) const {
    if (any_) sum_work(report, displacement, weight);
  }

 private:
  void sum(const Channels& channels, dynamics::Workspace& ws, const VectorXd& q, const VectorXd& v);
  void sum_work(StepReport& report, const VectorXd& displacement, double weight) const;

  struct Part {
    double StepReport::*account;  ///< the entry of the report for its work
    double sign;                  ///< −1 for dissipating forces
    bool active = false;
    VectorXd force{};
  };
  const Model& model_;
  WrenchForces& wrenches_;
  bool any_ = false;
  VectorXd total_;
  Part held_{&StepReport::held_work_J, 1.0}, damping_{&StepReport::dissipated_J, -1.0},
      coulomb_{&StepReport::dissipated_J, -1.0}, gyroscopic_{&StepReport::gyroscopic_work_J, 1.0},
      external_{&StepReport::external_work_J, 1.0};
  std::array<Part*, 5> parts_{&held_, &damping_, &coulomb_, &gyroscopic_, &external_};
};

}  // namespace hamelin::integration
