#pragma once
#include <cstddef>

#include "batch_links.hpp"
#include "hamelin/core/isa.hpp"

namespace hamelin::dynamics {

/// Rows of numbers, one state after the other: `stride` from row to row of q and `result_stride` of
/// the results.
struct FrameBatchCall {
  const BatchLink* links;
  std::size_t dof;
  std::size_t moving;  ///< how many of the links move the frame
  BatchPose root;      ///< in the world
  BatchPose frame;     ///< in the last of these links, or in the world if there is none
  bool local;          ///< the Jacobians are in the axes of the frame
  bool about_origin;   ///< they are of the body's point at the world's origin, else of the frame's
  void* memory;
  std::size_t states, stride, result_stride;
  const double* q;
  double *poses, *jacobians;  ///< null: not wanted
};

struct FrameBatchKernel {
  std::size_t (*bytes)(std::size_t dof) noexcept;
  void (*evaluate)(const FrameBatchCall& call) noexcept;
};

}  // namespace hamelin::dynamics
