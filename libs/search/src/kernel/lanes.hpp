#pragma once
#include <cstdint>
#if defined(__SSE2__)
#include <immintrin.h>
#endif

#include "chain.hpp"
#include "hamelin/geometry/small.hpp"

#ifndef HAMELIN_ISA_NAMESPACE
#define HAMELIN_ISA_NAMESPACE isa_baseline
#endif

/// Sixteen numbers of single precision in one, two or four registers. Every operation is done lane
/// by lane and rounded once, so all instruction sets give the same bits. Only for sources that are
/// compiled once for each instruction set.
namespace hamelin::search::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

#if defined(__AVX512F__)
inline constexpr int width = 16;
#elif defined(__AVX2__)
inline constexpr int width = 8;
#else
inline constexpr int width = 4;
#endif
inline constexpr int registers = lanes / width;

using Native [[gnu::vector_size(4 * width), gnu::may_alias]] = float;
using NativeInt [[gnu::vector_size(4 * width), gnu::may_alias]] = std::int32_t;

struct Reals {
  Native v[registers];
};
struct Ints {
  NativeInt v[registers];
};

// Applies an operation to each register.
// NOLINTBEGIN(bugprone-macro-parentheses): names of variables
#define HAMELIN_EACH(out, expression) \
  _Pragma("GCC unroll 4") for (int i = 0; i < registers; ++i) out.v[i] = expression
// NOLINTEND(bugprone-macro-parentheses)

HAMELIN_INLINE Reals splat(float x) {
  Reals out;
  HAMELIN_EACH(out, x - Native{});
  return out;
}
HAMELIN_INLINE Reals load(const float* from) {
  Reals out;
  __builtin_memcpy(&out, from, sizeof out);
  return out;
}
HAMELIN_INLINE void store(const Reals& x, float* to) {
  __builtin_memcpy(to, &x, sizeof x);
}
HAMELIN_INLINE Reals operator+(const Reals& a, const Reals& b) {
  Reals out;
  HAMELIN_EACH(out, a.v[i] + b.v[i]);
  return out;
}
HAMELIN_INLINE Reals operator-(const Reals& a, const Reals& b) {
  Reals out;
  HAMELIN_EACH(out, a.v[i] - b.v[i]);
  return out;
}
HAMELIN_INLINE Reals operator*(const Reals& a, const Reals& b) {
  Reals out;
  HAMELIN_EACH(out, a.v[i] * b.v[i]);
  return out;
}
HAMELIN_INLINE Reals operator/(const Reals& a, const Reals& b) {
  Reals out;
  HAMELIN_EACH(out, a.v[i] / b.v[i]);
  return out;
}
HAMELIN_INLINE Reals operator+(const Reals& a, float b) {
  return a + splat(b);
}
HAMELIN_INLINE Reals operator-(const Reals& a, float b) {
  return a - splat(b);
}
HAMELIN_INLINE Reals operator*(const Reals& a, float b) {
  return a * splat(b);
}

// With the masked forms, GCC 12 does not warn of uninitialised values in its own header.
HAMELIN_INLINE Native sqrt(Native x) {
#if defined(__AVX512F__)
  return Native(_mm512_maskz_sqrt_ps(0xffff, __m512(x)));
#elif defined(__AVX2__)
  return Native(_mm256_sqrt_ps(__m256(x)));
#elif defined(__SSE2__)
  return Native(_mm_sqrt_ps(__m128(x)));
#else
  for (int i = 0; i < width; ++i) x[i] = __builtin_sqrtf(x[i]);
  return x;
#endif
}
// The larger number; the second one where they are equal.
HAMELIN_INLINE Native larger(Native a, Native b) {
#if defined(__AVX512F__)
  return Native(_mm512_maskz_max_ps(0xffff, __m512(a), __m512(b)));
#elif defined(__AVX2__)
  return Native(_mm256_max_ps(__m256(a), __m256(b)));
#elif defined(__SSE2__)
  return Native(_mm_max_ps(__m128(a), __m128(b)));
#else
  return a > b ? a : b;
#endif
}
HAMELIN_INLINE Native smaller(Native a, Native b) {
#if defined(__AVX512F__)
  return Native(_mm512_maskz_min_ps(0xffff, __m512(a), __m512(b)));
#elif defined(__AVX2__)
  return Native(_mm256_min_ps(__m256(a), __m256(b)));
#elif defined(__SSE2__)
  return Native(_mm_min_ps(__m128(a), __m128(b)));
#else
  return a < b ? a : b;
#endif
}
// Bits of the lanes whose number is below the other one.
HAMELIN_INLINE unsigned below(Native a, Native b) {
#if defined(__AVX512F__)
  return _mm512_cmp_ps_mask(__m512(a), __m512(b), _CMP_LT_OQ);
#elif defined(__AVX2__)
  return static_cast<unsigned>(_mm256_movemask_ps(__m256(a < b)));
#elif defined(__SSE2__)
  return static_cast<unsigned>(_mm_movemask_ps(__m128(a < b)));
#else
  unsigned bits = 0;
  for (int i = 0; i < width; ++i) bits |= (a[i] < b[i] ? 1U : 0U) << i;
  return bits;
#endif
}

