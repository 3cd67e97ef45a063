#pragma once
// Included by dynamics.hpp: the inline definitions of its functions of joint vectors. They check
// sizes and the workspace with a few integer comparisons per call; the sweeps behind them take
// plain pointers.
#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::dynamics {

namespace detail {

[[noreturn]] void refuse_workspace(const char* function, const Model& model,
                                   const WorkspaceOwner& owner);
[[noreturn]] void refuse_size(const char* function, const char* argument, Eigen::Index given,
                              Eigen::Index expected);
[[noreturn]] void refuse_states(const char* function, const char* argument, Eigen::Index rows,
                                Eigen::Index cols, Eigen::Index stride, Eigen::Index dof,
                                Eigen::Index states, Eigen::Index expected);

[[noreturn]] void refuse_link(const char* function, int link, Eigen::Index dof);
[[noreturn]] void refuse_count(const char* function, const char* argument, std::size_t given,
                               std::size_t expected);

[[noreturn]] void refuse_overlap(const char* function, const char* result, const char* argument);
/// Whether two blocks of rows × cols numbers with one row stride have some numbers in common, but
/// not all.
[[nodiscard]] bool overlap_in_part(const double* a, const double* b, Eigen::Index rows,
                                   Eigen::Index cols, Eigen::Index stride) noexcept;

/// Checks the arguments of a call. `function` is the name of the public function, for messages.
class Call {
 public:
  Call(const char* function, const Model& model, const WorkspaceOwner& owner)
      : Call(function, model, owner, owner.id) {}
  /// Of a function that reads the poses of forward_kinematics.
  static Call with_poses(const char* function, const Model& model, const WorkspaceOwner& owner) {
    return {function, model, owner, owner.posed_id};
  }
  /// A joint vector.
  template <class Vector>
  const Call& joints(const char* argument, const Vector& x) const {
    return size(argument, x.size(), dof_);
  }
  const Call& size(const char* argument, Eigen::Index given, Eigen::Index expected) const {
    if (given != expected) [[unlikely]]
      refuse_size(function_, argument, given, expected);
    return *this;
  }
  /// Columns of joint vectors with the same size and stride as `first`.
  template <class States, class First>
  const Call& states(const char* argument, const States& x, const First& first) const {
    if (x.rows() != dof_ || x.cols() != first.cols() || x.outerStride() != first.outerStride())
        [[unlikely]]
      refuse_states(function_, argument, x.rows(), x.cols(), x.outerStride(), dof_, first.cols(),
                    first.outerStride());
    return *this;
  }
  /// A result of many states and an argument: apart, or the same.
  template <class Result, class States>
  const Call& apart(const char* result, const Result& x, const char* argument,
                    const States& y) const {
    if (overlap_in_part(x.data(), y.data(), dof_, x.cols(), x.outerStride())) [[unlikely]]
      refuse_overlap(function_, result, argument);
    return *this;
  }

 private:
  Call(const char* function, const Model& model, const WorkspaceOwner& owner, std::uint64_t id)
      : function_(function), dof_(owner.dof) {
    if (model.id() != id) [[unlikely]]
      refuse_workspace(function, model, owner);
  }

  const char* function_;
  Eigen::Index dof_;
};

void inverse_dynamics(const Model&, Workspace&, const double* q, const double* v, const double* a,
                      double* tau);
void forward_dynamics(const Model&, Workspace&, const double* q, const double* v, const double* tau,
                      double* a);
void gravity_torque(const Model&, Workspace&, const double* q, double* tau);
void solve_mass(const Model&, Workspace&, const double* q, const double* y, double* x);
void momentum(const Model&, Workspace&, const double* q, const double* v, double* p);
void mass_matrix(const Model&, Workspace&, const double* q, double* M, Eigen::Index stride);
double kinetic_energy(const Model&, Workspace&, const double* q, const double* v);
double potential_energy(const Model&, Workspace&, const double* q);
void inverse_dynamics(const Model&, BatchWorkspace&, Eigen::Index states, Eigen::Index stride,
                      const double* q, const double* v, const double* a, double* tau);
void forward_dynamics(const Model&, BatchWorkspace&, Eigen::Index states, Eigen::Index stride,
                      const double* q, const double* v, const double* tau, double* a);
void forward_kinematics(const Model&, Workspace&, const double* q);
Eigen::Vector3d point_velocity(const Model&, const Workspace&, int link,
                               const Eigen::Vector3d& point_world, const double* v);
void gyroscopic_torque(const Model&, Workspace&, const double* q, const double* v,
                       std::span<const GyroscopicTerm>, double* tau);
Eigen::Matrix3d operational_inertia(const Model&, Workspace&, const double* q, const double* J,
                                    Eigen::Index stride, double damping);

}  // namespace detail

inline void inverse_dynamics(const Model& model, Workspace& ws, const ConstVectorRef& q,
                             const ConstVectorRef& v, const ConstVectorRef& a, VectorRef tau) {
  detail::Call("inverse_dynamics", model, ws.owner)
      .joints("q", q)
      .joints("v", v)
      .joints("a", a)
      .joints("tau", tau);
  detail::inverse_dynamics(model, ws, q.data(), v.data(), a.data(), tau.data());
}

