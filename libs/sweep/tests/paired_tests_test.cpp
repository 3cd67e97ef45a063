#include "hamelin/sweep/paired_tests.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <vector>

using namespace hamelin::sweep;

namespace {

/// Darwin's differences of the heights of crossed and self-fertilized plants [1/8 inch].
const std::vector<double> plants{6, 8, 14, 16, 23, 24, 28, 29, 41, -48, 49, 56, 60, -67, 75};

/// The two-sided p of the signed-rank test, by listing all 2ⁿ signs.
double enumerated_p(const std::vector<double>& differences) {
  std::vector<double> d;
  for (const double x : differences)
    if (x != 0.0) d.push_back(x);
  const auto rank = [&](double x) {
    double less = 0.0, equal = 0.0;
    for (const double y : d) {
      less += std::abs(y) < std::abs(x) ? 1.0 : 0.0;
      equal += std::abs(y) == std::abs(x) ? 1.0 : 0.0;
    }
    return less + 0.5 * (equal + 1.0);
  };
  double observed = 0.0;
  for (const double x : d) observed += x > 0.0 ? rank(x) : 0.0;
  const std::size_t all = std::size_t{1} << d.size();
  std::size_t low = 0, high = 0;
  for (std::size_t signs = 0; signs < all; ++signs) {
    double sum = 0.0;
    for (std::size_t i = 0; i < d.size(); ++i)
      if ((signs >> i & 1U) != 0) sum += rank(d[i]);
    low += sum <= observed ? 1U : 0U;
    high += sum >= observed ? 1U : 0U;
  }
  return std::min(1.0, 2.0 * static_cast<double>(std::min(low, high)) / static_cast<double>(all));
}

std::vector<double> walsh_averages(const std::vector<double>& d) {
  std::vector<double> averages;
  for (std::size_t i = 0; i < d.size(); ++i)
    for (std::size_t j = i; j < d.size(); ++j) averages.push_back(0.5 * (d[i] + d[j]));
  std::sort(averages.begin(), averages.end());
  return averages;
}

/// The score statistic of Tango, with the likelihood maximized over a grid that is refined about
/// its best point.
double score(double n, double a, double b, double difference) {
  const auto log_likelihood = [&](double share_b) {
    const double share_a = share_b + difference, rest = 1.0 - share_a - share_b;
    const auto term = [](double count, double share) {
      return count == 0.0 ? 0.0 : share <= 0.0 ? -1e300 : count * std::log(share);
    };
    return term(a, share_a) + term(b, share_b) + term(n - a - b, rest);
  };
  double low = std::max(0.0, -difference), high = 0.5 * (1.0 - difference);
  for (int round = 0; round < 40; ++round) {
    constexpr int parts = 20;
    int best = 0;
    const double step = (high - low) / parts;
    for (int i = 1; i <= parts; ++i)
      if (log_likelihood(low + i * step) > log_likelihood(low + best * step)) best = i;
    const double center = low + best * step, left = low, right = high;
    low = std::max(left, center - step);
    high = std::min(right, center + step);
  }
  const double share_b = 0.5 * (low + high);
  const double variance = n * (2.0 * share_b + difference * (1.0 - difference));
  return std::abs(a - b - n * difference) / std::sqrt(variance);
}

std::vector<double> many_differences(std::size_t count) {
  std::vector<double> d;
  std::uint32_t state = 1;
  for (std::size_t i = 0; i < count; ++i) {
    state = state * 1103515245U + 12345U;
    d.push_back((state >> 16U) % 2001U / 1000.0 - 1.0 + 0.1);
  }
  return d;
}

}  // namespace

TEST_CASE("McNemar's exact p is the two-sided binomial probability", "[sweep][unit]") {
  // scipy.stats.binomtest(b, b + c, 0.5).pvalue, scipy 1.10.1
  CHECK(mcnemar_p(3, 10) == Approx(0.09228515625).epsilon(1e-12));
  CHECK(mcnemar_p(10, 3) == mcnemar_p(3, 10));
  CHECK(mcnemar_p(0, 5) == Approx(0.0625).epsilon(1e-12));
  CHECK(mcnemar_p(121, 59) == Approx(4.4344492637551645e-06).epsilon(1e-9));
  CHECK(mcnemar_p(7, 7) == 1.0);
  CHECK(mcnemar_p(0, 0) == 1.0);
  CHECK(mcnemar_p(1, 40000) == 0.0);
}

