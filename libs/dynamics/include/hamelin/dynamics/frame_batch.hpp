#pragma once
#include <memory>

#include "hamelin/dynamics/frames.hpp"

namespace hamelin::dynamics {

/// Poses and Jacobians of one frame at many states, one state per lane of a SIMD register. An
/// object serves one caller at a time. Blocks of some hundred states stay in the cache and are the
/// fastest. Results of 8 MB and more are written past the caches.
class FrameBatch {
 public:
  struct Settings {
    Reference reference = Reference::local_world_aligned;  ///< of the Jacobians
    Isa isa = default_isa();
    /// Threads that share the states of a call, the caller's included. With one, nothing allocates
    /// after construction. Results do not depend on it.
    int threads = 1;
  };
  /// @param frame an index into Model::frames()
  /// @throws Error usage for a frame that does not exist, less than one thread, or as Workspace
  FrameBatch(const Model& model, int frame, const Settings& settings);
  FrameBatch(const Model& model, int frame) : FrameBatch(model, frame, Settings()) {}
  FrameBatch(const FrameBatch&) = delete;
  FrameBatch& operator=(const FrameBatch&) = delete;
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
  void compute(const ConstStatesRef& q, double* poses, double* J);
  std::unique_ptr<Data> data_;
};

}  // namespace hamelin::dynamics
