#pragma once
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "hamelin/geometry/small.hpp"

/// Everything in kernel/ is compiled once per instruction set (core/isa.hpp) and linked into one
/// program. The linker must not use a copy for one set in the code for another. Therefore
/// everything is in an inline namespace named after the set, and functions from outside (std,
/// geometry) must be inlined. CMake defines the name for sources that are compiled more than once.
#ifndef HAMELIN_ISA_NAMESPACE
#define HAMELIN_ISA_NAMESPACE isa_baseline
#endif

namespace hamelin::dynamics::kernel {

/// Rows and arrays of numbers are padded to a multiple of this, which fits registers of every set.
inline constexpr std::size_t row_multiple = 8;
[[nodiscard]] HAMELIN_INLINE constexpr std::size_t padded(std::size_t n) noexcept {
  return (n + row_multiple - 1) / row_multiple * row_multiple;
}

inline namespace HAMELIN_ISA_NAMESPACE {

/// The number of doubles in a register.
#if defined(__AVX512F__)
inline constexpr int native_lanes = 8;
#elif defined(__AVX2__)
inline constexpr int native_lanes = 4;
#else
inline constexpr int native_lanes = 2;
#endif

template <int W>
struct NativeVector;
template <>
struct NativeVector<2> {
  using Real [[gnu::vector_size(16)]] = double;
  using Bits [[gnu::vector_size(16)]] = std::int64_t;
};
template <>
struct NativeVector<4> {
  using Real [[gnu::vector_size(32)]] = double;
  using Bits [[gnu::vector_size(32)]] = std::int64_t;
};
template <>
struct NativeVector<8> {
  using Real [[gnu::vector_size(64)]] = double;
  using Bits [[gnu::vector_size(64)]] = std::int64_t;
};

/// W independent numbers in one register. As the scalar of the sweeps it makes them compute W
/// states at once. W must not exceed native_lanes, since the compiler keeps wider vectors in
/// memory.
template <int W>
struct Lanes {
  using Real = typename NativeVector<W>::Real;
  using Bits = typename NativeVector<W>::Bits;

  Real v;

  HAMELIN_INLINE Lanes() = default;
  HAMELIN_INLINE Lanes(Real x) noexcept : v(x) {}
  /// The same number in all lanes.
  HAMELIN_INLINE Lanes(double x) noexcept {
    if constexpr (W == 2)
      v = Real{x, x};
    else if constexpr (W == 4)
      v = Real{x, x, x, x};
    else
      v = Real{x, x, x, x, x, x, x, x};
  }

  HAMELIN_INLINE static Lanes load(const double* x) noexcept {
    Lanes out;
    __builtin_memcpy(&out.v, x, sizeof(Real));
    return out;
  }
  HAMELIN_INLINE void store(double* x) const noexcept { __builtin_memcpy(x, &v, sizeof(Real)); }
  HAMELIN_INLINE double operator[](int lane) const noexcept { return v[lane]; }

  HAMELIN_INLINE Lanes& operator+=(Lanes b) noexcept { return *this = {v + b.v}; }
  HAMELIN_INLINE Lanes& operator-=(Lanes b) noexcept { return *this = {v - b.v}; }
  HAMELIN_INLINE Lanes& operator*=(Lanes b) noexcept { return *this = {v * b.v}; }
  HAMELIN_INLINE friend Lanes operator+(Lanes a, Lanes b) noexcept { return {a.v + b.v}; }
  HAMELIN_INLINE friend Lanes operator-(Lanes a, Lanes b) noexcept { return {a.v - b.v}; }
  HAMELIN_INLINE friend Lanes operator*(Lanes a, Lanes b) noexcept { return {a.v * b.v}; }
  HAMELIN_INLINE friend Lanes operator/(Lanes a, Lanes b) noexcept { return {a.v / b.v}; }
  HAMELIN_INLINE friend Lanes operator-(Lanes a) noexcept { return {-a.v}; }
};

template <int W>
HAMELIN_INLINE Lanes<W> abs(Lanes<W> a) noexcept {
  return {a.v < 0.0 ? -a.v : a.v};
}
/// The larger number, lane by lane; NaN where either is NaN.
template <int W>
HAMELIN_INLINE Lanes<W> max(Lanes<W> a, Lanes<W> b) noexcept {
  const auto takes_b = (a.v <= b.v) | (b.v != b.v);
  return {takes_b ? b.v : a.v};
}
/// The largest of all lanes; NaN where any is NaN.
template <int W>
HAMELIN_INLINE double largest(Lanes<W> a) noexcept {
  double most = a[0];
  for (int i = 1; i < W; ++i)
    if (most <= a[i] || a[i] != a[i]) most = a[i];
  return most;
}

/// Beyond this [rad] the range reduction below loses digits, and the C library is used.
inline constexpr double largest_reduced_angle = 1e6;

/// For |x| ≤ 1e6, without a branch: range reduction to [−π/4, π/4] with π/2 in three parts (Cody
/// and Waite), then the minimax polynomials of fdlibm.
template <int W>
HAMELIN_INLINE void reduced_sincos(Lanes<W> angle, Lanes<W>& sine, Lanes<W>& cosine) noexcept {
  using Real = typename Lanes<W>::Real;
  using Bits = typename Lanes<W>::Bits;
  const Real x = angle.v;
  // Adding 1.5·2^52 rounds to an integer, which is then in the low bits.
  constexpr double to_integer = 6755399441055744.0;
  const Real shifted = x * 0.63661977236758134308 + to_integer;
  const Bits quadrant = reinterpret_cast<Bits>(shifted);
  const Real turns = shifted - to_integer;
  Real y = x - turns * 1.57079632673412561417e+00;
  y = y - turns * 6.07710050630396597660e-11;
  y = y - turns * 2.02226624879595063154e-21;
  const Real z = y * y;
  const Real s =
      y + y * z *
              (-1.66666666666666324348e-01 +
               z * (8.33333333332248946124e-03 +
                    z * (-1.98412698298579493134e-04 +
                         z * (2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 +
                                                                z * 1.58969099521155010221e-10)))));
  const Real c =
      1.0 -
      (0.5 * z -
       z * z *
           (4.16666666666666019037e-02 +
            z * (-1.38888888888741095749e-03 +
                 z * (2.48015872894767294178e-05 +
                      z * (-2.75573143513906633035e-07 +
                           z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))))));
  // Odd quadrants exchange sine and cosine; the signs depend on the quadrant.
  const Bits odd = (quadrant & 1) != 0;
  const Real a = odd ? c : s, b = odd ? s : c;
  sine.v = reinterpret_cast<Real>(reinterpret_cast<Bits>(a) ^ ((quadrant & 2) << 62));
  cosine.v = reinterpret_cast<Real>(reinterpret_cast<Bits>(b) ^ (((quadrant + 1) & 2) << 62));
}

