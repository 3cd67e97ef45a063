#include "hamelin/sweep/paired_tests.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

namespace hamelin::sweep {

namespace {

constexpr double z95 = 1.959963984540054;
// Up to this number of differences the distribution of the rank sum is summed up exactly.
constexpr std::size_t exact_max = 100;

/// Ranks of the magnitudes, doubled so that the mean ranks of ties are integers. docs/theory.md
/// (13.46).
std::vector<std::size_t> doubled_ranks(const std::vector<double>& differences) {
  std::vector<std::size_t> order(differences.size()), ranks(differences.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto size = [&](std::size_t i) { return std::abs(differences[i]); };
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return size(a) < size(b); });
  for (std::size_t from = 0, to = 0; from < order.size(); from = to) {
    while (to < order.size() && size(order[to]) == size(order[from])) ++to;
    for (std::size_t i = from; i < to; ++i) ranks[order[i]] = from + to + 1;
  }
  return ranks;
}

/// Probabilities of the sums of a random half of the ranks: entry s is that of the sum s.
std::vector<double> sum_distribution(const std::vector<std::size_t>& ranks) {
  std::vector<double> probability(std::accumulate(ranks.begin(), ranks.end(), std::size_t{1}));
  probability[0] = 1.0;
  std::size_t largest = 0;
  for (const std::size_t rank : ranks) {
    largest += rank;
    for (std::size_t s = largest + 1; s-- > 0;)
      probability[s] = 0.5 * (probability[s] + (s >= rank ? probability[s - rank] : 0.0));
  }
  return probability;
}

// docs/theory.md (13.47)
double exact_p(const std::vector<std::size_t>& ranks, std::size_t doubled_plus) {
  const auto probability = sum_distribution(ranks);
  const std::size_t all = probability.size() - 1, less = std::min(doubled_plus, all - doubled_plus);
  const double tail = std::accumulate(
      probability.begin(), probability.begin() + static_cast<std::ptrdiff_t>(less) + 1, 0.0);
  return std::min(1.0, 2.0 * tail);
}

// docs/theory.md (13.48): the variance Σ R²/4 with mean ranks is that with the correction for ties.
double normal_p(const std::vector<std::size_t>& ranks, double sum_plus, double sum_minus) {
  double variance = 0.0;
  for (const std::size_t doubled : ranks) {
    const double rank = 0.5 * static_cast<double>(doubled);
    variance += 0.25 * rank * rank;
  }
  const double z = 0.5 * std::abs(sum_plus - sum_minus) / std::sqrt(variance);
  return std::erfc(z / std::sqrt(2.0));
}

/// The Walsh averages (dᵢ + dⱼ)/2, i ≤ j, of sorted differences, which are never listed.
class WalshAverages {
 public:
  explicit WalshAverages(std::vector<double> sorted) : d_(std::move(sorted)) {}

  [[nodiscard]] std::size_t count() const { return d_.size() * (d_.size() + 1) / 2; }

  /// The average of rank k, 1 … count(): bisection by the number of averages below, and then the
  /// smallest average above the lower end.
  [[nodiscard]] double ranked(std::size_t k) const {
    double low = std::nextafter(d_.front(), -infinity), high = d_.back();
    constexpr int steps = 80;
    for (int i = 0; i < steps; ++i) {
      const double middle = low + 0.5 * (high - low);
      (count_up_to(middle) >= k ? high : low) = middle;
    }
    return smallest_above(low);
  }

 private:
  static constexpr double infinity = std::numeric_limits<double>::infinity();

  // Calls visit(i, n) with the number n of all j with (dᵢ + dⱼ)/2 ≤ x, in linear time.
  template <class Visit>
  void for_each_count(double x, Visit visit) const {
    std::size_t n = d_.size();
    for (std::size_t i = 0; i < d_.size(); ++i) {
      while (n > 0 && 0.5 * (d_[i] + d_[n - 1]) > x) --n;
      visit(i, n);
    }
  }
  [[nodiscard]] std::size_t count_up_to(double x) const {
    std::size_t all = 0;
    for_each_count(x, [&](std::size_t i, std::size_t n) { all += n > i ? n - i : 0; });
    return all;
  }
  [[nodiscard]] double smallest_above(double x) const {
    double smallest = infinity;
    for_each_count(x, [&](std::size_t i, std::size_t n) {
      const std::size_t j = std::max(i, n);
      if (j < d_.size()) smallest = std::min(smallest, 0.5 * (d_[i] + d_[j]));
    });
    return smallest;
  }

