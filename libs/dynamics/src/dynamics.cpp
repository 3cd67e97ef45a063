#include "hamelin/dynamics/dynamics.hpp"

#include <cstdint>
#include <cstdlib>

#include "hamelin/core/error.hpp"
#include "hamelin/core/formatted.hpp"
#include "hamelin/dynamics/kernel/dispatch.hpp"
#include "kernels.hpp"

namespace hamelin::dynamics {

namespace {

std::size_t sweep_bytes(const Model& model, const KernelSet& set) {
  return kernel::with_group(model, set, [&](const auto& sweeps, const auto& chain) {
    return sweeps.bytes(chain.links.size());
  });
}

std::size_t batch_bytes(const Model& model, const KernelSet& set) {
  return kernel::with_group(model, set, [&](const auto& sweeps, const auto& chain) {
    return sweeps.batch_bytes(chain.links.size());
  });
}

}  // namespace

WorkspaceOwner::WorkspaceOwner(const Model& model) : id(model.id()), dof(model.dof()) {
  if (id == 0)
    throw Error(ErrorCode::usage,
                "a workspace: the model was moved from, expected a model to make it for");
}

Workspace::Workspace(const Model& model, Isa isa)
    : owner(model),
      kernels(&dynamics::kernels(isa)),
      sweep(sweep_bytes(model, *kernels)),
      frames(static_cast<std::size_t>(model.dof())),
      motions(static_cast<std::size_t>(model.dof())),
      forces(static_cast<std::size_t>(model.dof())),
      column_in(model.dof()),
      column_out(model.dof()) {}

BatchWorkspace::BatchWorkspace(const Model& model, Isa isa)
    : owner(model), kernels(&dynamics::kernels(isa)), sweep(batch_bytes(model, *kernels)) {}

namespace detail {

void refuse_workspace(const char* function, const Model& model, const WorkspaceOwner& owner) {
  if (owner.id == WorkspaceOwner::no_model)
    throw Error(ErrorCode::usage,
                formatted("{}: the workspace was moved from, expected one made for this '{}'",
                          function, model.robot().name));
  if (owner.id == model.id())
    throw Error(ErrorCode::usage,
                formatted("{}: the workspace has no poses yet, expected a call of "
                          "forward_kinematics before",
                          function));
  throw Error(ErrorCode::usage, formatted("{}: the workspace was made for another model (of {} "
                                          "joints), expected one made for this '{}' "
                                          "(of {} joints) or a copy of it",
                                          function, owner.dof, model.robot().name, model.dof()));
}

void refuse_size(const char* function, const char* argument, Eigen::Index given,
                 Eigen::Index expected) {
  throw Error(ErrorCode::usage, formatted("{}: {}: {} given, expected {} (one per joint)", function,
                                          argument, given, expected));
}

void refuse_states(const char* function, const char* argument, Eigen::Index rows, Eigen::Index cols,
                   Eigen::Index stride, Eigen::Index dof, Eigen::Index states,
                   Eigen::Index expected) {
  throw Error(ErrorCode::usage,
              formatted("{}: {}: {} x {} numbers with row stride {} given, expected {} x {} "
                        "(joints x states) with row "
                        "stride {}",
                        function, argument, rows, cols, stride, dof, states, expected));
}

void refuse_link(const char* function, int link, Eigen::Index dof) {
  throw Error(ErrorCode::usage, formatted("{}: link: {} given, expected an index from 0 to {}",
                                          function, link, dof - 1));
}

void refuse_count(const char* function, const char* argument, std::size_t given,
                  std::size_t expected) {
  throw Error(ErrorCode::usage,
              formatted("{}: {}: room for {} given, expected {} (one per collision shape)",
                        function, argument, given, expected));
}

void refuse_overlap(const char* function, const char* result, const char* argument) {
  throw Error(ErrorCode::usage,
              formatted("{}: {}: overlaps {} in part, expected the same numbers or none", function,
                        result, argument));
}

// Numbers (r, c) of the one and (r', c') of the other are the same if their distance b − a is
// (r − r') stride + c − c'.
bool overlap_in_part(const double* a, const double* b, Eigen::Index rows, Eigen::Index cols,
                     Eigen::Index stride) noexcept {
  if (a == b || rows == 0 || cols == 0) return false;
  const auto bytes = static_cast<std::intptr_t>(reinterpret_cast<std::uintptr_t>(b) -
                                                reinterpret_cast<std::uintptr_t>(a));
  const Eigen::Index distance = bytes / static_cast<std::intptr_t>(sizeof(double)),
                     row = distance / stride;
  for (const Eigen::Index k : {row - 1, row, row + 1})
    if (std::abs(k) < rows && std::abs(distance - k * stride) < cols) return true;
  return false;
}

void inverse_dynamics(const Model& model, Workspace& ws, const double* q, const double* v,
                      const double* a, double* tau) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.inverse_dynamics(chain, ws.sweep.get(), q, v, a, tau);
  });
}

void forward_dynamics(const Model& model, Workspace& ws, const double* q, const double* v,
                      const double* tau, double* a) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.forward_dynamics(chain, ws.sweep.get(), q, v, tau, a);
  });
}

void gravity_torque(const Model& model, Workspace& ws, const double* q, double* tau) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.gravity_torque(chain, ws.sweep.get(), q, tau);
  });
}

void solve_mass(const Model& model, Workspace& ws, const double* q, const double* y, double* x) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.solve_mass(chain, ws.sweep.get(), q, y, x);
  });
}

void momentum(const Model& model, Workspace& ws, const double* q, const double* v, double* p) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.momentum(chain, ws.sweep.get(), q, v, p);
  });
}

void mass_matrix(const Model& model, Workspace& ws, const double* q, double* M,
                 Eigen::Index stride) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.mass_matrix(chain, ws.sweep.get(), q, M, static_cast<std::size_t>(stride));
  });
}

double kinetic_energy(const Model& model, Workspace& ws, const double* q, const double* v) {
  return kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    return sweeps.kinetic_energy(chain, ws.sweep.get(), q, v);
  });
}

double potential_energy(const Model& model, Workspace& ws, const double* q) {
  return kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    return sweeps.potential_energy(chain, ws.sweep.get(), q) + chain.potential_constant;
  });
}

void inverse_dynamics(const Model& model, BatchWorkspace& ws, Eigen::Index states,
                      Eigen::Index stride, const double* q, const double* v, const double* a,
                      double* tau) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.inverse_dynamics_batch(chain, ws.sweep.get(), static_cast<std::size_t>(states),
                                  static_cast<std::size_t>(stride), q, v, a, tau);
  });
}

void forward_dynamics(const Model& model, BatchWorkspace& ws, Eigen::Index states,
                      Eigen::Index stride, const double* q, const double* v, const double* tau,
                      double* a) {
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.forward_dynamics_batch(chain, ws.sweep.get(), static_cast<std::size_t>(states),
                                  static_cast<std::size_t>(stride), q, v, tau, a);
  });
}

}  // namespace detail

}  // namespace hamelin::dynamics
