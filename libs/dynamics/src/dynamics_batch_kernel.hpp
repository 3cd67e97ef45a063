#pragma once
#include <cstddef>

#include "batch_links.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/dynamics/kernel/derivatives.hpp"
#include "hamelin/dynamics/kernel/groups.hpp"

namespace hamelin::dynamics {

/// What does not depend on the states: `root` is given about the reference point of derivatives.
struct DynamicsBatchModel {
  std::size_t dof;
  const BatchLink* links;
  const kernel::DerivativeLink* bodies;
  BatchPose root;
  geometry::Vec3<double> gravity;
};

/// Rows of numbers, one state after the other: `stride` from row to row of the arguments and
/// `result_stride` of the results. Matrices are column-major, entry (i, j) in row i + dof j.
struct DynamicsBatchCall {
  const DynamicsBatchModel* model;
  void* memory;
  std::size_t states, stride, result_stride;
  const double *q, *v, *x;                        ///< x: accelerations or torques
  double *acceleration, *by_q, *by_v, *by_third;  ///< the mass matrix is the third
};

/// For one group, compiled for one instruction set.
template <class Chain>
struct DynamicsBatchKernels {
  std::size_t (*bytes)(std::size_t links) noexcept;
  void (*mass_matrix)(const Chain&, const DynamicsBatchCall&) noexcept;
  void (*forward_dynamics_derivatives)(const Chain&, const DynamicsBatchCall&) noexcept;
};
struct DynamicsBatchSet : kernel::Groups<DynamicsBatchKernels> {
  void (*inverse_dynamics_derivatives)(const DynamicsBatchCall&) noexcept;
};

}  // namespace hamelin::dynamics
