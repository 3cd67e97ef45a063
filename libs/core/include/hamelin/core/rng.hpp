#pragma once
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <numbers>

namespace hamelin {

/// xoshiro256++ (Blackman and Vigna 2019), seeded by splitmix64. It maps draws to doubles itself,
/// so that a seed gives the same numbers with every standard library. A copyable value.
class Rng {
 public:
  static constexpr const char* name = "xoshiro256++";

  explicit Rng(std::uint64_t seed) noexcept {
    for (auto& word : state_) {
      seed += 0x9e3779b97f4a7c15ULL;
      std::uint64_t z = seed;
      z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
      z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
      word = z ^ (z >> 31);
    }
  }

  [[nodiscard]] std::uint64_t next() noexcept {
    const std::uint64_t result = std::rotl(state_[0] + state_[3], 23) + state_[0];
    const std::uint64_t t = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= t;
    state_[3] = std::rotl(state_[3], 45);
    return result;
  }

  /// Uniform in [0, 1).
  [[nodiscard]] double uniform() noexcept { return static_cast<double>(next() >> 11) * 0x1.0p-53; }
  /// Uniform in [low, high).
  [[nodiscard]] double uniform(double low, double high) noexcept {
    return low + (high - low) * uniform();
  }
  /// Uniform in 0 .. count − 1, count > 0.
  [[nodiscard]] std::uint64_t below(std::uint64_t count) noexcept { return next() % count; }
  /// Standard normal (Box and Muller); takes two uniform numbers per call.
  [[nodiscard]] double normal() noexcept {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }

 private:
  std::array<std::uint64_t, 4> state_{};
};

}  // namespace hamelin
