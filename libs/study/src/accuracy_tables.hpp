#pragma once
#include <string>
#include <vector>

#include "hamelin/study/accuracy.hpp"

namespace hamelin::study {

/// A table as text, whatever it is shown in. The first `words` columns are words, the others figures.
struct AccuracyTable {
  std::vector<std::string> head;
  std::vector<std::vector<std::string>> rows;
  std::size_t words = 1;
};

/// How units and relations are written.
struct Signs {
  const char *micro, *at_most, *plus_minus;
};
inline constexpr Signs ascii{"us", "<=", "+-"}, typographic{"µs", "≤ ", "±"};

/// All rows of a measurement.
[[nodiscard]] AccuracyTable rows_table(const Accuracy& accuracy, const Signs& signs);
/// What each scheme needs for an error, then the cheapest of hamelin's own schemes over each peer.
[[nodiscard]] AccuracyTable cheapest_table(const Accuracy& accuracy, const Signs& signs);
/// Joints, duration, and what the reference is.
[[nodiscard]] std::string about(const Accuracy& accuracy);

/// Sentences on the errors for which a peer needs less time than the best of ours; empty where none of ours, or no
/// reference, is there.
[[nodiscard]] std::string where_peers_win(const Accuracy& accuracy);

}  // namespace hamelin::study