TEST_CASE("Tango's interval ends where the score test of the difference rejects", "[sweep][unit]") {
  constexpr double z = 1.959963984540054;
  const std::vector<std::array<std::size_t, 3>> cases{
      {21, 1, 7}, {44, 1, 3}, {50, 7, 12}, {100, 40, 20}, {1000, 13, 2}};
  for (const auto& [n, a, b] : cases) {
    CAPTURE(n, a, b);
    const Interval interval = tango_interval(n, a, b);
    const auto at = [&, n = static_cast<double>(n), a = static_cast<double>(a),
                     b = static_cast<double>(b)](double d) { return score(n, a, b, d); };
    CHECK(at(interval.low) == Approx(z).epsilon(1e-6));
    CHECK(at(interval.high) == Approx(z).epsilon(1e-6));
    CHECK(interval.low <
          (static_cast<double>(a) - static_cast<double>(b)) / static_cast<double>(n));
    const Interval swapped = tango_interval(n, b, a);
    CHECK(swapped.low == Approx(-interval.high).margin(1e-12));
    CHECK(swapped.high == Approx(-interval.low).margin(1e-12));
  }
  // without discordant pairs: 0 ± z²/(n + z²)
  const Interval none = tango_interval(30, 0, 0);
  CHECK(none.high == Approx(z * z / (30.0 + z * z)).epsilon(1e-9));
  CHECK(none.low == Approx(-none.high).epsilon(1e-9));
  CHECK(tango_interval(10, 10, 0).high == 1.0);
  CHECK(tango_interval(0, 0, 0).low == -1.0);
}

TEST_CASE("the signed-rank test agrees with scipy and with listing all signs", "[sweep][unit]") {
  // scipy.stats.wilcoxon(d, mode='exact'), scipy 1.10.1
  const SignedRank darwin = signed_rank(plants);
  CHECK(darwin.sum_minus == 24.0);
  CHECK(darwin.sum_plus == 96.0);
  CHECK(darwin.p == Approx(0.041259765625).epsilon(1e-12));
  CHECK(darwin.rank_biserial == Approx(0.6));
  CHECK(darwin.exact);
  CHECK(signed_rank(std::vector{1.0, 2.0, 3.0, 4.0, 5.0}).p == Approx(0.0625).epsilon(1e-12));
  CHECK(signed_rank(std::vector{1.0, -2.0, 3.0, -4.0, 5.0, 6.0, 7.0, 8.0, 9.5}).p ==
        Approx(0.0546875).epsilon(1e-12));
  // ties and zeros
  for (const auto& d : {std::vector<double>{1, 1, -1, 2, 2, 3, -3, 0, 0, 5},
                        std::vector<double>{-1, -1, -1, -1, 2, 2, 0}, std::vector<double>{4}})
    CHECK(signed_rank(d).p == Approx(enumerated_p(d)).epsilon(1e-12));
  CHECK(signed_rank(std::vector<double>{1, 1, -1, 2, 2, 3, -3, 0, 0, 5}).used == 8);
  // scipy.stats.wilcoxon(d, mode='approx', correction=False) of these 300 numbers with ties
  const SignedRank many = signed_rank(many_differences(300));
  CHECK_FALSE(many.exact);
  CHECK(many.sum_minus == 19610.0);
  CHECK(many.p == Approx(0.04863931114151975).epsilon(1e-10));
  CHECK(signed_rank({}).p == 1.0);
  CHECK(signed_rank(std::vector{0.0, 0.0}).used == 0);
}

TEST_CASE("the exact and the normal p are close where the one replaces the other",
          "[sweep][unit]") {
  const auto d = many_differences(100), more = many_differences(101);
  const SignedRank exact = signed_rank(d), normal = signed_rank(more);
  REQUIRE(exact.exact);
  REQUIRE_FALSE(normal.exact);
  CHECK(normal.p == Approx(exact.p).margin(0.05));
}

TEST_CASE("Hodges' and Lehmann's estimate and interval are ranked Walsh averages",
          "[sweep][unit]") {
  const auto averages = walsh_averages(plants);
  const auto darwin = hodges_lehmann(plants);
  REQUIRE((darwin && darwin->interval));
  CHECK(darwin->estimate == averages[(averages.size() + 1) / 2 - 1]);
  // P(T ≤ 25) ≤ 2.5 % < P(T ≤ 26) for n = 15: the critical value 25 of all tables of the test
  CHECK(darwin->interval->low == averages[25]);
  CHECK(darwin->interval->high == averages[averages.size() - 26]);
  for (const std::size_t n : {1U, 2U, 7U, 60U, 300U}) {
    const auto d = many_differences(n);
    const auto all = walsh_averages(d);
    CHECK(hodges_lehmann(d)->estimate == Approx(all[(all.size() + 1) / 2 - 1]).margin(1e-15));
  }
  CHECK_FALSE(hodges_lehmann({}));
  CHECK_FALSE(hodges_lehmann(std::vector{1.0, 2.0, 3.0, 4.0, 5.0})->interval);
  CHECK(hodges_lehmann(std::vector{1.0, 2.0, 3.0, 4.0, 5.0, 6.0})->interval->low == 1.0);
  const auto zeros = hodges_lehmann(std::vector(40, 0.0));
  CHECK(zeros->estimate == 0.0);
  CHECK(zeros->interval->high == 0.0);
}
