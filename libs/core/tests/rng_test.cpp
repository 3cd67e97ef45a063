#include "hamelin/core/rng.hpp"

#include <array>
#include <catch2/catch.hpp>
#include <cmath>

using hamelin::Rng;

TEST_CASE("seed 1 gives the numbers of xoshiro256++ seeded by splitmix64", "[core][unit]") {
  // From a separate implementation with integers of any size. For the state {1, 2, 3, 4} it gives
  // 41943041, 58720359, 3588806011781223, …, as the implementation of Blackman and Vigna does.
  Rng rng(1);
  const std::array<std::uint64_t, 6> expected{0xcfc5d07f6f03c29b, 0xbf424132963fe08d,
                                              0x19a37d5757aaf520, 0xbf08119f05cd56d6,
                                              0x2f47184b86186fa4, 0x97299fcae7202345};
  for (const auto value : expected) CHECK(rng.next() == value);
  Rng again(1);
  CHECK(again.uniform() == 0.8116121588818848);
  CHECK(again.uniform() == 0.7471047161582187);
}

TEST_CASE("uniform numbers fill their range evenly, upper end excluded", "[core][property]") {
  Rng rng(2);
  std::array<int, 10> counts{};
  double low = 1.0, high = 0.0;
  for (int i = 0; i < 100000; ++i) {
    const double x = rng.uniform();
    REQUIRE((x >= 0.0 && x < 1.0));
    low = std::fmin(low, x);
    high = std::fmax(high, x);
    ++counts[static_cast<std::size_t>(10.0 * x)];
  }
  CHECK(low < 1e-3);
  CHECK(high > 1.0 - 1e-3);
  for (const int count : counts) CHECK(std::abs(count - 10000) < 500);  // five standard deviations
  for (int i = 0; i < 1000; ++i) {
    const double x = rng.uniform(-3.0, -2.0);
    REQUIRE((x >= -3.0 && x < -2.0));
    REQUIRE(rng.below(7) < 7);
  }
}

TEST_CASE("normal numbers have mean 0 and variance 1", "[core][property]") {
  Rng rng(3);
  const int n = 100000;
  double sum = 0.0, squares = 0.0;
  for (int i = 0; i < n; ++i) {
    const double x = rng.normal();
    REQUIRE(std::isfinite(x));
    sum += x;
    squares += x * x;
  }
  CHECK(std::abs(sum / n) < 0.016);  // five standard deviations
  CHECK(std::abs(squares / n - 1.0) < 0.023);
}

TEST_CASE("the same seed or a copy repeats the numbers, another seed does not", "[core][unit]") {
  Rng a(42), b(42), c(43);
  for (int i = 0; i < 5; ++i) CHECK(a.next() == b.next());
  Rng copy = a;
  const std::uint64_t next = a.next();
  CHECK(copy.next() == next);
  CHECK(c.next() != Rng(42).next());
}