inline void forward_dynamics(const Model& model, Workspace& ws, const ConstVectorRef& q,
                             const ConstVectorRef& v, const ConstVectorRef& tau, VectorRef a) {
  detail::Call("forward_dynamics", model, ws.owner)
      .joints("q", q)
      .joints("v", v)
      .joints("tau", tau)
      .joints("a", a);
  detail::forward_dynamics(model, ws, q.data(), v.data(), tau.data(), a.data());
}

inline void bias_torque(const Model& model, Workspace& ws, const ConstVectorRef& q,
                        const ConstVectorRef& v, VectorRef tau) {
  detail::Call("bias_torque", model, ws.owner).joints("q", q).joints("v", v).joints("tau", tau);
  detail::inverse_dynamics(model, ws, q.data(), v.data(), nullptr, tau.data());
}

inline void gravity_torque(const Model& model, Workspace& ws, const ConstVectorRef& q,
                           VectorRef tau) {
  detail::Call("gravity_torque", model, ws.owner).joints("q", q).joints("tau", tau);
  detail::gravity_torque(model, ws, q.data(), tau.data());
}

inline void solve_mass(const Model& model, Workspace& ws, const ConstVectorRef& q,
                       const ConstVectorRef& y, VectorRef x) {
  detail::Call("solve_mass", model, ws.owner).joints("q", q).joints("y", y).joints("x", x);
  detail::solve_mass(model, ws, q.data(), y.data(), x.data());
}

inline void momentum(const Model& model, Workspace& ws, const ConstVectorRef& q,
                     const ConstVectorRef& v, VectorRef p) {
  detail::Call("momentum", model, ws.owner).joints("q", q).joints("v", v).joints("p", p);
  detail::momentum(model, ws, q.data(), v.data(), p.data());
}

inline void mass_matrix(const Model& model, Workspace& ws, const ConstVectorRef& q,
                        Eigen::Ref<Eigen::MatrixXd> M) {
  detail::Call("mass_matrix", model, ws.owner)
      .joints("q", q)
      .size("M (rows)", M.rows(), ws.owner.dof)
      .size("M (columns)", M.cols(), ws.owner.dof);
  detail::mass_matrix(model, ws, q.data(), M.data(), M.outerStride());
}

inline double kinetic_energy(const Model& model, Workspace& ws, const ConstVectorRef& q,
                             const ConstVectorRef& v) {
  detail::Call("kinetic_energy", model, ws.owner).joints("q", q).joints("v", v);
  return detail::kinetic_energy(model, ws, q.data(), v.data());
}

inline double potential_energy(const Model& model, Workspace& ws, const ConstVectorRef& q) {
  detail::Call("potential_energy", model, ws.owner).joints("q", q);
  return detail::potential_energy(model, ws, q.data());
}

inline void inverse_dynamics(const Model& model, BatchWorkspace& ws, const ConstStatesRef& q,
                             const ConstStatesRef& v, const ConstStatesRef& a, StatesRef tau) {
  detail::Call("inverse_dynamics", model, ws.owner)
      .states("q", q, q)
      .states("v", v, q)
      .states("a", a, q)
      .states("tau", tau, q)
      .apart("tau", tau, "q", q)
      .apart("tau", tau, "v", v)
      .apart("tau", tau, "a", a);
  detail::inverse_dynamics(model, ws, q.cols(), q.outerStride(), q.data(), v.data(), a.data(),
                           tau.data());
}

inline void forward_dynamics(const Model& model, BatchWorkspace& ws, const ConstStatesRef& q,
                             const ConstStatesRef& v, const ConstStatesRef& tau, StatesRef a) {
  detail::Call("forward_dynamics", model, ws.owner)
      .states("q", q, q)
      .states("v", v, q)
      .states("tau", tau, q)
      .states("a", a, q)
      .apart("a", a, "q", q)
      .apart("a", a, "v", v)
      .apart("a", a, "tau", tau);
  detail::forward_dynamics(model, ws, q.cols(), q.outerStride(), q.data(), v.data(), tau.data(),
                           a.data());
}

inline void forward_kinematics(const Model& model, Workspace& ws, const ConstVectorRef& q) {
  detail::Call("forward_kinematics", model, ws.owner).joints("q", q);
  detail::forward_kinematics(model, ws, q.data());
}

inline Eigen::Vector3d point_velocity(const Model& model, const Workspace& ws, int link,
                                      const Eigen::Vector3d& point_world, const ConstVectorRef& v) {
  detail::Call::with_poses("point_velocity", model, ws.owner).joints("v", v);
  return detail::point_velocity(model, ws, link, point_world, v.data());
}

inline void gyroscopic_torque(const Model& model, Workspace& ws, const ConstVectorRef& q,
                              const ConstVectorRef& v, std::span<const GyroscopicTerm> terms,
                              VectorRef tau) {
  detail::Call("gyroscopic_torque", model, ws.owner)
      .joints("q", q)
      .joints("v", v)
      .joints("tau", tau);
  detail::gyroscopic_torque(model, ws, q.data(), v.data(), terms, tau.data());
}

inline Eigen::Matrix3d operational_inertia(const Model& model, Workspace& ws,
                                           const ConstVectorRef& q, const ConstRef<Matrix3Xd>& J,
                                           double damping) {
  detail::Call("operational_inertia", model, ws.owner)
      .joints("q", q)
      .size("J (columns)", J.cols(), ws.owner.dof);
  return detail::operational_inertia(model, ws, q.data(), J.data(), J.outerStride(), damping);
}

}  // namespace hamelin::dynamics
