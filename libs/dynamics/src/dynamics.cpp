#include "hamelin/dynamics/dynamics.hpp"

#include "hamelin/dynamics/kernel/dispatch.hpp"
#include "kernels.hpp"

namespace hamelin::dynamics {

namespace {

std::size_t sweep_bytes(const Model& model, const KernelSet& set) {
  return kernel::with_group(model, set,
                            [&](const auto& sweeps, const auto& chain) { return sweeps.bytes(chain.links.size()); });
}

std::size_t batch_bytes(const Model& model, const KernelSet& set) {
  return kernel::with_group(
      model, set, [&](const auto& sweeps, const auto& chain) { return sweeps.batch_bytes(chain.links.size()); });
}

}  // namespace

Workspace::Workspace(const Model& model)
    : kernels(&dynamics::kernels()),
      sweep(sweep_bytes(model, *kernels)),
      frames(static_cast<std::size_t>(model.dof())),
      motions(static_cast<std::size_t>(model.dof())),
      forces(static_cast<std::size_t>(model.dof())),
      column_in(model.dof()),
      column_out(model.dof()) {}

BatchWorkspace::BatchWorkspace(const Model& model)
    : kernels(&dynamics::kernels()), sweep(batch_bytes(model, *kernels)) {}

void inverse_dynamics(const Model& model, Workspace& ws, const VectorXd& q, const VectorXd& v, const VectorXd& a,
                      VectorXd& tau) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.inverse_dynamics(chain, ws.sweep.get(), q.data(), v.data(), a.data(), tau.data());
  });
}

void forward_dynamics(const Model& model, Workspace& ws, const VectorXd& q, const VectorXd& v, const VectorXd& tau,
                      VectorXd& a) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.forward_dynamics(chain, ws.sweep.get(), q.data(), v.data(), tau.data(), a.data());
  });
}

void bias_torque(const Model& model, Workspace& ws, const VectorXd& q, const VectorXd& v, VectorXd& tau) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.inverse_dynamics(chain, ws.sweep.get(), q.data(), v.data(), nullptr, tau.data());
  });
}

void gravity_torque(const Model& model, Workspace& ws, const VectorXd& q, VectorXd& tau) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.gravity_torque(chain, ws.sweep.get(), q.data(), tau.data());
  });
}

void solve_mass(const Model& model, Workspace& ws, const VectorXd& q, const VectorXd& y, VectorXd& x) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.solve_mass(chain, ws.sweep.get(), q.data(), y.data(), x.data());
  });
}

void momentum(const Model& model, Workspace& ws, const VectorXd& q, const VectorXd& v, VectorXd& p) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.momentum(chain, ws.sweep.get(), q.data(), v.data(), p.data());
  });
}

void mass_matrix(const Model& model, Workspace& ws, const VectorXd& q, Eigen::MatrixXd& M) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.mass_matrix(chain, ws.sweep.get(), q.data(), M.data(), static_cast<std::size_t>(M.outerStride()));
  });
}

double kinetic_energy(const Model& model, Workspace& ws, const VectorXd& q, const VectorXd& v) {
  return kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    return sweeps.kinetic_energy(chain, ws.sweep.get(), q.data(), v.data());
  });
}

double potential_energy(const Model& model, Workspace& ws, const VectorXd& q) {
  return kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    return sweeps.potential_energy(chain, ws.sweep.get(), q.data()) + chain.potential_constant;
  });
}

void inverse_dynamics(const Model& model, BatchWorkspace& ws, const StatesXd& q, const StatesXd& v, const StatesXd& a,
                      StatesXd& tau) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    const auto states = static_cast<std::size_t>(q.cols());
    sweeps.inverse_dynamics_batch(chain, ws.sweep.get(), states, states, q.data(), v.data(), a.data(), tau.data());
  });
}

void forward_dynamics(const Model& model, BatchWorkspace& ws, const StatesXd& q, const StatesXd& v, const StatesXd& tau,
                      StatesXd& a) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    const auto states = static_cast<std::size_t>(q.cols());
    sweeps.forward_dynamics_batch(chain, ws.sweep.get(), states, states, q.data(), v.data(), tau.data(), a.data());
  });
}

}  // namespace hamelin::dynamics
