#pragma once
#include <string>
#include <vector>

#include "hamelin/accuracy/accuracy.hpp"

namespace hamelin::accuracy {

/// A table as text, whatever it is shown in. The first `words` columns are words, the others figures.
struct Table {
  std::vector<std::string> head;
  std::vector<std::vector<std::string>> rows;
  std::size_t words = 1;
  std::size_t comparisons_from = std::string::npos;  ///< rows from here on compare with peers
};

/// How units and relations are written.
struct Signs {
  const char *micro, *at_most, *plus_minus;
};
inline constexpr Signs ascii{"us", "<=", "+-"}, typographic{"µs", "≤ ", "±"};

/// All rows of a measurement.
[[nodiscard]] Table rows_table(const Measurement& measurement, const Signs& signs);
/// What each scheme needs for an error, then the cheapest of hamelin's own schemes over each peer.
[[nodiscard]] Table cheapest_table(const Measurement& measurement, const Signs& signs);
/// Joints, duration, and what the reference is.
[[nodiscard]] std::string about(const Measurement& measurement);

/// Sentences on the errors for which a peer needs less time than the best of ours; empty where none of ours, or no
/// reference, is there.
[[nodiscard]] std::string cheaper_peers(const Measurement& measurement);

}  // namespace hamelin::accuracy
