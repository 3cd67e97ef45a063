#pragma once
#include <Eigen/Core>
#include <memory>

#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

/// The motion within a step: for each joint the polynomial of degree five through positions,
/// velocities and accelerations at both nodes, docs/theory.md (18.14), with accelerations by
/// forward dynamics under the step's channels. It differs from the motion by O(h⁶) in q and O(h⁵)
/// in v, besides the error of the scheme at the nodes. Nothing allocates after construction. An
/// object belongs to one thread.
class DenseOutput {
 public:
  /// @param model must outlive this
  explicit DenseOutput(const Model& model, Isa isa = default_isa());
  DenseOutput(const Model&& model, Isa isa = default_isa()) = delete;
  ~DenseOutput();
  DenseOutput(const DenseOutput&) = delete;
  DenseOutput& operator=(const DenseOutput&) = delete;

  /// The node before a step, and the node after it.
  /// @param channels those of the step
  /// @throws Error usage as Integrator::step; end() also for a node that is not later than the one
  ///         before. What a wrench law throws passes through.
  void begin(const Integrator& integrator, const State& state, const Channels& channels);
  void end(const Integrator& integrator, const State& state, const Channels& channels);

  /// The times of both nodes [s].
  [[nodiscard]] double begin_s() const noexcept;
  [[nodiscard]] double end_s() const noexcept;
  /// Positions and velocities at a time between the nodes, these included. Arguments have dof
  /// numbers each.
  /// @throws Error usage for sizes, a time outside, or without begin() and end()
  void at(double time_s, VectorRef q, VectorRef v) const;

 private:
  struct Node;
  void set(Node& node, const char* function, const Integrator& integrator, const State& state,
           const Channels& channels);
  struct Data;
  std::unique_ptr<Data> data_;
};

}  // namespace hamelin::integration
