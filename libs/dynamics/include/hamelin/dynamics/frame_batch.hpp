#pragma once
#include <memory>

#include "hamelin/dynamics/frames.hpp"

namespace hamelin::dynamics {

struct FrameBatchKernel;

/// Poses and Jacobians of one frame at many states, one state per lane of a SIMD register. One
/// object serves one thread; nothing allocates after construction.
class FrameBatch {
 public:
  /// @param frame an index into Model::frames() @param reference of the Jacobians
  /// @throws Error usage for a frame that does not exist, or as Workspace
  FrameBatch(const Model& model, int frame, Reference reference = Reference::local_world_aligned,
             Isa isa = default_isa());
  FrameBatch(FrameBatch&&) noexcept;
  FrameBatch& operator=(FrameBatch&&) noexcept;
  ~FrameBatch();

  /// World poses, as functions of frames.hpp give them up to rounding.
  /// @param q dof × states
  /// @param poses 12 × states with the row stride of q: the columns of [R p], one after the other
  /// @throws Error usage for sizes or strides that do not fit
  void poses(const ConstStatesRef& q, StatesRef poses);
  /// Jacobians: row 6 j + i is entry (i, j) of a Jacobian.
  /// @param J 6 dof × states with the row stride of q
  /// @throws as poses()
  void jacobians(const ConstStatesRef& q, StatesRef J);
  /// Both, cheaper than two calls.
  void evaluate(const ConstStatesRef& q, StatesRef poses, StatesRef J);

 private:
  struct Data;
  void compute(const ConstStatesRef& q, double* poses, double* J) noexcept;
  std::unique_ptr<Data> data_;
};

}  // namespace hamelin::dynamics
