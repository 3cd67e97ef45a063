// Compiled once for each instruction set; see dynamics/kernel/lanes.hpp on what may be used here.
// All give the same bits: numbers are compared and added only.
#include "hamelin/sensing/kernel/ray_walk.hpp"

#include "hamelin/geometry/small.hpp"

namespace hamelin::sensing::kernel {
inline namespace HAMELIN_ISA_NAMESPACE {

namespace {

HAMELIN_INLINE void set(std::uint64_t* bits, std::int64_t bit) {
  bits[bit >> 6] |= std::uint64_t{1} << (bit & 63);
}

#if defined(__AVX2__)
// Rays side by side: what one step waits for, others compute meanwhile.
constexpr int lanes = 4;
using Doubles [[gnu::vector_size(8 * lanes)]] = double;
using Integers [[gnu::vector_size(8 * lanes)]] = std::int64_t;

HAMELIN_INLINE bool any(Integers x) {
  return __builtin_ia32_movmskpd256(reinterpret_cast<Doubles>(x)) != 0;
}
HAMELIN_INLINE Doubles masked(Doubles x, Integers mask) {
  return reinterpret_cast<Doubles>(reinterpret_cast<Integers>(x) & mask);
}

struct Rays {
  Doubles next[3], apart[3], length;
  Integers bit, bit_step[3], end_bit, left, left_step[3], walks;
};

// The first `count` rays, from 1 to `lanes`; the other lanes repeat the last one.
HAMELIN_INLINE Rays load(const BoxRay* rays, std::size_t count) {
  Rays out;
  for (int j = 0; j < lanes; ++j) {
    const std::size_t at =
        static_cast<std::size_t>(j) < count ? static_cast<std::size_t>(j) : count - 1;
    const BoxRay& ray = rays[at];
    for (std::size_t i = 0; i < 3; ++i) {
      out.next[i][j] = ray.next[i];
      out.apart[i][j] = ray.apart[i];
      out.bit_step[i][j] = ray.bit_step[i];
      out.left_step[i][j] = ray.left_step[i];
    }
    out.length[j] = ray.length;
    out.bit[j] = ray.bit;
    out.end_bit[j] = ray.end_bit;
    out.left[j] = ray.left;
  }
  out.walks = Integers{} - 1;
  return out;
}

// docs/theory.md (20.2)
void walk(const BoxRay* rays, std::size_t count, std::uint64_t* bits) noexcept {
  for (std::size_t first = 0; first < count; first += lanes) {
    Rays r = load(rays + first, count - first);
    while (any(r.walks)) {
      for (int j = 0; j < lanes; ++j) set(bits, r.bit[j]);
      const Integers x = (r.next[0] < r.next[1]) & (r.next[0] < r.next[2]),
                     y = ~(r.next[0] < r.next[1]) & (r.next[1] < r.next[2]), z = ~(x | y);
      const Integers across[3] = {x & r.walks, y & r.walks, z & r.walks};
      Integers bit = r.bit;
      for (int i = 0; i < 3; ++i) {
        r.next[i] += masked(r.apart[i], across[i]);
        bit += across[i] & r.bit_step[i];
        r.left -= across[i] & r.left_step[i];
      }
      Doubles nearest = r.next[0] < r.next[1] ? r.next[0] : r.next[1];
      nearest = nearest < r.next[2] ? nearest : r.next[2];
      const Integers ended = ((r.left & left_box) != 0) | (bit == r.end_bit) | (nearest > r.length);
      r.walks &= ~ended;
      r.bit = (bit & r.walks) | (r.bit & ~r.walks);  // that of a ray that has ended is set already
    }
  }
}
#else
// Without branches, as the axes are hard to predict; docs/theory.md (20.2).
void walk(const BoxRay* rays, std::size_t count, std::uint64_t* bits) noexcept {
  for (const BoxRay* ray = rays; ray != rays + count; ++ray) {
    double next[3] = {ray->next[0], ray->next[1], ray->next[2]};
    std::int64_t bit = ray->bit, left = ray->left;
    bool ended = false;
    while (!ended) {
      set(bits, bit);
      const bool x = (next[0] < next[1]) & (next[0] < next[2]),
                 y = !(next[0] < next[1]) & (next[1] < next[2]), z = !(x | y);
      const bool across[3] = {x, y, z};
      for (int i = 0; i < 3; ++i) {
        const std::int64_t mask = -std::int64_t{across[i]};
        next[i] += across[i] ? ray->apart[i] : 0.0;
        bit += mask & ray->bit_step[i];
        left -= mask & ray->left_step[i];
      }
      double nearest = next[0] < next[1] ? next[0] : next[1];
      nearest = nearest < next[2] ? nearest : next[2];
      ended = ((left & left_box) != 0) | (bit == ray->end_bit) | (nearest > ray->length);
    }
  }
}
#endif

}  // namespace

extern const WalkKernels walk_kernels;
const WalkKernels walk_kernels{walk};

}  // namespace HAMELIN_ISA_NAMESPACE
}  // namespace hamelin::sensing::kernel