HAMELIN_INLINE Reals sqrt(const Reals& x) {
  Reals out;
  HAMELIN_EACH(out, sqrt(x.v[i]));
  return out;
}
HAMELIN_INLINE Reals max(const Reals& a, const Reals& b) {
  Reals out;
  HAMELIN_EACH(out, larger(a.v[i], b.v[i]));
  return out;
}
HAMELIN_INLINE Reals min(const Reals& a, const Reals& b) {
  Reals out;
  HAMELIN_EACH(out, smaller(a.v[i], b.v[i]));
  return out;
}
HAMELIN_INLINE Reals clamp(const Reals& x, float low, float high) {
  return min(splat(high), max(splat(low), x));
}
HAMELIN_INLINE Reals magnitude(const Reals& x) {
  return max(x, splat(0.0F) - x);
}
HAMELIN_INLINE unsigned below(const Reals& a, const Reals& b) {
  unsigned bits = 0;
  _Pragma("GCC unroll 4") for (int i = 0; i < registers; ++i) bits |= below(a.v[i], b.v[i])
                                                                      << (width * i);
  return bits;
}

/// The nearest whole number, of numbers up to 2²².
HAMELIN_INLINE Reals round(const Reals& x) {
  constexpr float shift = 12582912.0F;  // 1.5 · 2²³: a sum with it has no binary places
  return (x + shift) - shift;
}
HAMELIN_INLINE Ints to_int(const Reals& x) {
  Ints out;
  HAMELIN_EACH(out, __builtin_convertvector(x.v[i], NativeInt));
  return out;
}
HAMELIN_INLINE Reals to_real(const Ints& x) {
  Reals out;
  HAMELIN_EACH(out, __builtin_convertvector(x.v[i], Native));
  return out;
}
/// The largest whole number that is not above, of numbers up to 2²².
HAMELIN_INLINE Reals floor(const Reals& x) {
  const Reals nearest = round(x);
  Reals out;
  HAMELIN_EACH(out, nearest.v[i] > x.v[i] ? nearest.v[i] - 1.0F : nearest.v[i]);
  return out;
}

/// Sine and cosine for |x| ≤ 12, each off by less than 8 · 2⁻²⁴: docs/theory.md (17.13). The angle
/// is reduced to [−π/4, π/4] with π/2 in three parts (Cody and Waite), of which the first two have
/// few bits so that products with them are exact; polynomials of Cephes (S. L. Moshier).
HAMELIN_INLINE void sincos(const Reals& x, Reals& sine, Reals& cosine) {
  const Reals k = round(x * 0.636619772F);
  const Reals r = ((x - k * 1.5703125F) - k * 4.837512969970703125e-4F) - k * 7.54978995489188e-8F;
  const Reals z = r * r;
  const Reals s = r + r * z * (((z * -1.9515295891e-4F + 8.3321608736e-3F) * z) - 1.6666654611e-1F);
  const Reals c =
      (splat(1.0F) - z * 0.5F) +
      z * z * ((z * 2.443315711809948e-5F - 1.388731625493765e-3F) * z + 4.166664568298827e-2F);
  const Ints n = to_int(k);
  _Pragma("GCC unroll 4") for (int i = 0; i < registers; ++i) {
    const NativeInt odd = (n.v[i] & 1) != 0;
    const Native first = odd ? c.v[i] : s.v[i], second = odd ? s.v[i] : c.v[i];
    sine.v[i] = (n.v[i] & 2) != 0 ? -first : first;
    cosine.v[i] = ((n.v[i] + 1) & 2) != 0 ? -second : second;
  }
}

struct Point {
  Reals x, y, z;
};
HAMELIN_INLINE Point operator+(const Point& a, const Point& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
HAMELIN_INLINE Point operator-(const Point& a, const Point& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
HAMELIN_INLINE Point operator*(const Point& a, const Reals& b) {
  return {a.x * b, a.y * b, a.z * b};
}
HAMELIN_INLINE Point operator*(const Point& a, float b) {
  return {a.x * b, a.y * b, a.z * b};
}
HAMELIN_INLINE Point splat(const float* p) {
  return {splat(p[0]), splat(p[1]), splat(p[2])};
}
HAMELIN_INLINE Reals square(const Point& a) {
  return a.x * a.x + a.y * a.y + a.z * a.z;
}
HAMELIN_INLINE Point cross(const Point& a, const Point& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::search::kernel
