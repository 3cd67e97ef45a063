#include "hamelin/core/time_histogram.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

#include "hamelin/core/rng.hpp"

using hamelin::TimeHistogram;

TEST_CASE("quantiles of tick times are correct to the stated error; the largest is exact",
          "[simulation][unit]") {
  hamelin::Rng rng(3);
  for (const std::size_t count : {1U, 2U, 3U, 99U, 100U, 101U, 20000U}) {
    TimeHistogram histogram;
    std::vector<double> all;
    for (std::size_t i = 0; i < count; ++i) {
      all.push_back(std::pow(10.0, rng.uniform(-2.5, 8.5)));
      histogram.add(all.back());
    }
    std::sort(all.begin(), all.end());
    CHECK(histogram.count() == count);
    CHECK(histogram.largest() == all.back());
    for (const double share : {0.0, 0.01, 0.5, 0.99, 1.0}) {
      CAPTURE(count, share);
      const double exact = all[static_cast<std::size_t>(share * static_cast<double>(count - 1))];
      CHECK(std::abs(histogram.quantile(share) - exact) <= TimeHistogram::relative_error * exact);
    }
  }
}

TEST_CASE("times outside the histogram's bounds are counted at the bounds", "[simulation][unit]") {
  TimeHistogram histogram;
  for (const double duration : {0.0, -1.0, 1e-9}) histogram.add(duration);
  CHECK(histogram.quantile(1.0) <= 1e-3);
  histogram.add(1e12);
  CHECK(histogram.largest() == 1e12);
  CHECK(histogram.quantile(1.0) == Approx(0x1p30).epsilon(TimeHistogram::relative_error));
}
