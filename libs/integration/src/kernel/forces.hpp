#pragma once
#include <cstddef>

#include "hamelin/dynamics/kernel/lanes.hpp"
#include "hamelin/dynamics/kernel/sweeps.hpp"

namespace hamelin::integration::kernel {

/// Joint torques of wrenches on the arm, computed outside of the kernels.
struct ExternalTorque {
  /// Null: there are none.
  void (*evaluate)(void* context, const double* q, const double* v, double* tau) noexcept = nullptr;
  void* context = nullptr;
};

/// The forces of a step's channels, docs/theory.md (8.2), in the form of the kernels. Null pointers
/// and a count of zero mean that there are none.
struct Forces {
  const double *damping, *coulomb, *held;
  double coulomb_speed;
  const dynamics::kernel::Spin* spins;
  std::size_t spin_count;
  ExternalTorque external{};
};

/// The work of these forces in a step [J].
struct Work {
  double held, dissipated, gyroscopic, external;
};

inline namespace HAMELIN_ISA_NAMESPACE {

HAMELIN_INLINE double tanh_of(double x) noexcept {
  return __builtin_tanh(x);
}
template <int W>
HAMELIN_INLINE dynamics::kernel::Lanes<W> tanh_of(dynamics::kernel::Lanes<W> x) noexcept {
  for (int lane = 0; lane < W; ++lane) x.v[lane] = __builtin_tanh(x.v[lane]);
  return x;
}

/// The torque with which damping opposes the rate of joint i, and that of dry friction.
template <class Real>
HAMELIN_INLINE Real damping_of(const Forces& f, std::size_t i, Real rate) noexcept {
  return rate * Real(f.damping[i]);
}
template <class Real>
HAMELIN_INLINE Real dry_friction(const Forces& f, std::size_t i, Real rate) noexcept {
  return tanh_of(rate / Real(f.coulomb_speed)) * Real(f.coulomb[i]);
}

/// Held torque, damping and dry friction of joint i at its rate.
template <class Real>
HAMELIN_INLINE Real joint_force(const Forces& f, std::size_t i, Real rate) noexcept {
  Real force(f.held != nullptr ? f.held[i] : 0.0);
  if (f.damping != nullptr) force -= damping_of(f, i, rate);
  if (f.coulomb != nullptr) force -= dry_friction(f, i, rate);
  return force;
}

/// −∂(joint force)/∂rate, the D of docs/theory.md (4.15).
HAMELIN_INLINE double joint_force_slope(const Forces& f, std::size_t i, double rate) noexcept {
  double slope = f.damping != nullptr ? f.damping[i] : 0.0;
  if (f.coulomb != nullptr) {
    const double t = tanh_of(rate / f.coulomb_speed);
    slope += f.coulomb[i] / f.coulomb_speed * (1.0 - t * t);
  }
  return slope;
}

/// Adds the work of these forces over a time dt at the rates rate(i).
template <class Rate>
HAMELIN_INLINE void add_joint_work(const Forces& f, std::size_t n, double dt, Work& work,
                                   Rate&& rate) noexcept {
  if (f.held != nullptr)
    for (std::size_t i = 0; i < n; ++i) work.held += f.held[i] * rate(i) * dt;
  if (f.damping != nullptr)
    for (std::size_t i = 0; i < n; ++i) work.dissipated += damping_of(f, i, rate(i)) * rate(i) * dt;
  if (f.coulomb != nullptr)
    for (std::size_t i = 0; i < n; ++i)
      work.dissipated += dry_friction(f, i, rate(i)) * rate(i) * dt;
}

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::integration::kernel
