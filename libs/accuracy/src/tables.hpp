#pragma once
#include <string>
#include <vector>

#include "hamelin/accuracy/accuracy.hpp"
#include "hamelin/io/text_table.hpp"

namespace hamelin::accuracy {

/// A table, independent of the output format.
struct Table : TextTable {
  std::size_t comparisons_from = std::string::npos;  ///< rows from this one on compare with peers
};

/// The symbols for units and relations in an output format.
struct Symbols {
  const char *micro, *at_most, *plus_minus;
};
inline constexpr Symbols ascii{"us", "<=", "+-"}, typographic{"µs", "≤ ", "±"};

/// All rows of a measurement.
[[nodiscard]] Table rows_table(const Measurement& measurement, const Symbols& symbols);
/// The time that each scheme needs for an error, docs/theory.md (13.6), then the cheapest of
/// hamelin's own schemes over each peer, (13.7).
[[nodiscard]] Table cheapest_table(const Measurement& measurement, const Symbols& symbols);
/// A sentence on joints, duration and reference.
[[nodiscard]] std::string about(const Measurement& measurement);

/// Sentences on the errors for which a peer needs less time than the best of hamelin's own schemes.
/// Empty if no own scheme was measured or there is no reference.
[[nodiscard]] std::string cheaper_peers(const Measurement& measurement);

}  // namespace hamelin::accuracy
