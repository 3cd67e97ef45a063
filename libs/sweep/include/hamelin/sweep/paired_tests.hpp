#pragma once
#include <cstddef>
#include <optional>
#include <span>

#include "hamelin/sweep/merge.hpp"

/// Tests of paired runs: the same scene under two planners, two builds or two settings.
namespace hamelin::sweep {

/// McNemar's exact test: the two-sided probability of a split at least as uneven as `only_a` to
/// `only_b` if both were equally likely. 1 if there are no discordant pairs.
[[nodiscard]] double mcnemar_p(std::size_t only_a, std::size_t only_b);

/// Tango's score interval at 95 % for the difference of two paired shares, (only_a − only_b) /
/// pairs. [−1, 1] for 0 pairs.
[[nodiscard]] Interval tango_interval(std::size_t pairs, std::size_t only_a, std::size_t only_b);

/// Wilcoxon's signed-rank test of paired differences.
struct SignedRank {
  std::size_t used = 0;   ///< differences that are not 0
  double sum_plus = 0.0;  ///< of the ranks of positive differences
  double sum_minus = 0.0;
  double p = 1.0;     ///< two-sided
  bool exact = true;  ///< whether p is from the exact distribution; otherwise from the normal one
  /// (sum_plus − sum_minus) / (sum_plus + sum_minus), the matched-pairs rank-biserial correlation.
  double rank_biserial = 0.0;
};
[[nodiscard]] SignedRank signed_rank(std::span<const double> differences);

/// Hodges' and Lehmann's estimate of the median of paired differences.
struct MedianDifference {
  double estimate = 0.0;             ///< the lower median of all Walsh averages
  std::optional<Interval> interval;  ///< at 95 %; none for fewer than 6 differences
};
/// @return none for no differences
[[nodiscard]] std::optional<MedianDifference> hodges_lehmann(std::span<const double> differences);

}  // namespace hamelin::sweep
