#pragma once
#include "hamelin/geometry/small.hpp"
#include "hamelin/scene/kernel/box_tree.hpp"

/// Registers of single-precision numbers, for the eight children of a tree's node.
namespace hamelin::scene::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

#if defined(__AVX2__)
constexpr int lanes = 8;
#else
constexpr int lanes = 4;
#endif
using Lanes [[gnu::vector_size(4 * lanes)]] = float;
constexpr int width = TreeNode::width;

HAMELIN_INLINE Lanes splat(float x) {
  return x - Lanes{};
}
HAMELIN_INLINE Lanes max(Lanes a, Lanes b) {
  return a > b ? a : b;
}
HAMELIN_INLINE Lanes min(Lanes a, Lanes b) {
  return a < b ? a : b;
}
HAMELIN_INLINE Lanes load(const float* from) {
  Lanes x;
  __builtin_memcpy(&x, from, sizeof x);
  return x;
}
HAMELIN_INLINE void store(Lanes x, float* to) {
  __builtin_memcpy(to, &x, sizeof x);
}
HAMELIN_INLINE float magnitude(float x) {
  return x < 0.0F ? -x : x;
}
HAMELIN_INLINE constexpr float infinity() {
  return __builtin_inff();
}

// A bit mask of those of a node's eight numbers that are not above the bound.
HAMELIN_INLINE unsigned not_above(const float* x, float bound) {
  unsigned bits = 0;
#if defined(__AVX2__)
  bits = static_cast<unsigned>(__builtin_ia32_movmskps256(load(x) <= splat(bound)));
#elif defined(__SSE2__)
  for (int half = 0; half < width; half += lanes)
    bits |= static_cast<unsigned>(__builtin_ia32_movmskps(load(x + half) <= splat(bound))) << half;
#else
  for (int i = 0; i < width; ++i) bits |= (x[i] <= bound ? 1U : 0U) << i;
#endif
  return bits;
}

constexpr float float_max = 3.4e38F;

// The value with which lower bounds in single precision are compared: a squared distance widened
// for their rounding, docs/theory.md (11.17).
HAMELIN_INLINE float bound_of(double squared) {
  const double wide = (squared > 0.0 ? squared : 0.0) * (1.0 + 2e-6);
  return wide < 3.3e38 ? static_cast<float>(wide) + 1e-37F : float_max;
}

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::scene::kernel
