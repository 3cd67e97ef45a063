#pragma once
#include <memory>

#include "hamelin/dynamics/derivatives.hpp"

namespace hamelin::dynamics {

/// Mass matrices and derivatives of dynamics at many states, one state per lane of a SIMD register.
/// An object serves one caller at a time. Joint vectors are dof × states. A result of dof × dof per
/// state is dof² × states, entry (i, j) in row i + dof j. All have the row stride of q, and no
/// result may share memory with an argument. Results equal those of the functions of one state up
/// to rounding and do not depend on the other states: one that is not finite affects no other.
/// (Inverse and forward dynamics themselves: BatchWorkspace.)
class DynamicsBatch {
 public:
  struct Settings {
    Isa isa = default_isa();
    /// Threads that share the states of a call, the caller's included. With one, nothing allocates
    /// after construction. Results do not depend on it.
    int threads = 1;
  };
  /// @throws Error usage for less than one thread, or as Workspace
  DynamicsBatch(const Model& model, const Settings& settings);
  explicit DynamicsBatch(const Model& model) : DynamicsBatch(model, Settings()) {}
  DynamicsBatch(const DynamicsBatch&) = delete;
  DynamicsBatch& operator=(const DynamicsBatch&) = delete;
  ~DynamicsBatch();

  /// M(q) by composite rigid bodies, docs/theory.md (2.18), (2.19).
  /// @throws Error usage for sizes, strides or memory that do not fit
  void mass_matrix(const ConstStatesRef& q, StatesRef M);
  /// ∂τ/∂q, ∂τ/∂v and ∂τ/∂a = M(q), docs/theory.md (2.24)–(2.28). Row i of a matrix is the torque
  /// (or force) of joint i, per rad or m, per rad/s or m/s, and per rad/s² or m/s².
  /// @throws as mass_matrix()
  void inverse_dynamics_derivatives(const ConstStatesRef& q, const ConstStatesRef& v,
                                    const ConstStatesRef& a, StatesRef dtau_dq, StatesRef dtau_dv,
                                    StatesRef dtau_da);
  /// ∂a/∂q, ∂a/∂v and ∂a/∂τ = M(q)⁻¹, docs/theory.md (2.29), and a itself, dof × states. Row i of a
  /// matrix is the acceleration of joint i, per rad or m, per rad/s or m/s, and per Nm or N.
  /// @throws as mass_matrix()
  void forward_dynamics_derivatives(const ConstStatesRef& q, const ConstStatesRef& v,
                                    const ConstStatesRef& tau, StatesRef a, StatesRef da_dq,
                                    StatesRef da_dv, StatesRef da_dtau);

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

}  // namespace hamelin::dynamics