  std::vector<double> d_;
};

/// The largest rank sum c with P(T ≤ c) ≤ 2.5 %, plus 1; 0 if there is none. docs/theory.md
/// (13.50).
std::size_t rank_of_lower_end(std::size_t n) {
  if (n > exact_max) {
    const double all = static_cast<double>(n);
    return static_cast<std::size_t>(0.25 * all * (all + 1.0) + 0.5 -
                                    z95 * std::sqrt(all * (all + 1.0) * (2.0 * all + 1.0) / 24.0));
  }
  std::vector<std::size_t> ranks(n);
  std::iota(ranks.begin(), ranks.end(), std::size_t{1});
  double tail = 0.0;
  std::size_t sums = 0;
  for (const double probability : sum_distribution(ranks)) {
    tail += probability;
    if (tail > 0.025) break;
    ++sums;
  }
  return sums;
}

}  // namespace

// docs/theory.md (13.43)
double mcnemar_p(std::size_t only_a, std::size_t only_b) {
  const std::size_t n = only_a + only_b, less = std::min(only_a, only_b);
  const auto log_factorial = [](std::size_t k) {
    return std::lgamma(static_cast<double>(k) + 1.0);
  };
  const double log_all = log_factorial(n) - static_cast<double>(n) * std::log(2.0);
  double tail = 0.0;
  for (std::size_t k = 0; k <= less; ++k)
    tail += std::exp(log_all - log_factorial(k) - log_factorial(n - k));
  return std::min(1.0, 2.0 * tail);
}

// docs/theory.md (13.44), (13.45)
Interval tango_interval(std::size_t pairs, std::size_t only_a, std::size_t only_b) {
  if (pairs == 0) return {-1.0, 1.0};
  const double n = static_cast<double>(pairs), a = static_cast<double>(only_a),
               b = static_cast<double>(only_b);
  const auto accepted = [&](double difference) {
    const double linear = (2.0 * n - a + b) * difference - a - b,
                 constant = -b * difference * (1.0 - difference),
                 root = std::sqrt(std::max(0.0, linear * linear - 8.0 * n * constant)),
                 share = (root - linear) / (4.0 * n),
                 variance = n * (2.0 * share + difference * (1.0 - difference));
    return std::abs(a - b - n * difference) <= z95 * std::sqrt(std::max(0.0, variance));
  };
  const auto end = [&](double outside) {
    if (accepted(outside)) return outside;
    double inside = (a - b) / n;
    constexpr int steps = 60;
    for (int i = 0; i < steps; ++i) {
      const double middle = 0.5 * (inside + outside);
      (accepted(middle) ? inside : outside) = middle;
    }
    return inside;
  };
  return {end(-1.0), end(1.0)};
}

SignedRank signed_rank(std::span<const double> differences) {
  std::vector<double> used;
  for (const double d : differences)
    if (d != 0.0) used.push_back(d);
  SignedRank out;
  out.used = used.size();
  if (used.empty()) return out;
  const auto ranks = doubled_ranks(used);
  std::size_t doubled_plus = 0, doubled_all = 0;
  for (std::size_t i = 0; i < used.size(); ++i) {
    doubled_all += ranks[i];
    if (used[i] > 0.0) doubled_plus += ranks[i];
  }
  out.sum_plus = 0.5 * static_cast<double>(doubled_plus);
  out.sum_minus = 0.5 * static_cast<double>(doubled_all - doubled_plus);
  out.exact = used.size() <= exact_max;
  out.p = out.exact ? exact_p(ranks, doubled_plus) : normal_p(ranks, out.sum_plus, out.sum_minus);
  out.rank_biserial = (out.sum_plus - out.sum_minus) / (out.sum_plus + out.sum_minus);
  return out;
}

// docs/theory.md (13.49), (13.50)
std::optional<MedianDifference> hodges_lehmann(std::span<const double> differences) {
  if (differences.empty()) return std::nullopt;
  std::vector<double> sorted(differences.begin(), differences.end());
  std::sort(sorted.begin(), sorted.end());
  const std::size_t n = sorted.size();
  const WalshAverages averages(std::move(sorted));
  MedianDifference out{averages.ranked((averages.count() + 1) / 2), std::nullopt};
  if (const std::size_t low = rank_of_lower_end(n); low > 0)
    out.interval = Interval{averages.ranked(low), averages.ranked(averages.count() + 1 - low)};
  return out;
}

}  // namespace hamelin::sweep