/// Not inlined because it is rarely needed. Lanes do not depend on each other, so that a state has
/// the same result beside any other states.
template <int W>
[[gnu::noinline, gnu::cold]] void any_sincos(Lanes<W> angle, Lanes<W>& sine,
                                             Lanes<W>& cosine) noexcept {
  reduced_sincos(angle, sine, cosine);
  for (int i = 0; i < W; ++i) {
    if (__builtin_fabs(angle[i]) <= largest_reduced_angle) continue;
    sine.v[i] = __builtin_sin(angle[i]);
    cosine.v[i] = __builtin_cos(angle[i]);
  }
}

/// Sine and cosine of all lanes, accurate to 1.5 units in the last place up to 100 rad and to 2.5
/// beyond.
template <int W>
HAMELIN_INLINE void sincos(Lanes<W> angle, Lanes<W>& sine, Lanes<W>& cosine) noexcept {
  const Lanes<W> size = abs(angle);
  double most = size[0];  // ignores NaN, which both functions keep
  for (int i = 1; i < W; ++i) most = most <= size[i] ? size[i] : most;
  if (__builtin_expect(!(most <= largest_reduced_angle), 0))
    any_sincos(angle, sine, cosine);
  else
    reduced_sincos(angle, sine, cosine);
}

/// As above for arrays, whose allocated size must be a multiple of 8. The width is at most 4,
/// because a wide load of numbers that were just stored one by one must wait for all these stores.
HAMELIN_INLINE void sincos(std::size_t n, const double* angle, double* sine,
                           double* cosine) noexcept {
  constexpr int width = native_lanes < 4 ? native_lanes : 4;
  using Pack = Lanes<width>;
  for (std::size_t i = 0; i < n; i += static_cast<std::size_t>(width)) {
    Pack s, c;
    sincos(Pack::load(angle + i), s, c);
    s.store(sine + i);
    c.store(cosine + i);
  }
}
template <int W>
HAMELIN_INLINE void sincos(std::size_t n, const Lanes<W>* angle, Lanes<W>* sine,
                           Lanes<W>* cosine) noexcept {
  for (std::size_t i = 0; i < n; ++i) sincos(angle[i], sine[i], cosine[i]);
}

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::dynamics::kernel
