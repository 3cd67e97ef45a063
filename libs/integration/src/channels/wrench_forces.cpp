#include "wrench_forces.hpp"

#include <cmath>
#include <utility>

namespace hamelin::integration {

namespace {

// Memory for this number of wrenches is reserved, so that steps do not allocate.
constexpr std::size_t reserved_wrenches = 64;

}  // namespace

WrenchForces::WrenchForces(const Model& model, dynamics::Workspace& ws) : model_(model), ws_(ws) {
  for (auto* x : {&q_, &v_, &torque_}) *x = VectorXd::Zero(model.dof());
  wrenches_.reserve(reserved_wrenches);
}

void WrenchForces::begin(const Channels& channels) {
  channels_ = &channels;
  wrenches_.assign(channels.wrenches.begin(), channels.wrenches.end());
}

void WrenchForces::end() {
  channels_ = nullptr;
  if (thrown_) std::rethrow_exception(std::exchange(thrown_, nullptr));
}

// Kernels must not be left by an exception. The step that finds no number fails.
const VectorXd& WrenchForces::evaluate(const VectorXd& q, const VectorXd& v) {
  try {
    dynamics::forward_kinematics(model_, ws_, q);
    if (channels_->wrench_law && !thrown_) channels_->wrench_law(ws_, q, v, wrenches_);
    dynamics::external_torque(model_, ws_, wrenches_, torque_);
  } catch (...) {
    thrown_ = std::current_exception();
  }
  if (thrown_) torque_.setConstant(std::nan(""));
  return torque_;
}

kernel::ExternalTorque WrenchForces::for_kernels() noexcept {
  if (wrenches_.empty()) return {};
  return {[](void* self, const double* q, const double* v, double* tau) noexcept {
            auto& forces = *static_cast<WrenchForces*>(self);
            const Eigen::Index n = forces.model_.dof();
            forces.q_ = VectorXd::Map(q, n);
            forces.v_ = VectorXd::Map(v, n);
            VectorXd::Map(tau, n) = forces.evaluate(forces.q_, forces.v_);
          },
          this};
}

}  // namespace hamelin::integration
