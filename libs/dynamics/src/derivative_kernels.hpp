#pragma once
#include <cstddef>

#include "hamelin/core/isa.hpp"
#include "hamelin/dynamics/kernel/derivatives.hpp"

namespace hamelin::dynamics {

/// The functions of kernel/derivatives.hpp, compiled for one instruction set. Matrices are
/// column-major with the leading dimension that `leading` returns.
struct DerivativeKernels {
  std::size_t (*bytes)(std::size_t links) noexcept;
  std::size_t (*leading)(std::size_t links) noexcept;
  void (*inverse_dynamics)(std::size_t links, void* memory, const kernel::DerivativeLink*,
                           const kernel::DerivativeFrame*, const geometry::Vec3<double>& gravity,
                           const double* v, const double* a, double* dq, double* dv,
                           double* M) noexcept;
  /// From the derivatives of inverse dynamics, those of forward dynamics; M becomes its inverse.
  void (*forward_dynamics)(std::size_t links, const double* dq, const double* dv, double* M,
                           double* da_dq, double* da_dv) noexcept;
  void (*kinetic)(std::size_t links, void* memory, const kernel::DerivativeLink*,
                  const kernel::DerivativeFrame*, const double* v,
                  const kernel::KineticOutput&) noexcept;
  void (*potential)(std::size_t links, void* memory, const kernel::DerivativeLink*,
                    const kernel::DerivativeFrame*, const geometry::Vec3<double>& gravity,
                    const kernel::PotentialOutput&) noexcept;
};

/// @throws Error usage if this machine does not have the instruction set
[[nodiscard]] const DerivativeKernels& derivative_kernels(Isa isa);

}  // namespace hamelin::dynamics
