#pragma once
#include <cstddef>

#include "hamelin/core/isa.hpp"
#include "hamelin/dynamics/kernel/groups.hpp"

namespace hamelin::dynamics {

/// The sweeps of kernel/sweeps.hpp for one group, compiled for one instruction set. `memory` has
/// the size that `bytes` returns and is aligned to 64; joint vectors have one number per link. A
/// batch is computed in packets of native_lanes states. Its numbers are stored joint by joint, with
/// those of all states adjacent and `stride` numbers from one joint to the next.
template <class Chain>
struct Kernels {
  std::size_t (*bytes)(std::size_t links) noexcept;
  void (*inverse_dynamics)(const Chain&, void* memory, const double* q, const double* v,
                           const double* a, double* tau) noexcept;
  void (*forward_dynamics)(const Chain&, void* memory, const double* q, const double* v,
                           const double* tau, double* a) noexcept;
  void (*gravity_torque)(const Chain&, void* memory, const double* q, double* tau) noexcept;
  void (*solve_mass)(const Chain&, void* memory, const double* q, const double* y,
                     double* x) noexcept;
  /// Stores factors in memory for solve_factored.
  void (*factor)(const Chain&, void* memory, const double* q) noexcept;
  void (*solve_factored)(const Chain&, void* memory, const double* y, double* x) noexcept;
  void (*momentum)(const Chain&, void* memory, const double* q, const double* v,
                   double* p) noexcept;
  double (*kinetic_energy)(const Chain&, void* memory, const double* q, const double* v) noexcept;
  double (*potential_energy)(const Chain&, void* memory, const double* q) noexcept;
  void (*mass_matrix)(const Chain&, void* memory, const double* q, double* M,
                      std::size_t ld) noexcept;

  std::size_t lanes;
  std::size_t (*batch_bytes)(std::size_t links) noexcept;
  void (*inverse_dynamics_batch)(const Chain&, void* memory, std::size_t states, std::size_t stride,
                                 const double* q, const double* v, const double* a,
                                 double* tau) noexcept;
  void (*forward_dynamics_batch)(const Chain&, void* memory, std::size_t states, std::size_t stride,
                                 const double* q, const double* v, const double* tau,
                                 double* a) noexcept;
};

/// The kernels for all kinds of chains, for one instruction set.
struct KernelSet : kernel::Groups<Kernels> {};

/// @throws Error usage if this machine does not have the instruction set
[[nodiscard]] const KernelSet& kernels(Isa isa);

}  // namespace hamelin::dynamics
