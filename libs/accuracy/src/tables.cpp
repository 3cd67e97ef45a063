#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

#include "tables.hpp"

namespace hamelin::accuracy {

namespace {

using RowIndices = std::vector<std::optional<std::size_t>>;
using Times = std::vector<std::optional<double>>;

// The schemes that hamelin recommends, and those that they are compared with.
constexpr std::array<const char*, 3> own_schemes{"hamel-variational", "composition", "gauss"};
constexpr std::array<const char*, 5> peers{"dop853, controlled", "dop853", "rk4",
                                           "semi-implicit-euler", "lie-exact"};

std::string formatted(const std::optional<double>& value, const char* format) {
  return value ? fmt::format(fmt::runtime(format), *value) : std::string("-");
}

// Two decimals below 10 µs, one below 100 µs, else none.
std::string formatted_us(const std::optional<double>& value) {
  if (!value) return "-";
  return fmt::format("{:.{}f}", *value, *value < 10.0 ? 2 : *value < 100.0 ? 1 : 0);
}

bool own(const Row& row) {
  return std::find(own_schemes.begin(), own_schemes.end(), row.integrator) != own_schemes.end();
}

// The least time of the selected rows for each error, docs/theory.md (13.6).
template <class Takes>
Times least_times(const Measurement& measurement, const Takes& takes) {
  Times best(error_targets().size());
  for (const auto& row : measurement.rows) {
    const auto bound = row.error_bound();
    if (!takes(row) || !bound || !row.cpu_us) continue;
    for (std::size_t i = 0; i < best.size(); ++i)
      if (*bound <= error_targets()[i])
        best[i] = std::min(best[i].value_or(*row.cpu_us), *row.cpu_us);
  }
  return best;
}

/// The best times of hamelin's own schemes and of a peer, docs/theory.md (13.7).
struct Comparison {
  std::string peer;
  Times ours, theirs;
};

std::vector<Comparison> comparisons(const Measurement& measurement) {
  std::vector<Comparison> all;
  const auto& rows = measurement.rows;
  if (!measurement.reference || std::none_of(rows.begin(), rows.end(), own)) return all;
  const Times ours = least_times(measurement, own);
  for (const std::string peer : peers) {
    const auto takes = [&](const Row& row) { return row.label() == peer; };
    if (std::any_of(rows.begin(), rows.end(), takes))
      all.push_back({peer, ours, least_times(measurement, takes)});
  }
  return all;
}

// The longest time of a peer's rows. An error that none of its rows reaches is assumed to take
// longer.
double longest_time_of(const Measurement& measurement, const std::string& peer) {
  double most = 0.0;
  for (const auto& row : measurement.rows)
    if (row.label() == peer) most = std::max(most, row.cpu_us.value_or(0.0));
  return most;
}

// The rows that enter comparisons: for each error the cheapest own row and the cheapest of each
// peer.
std::set<std::size_t> compared_rows(const Measurement& measurement) {
  std::set<std::size_t> rows;
  const auto all = comparisons(measurement);
  const auto add = [&](const Times& times, const auto& takes) {
    for (std::size_t r = 0; r < measurement.rows.size(); ++r)
      for (std::size_t i = 0; i < times.size(); ++i)
        if (times[i] && takes(measurement.rows[r]) && measurement.rows[r].cpu_us == times[i] &&
            *measurement.rows[r].error_bound() <= error_targets()[i])
          rows.insert(r);
  };
  for (const auto& comparison : all) {
    add(comparison.ours, own);
    add(comparison.theirs, [&](const Row& row) { return row.label() == comparison.peer; });
  }
  return rows;
}

}  // namespace

std::string Row::label() const {
  return integrator + (order_asked ? fmt::format(":{}", order) : "") + (rtol ? ", controlled" : "");
}

std::string Row::settings() const {
  std::string text = label();
  if (tolerance) text += fmt::format(", tolerance {:.0e}", *tolerance);
  return mode == "structure" ? text + ", structure" : text;
}

std::optional<double> Row::error_bound() const {
  if (!error_q || !reference_error) return std::nullopt;
  return *error_q + *reference_error;
}

const std::vector<double>& error_targets() {
  static const std::vector<double> targets{1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10};
  return targets;
}

std::vector<Cheapest> cheapest(const Measurement& measurement) {
  std::vector<Cheapest> all;
  for (std::size_t r = 0; r < measurement.rows.size(); ++r) {
    const auto& row = measurement.rows[r];
    const std::string settings = row.settings();
    auto at = std::find_if(all.begin(), all.end(),
                           [&](const Cheapest& c) { return c.settings == settings; });
    if (at == all.end())
      at = all.insert(all.end(), Cheapest{settings, RowIndices(error_targets().size())});
    const auto bound = row.error_bound();
    if (!bound || !row.cpu_us) continue;
    for (std::size_t i = 0; i < at->rows.size(); ++i) {
      if (*bound > error_targets()[i]) continue;
      auto& best = at->rows[i];
      if (!best || *row.cpu_us < *measurement.rows[*best].cpu_us) best = r;
    }
  }
  return all;
}

Table rows_table(const Measurement& measurement, const Symbols& symbols) {
  Table table;
  table.head = {"integrator",
                "mode",
                "order",
                "step s",
                "rtol",
                "tolerance",
                "error q",
                "error v",
                "energy J",
                "drift J/s",
                fmt::format("95 % {}", symbols.plus_minus),
                fmt::format("CPU {}", symbols.micro),
                "steps",
                "evaluations",
                "factor.",
                "rejected",
                "halvings"};
  table.text_columns = 2;
  for (const auto& row : measurement.rows) {
    std::vector<std::string> cells{row.label(),
                                   row.mode,
                                   fmt::format("{}", row.order),
                                   formatted(row.step_s, "{:.6g}"),
                                   formatted(row.rtol, "{:.0e}"),
                                   formatted(row.tolerance, "{:.0e}")};
    if (row.completed) {
      cells.push_back(row.reference_limited
                          ? symbols.at_most + formatted(row.error_bound(), "{:.1e}")
                          : formatted(row.error_q, "{:.1e}"));
      cells.push_back(formatted(row.error_v, "{:.1e}"));
      cells.push_back(formatted(row.energy_error_max_J, "{:.1e}"));
      cells.push_back(formatted(row.drift_J_per_s, "{:.1e}"));
      cells.push_back(formatted(row.drift_ci_J_per_s, "{:.0e}"));
      cells.push_back(formatted_us(row.cpu_us));
    } else {
      cells.emplace_back("diverged");
      cells.resize(12, "-");
    }
    for (const long count :
         {row.steps, row.evaluations, row.factorizations, row.rejected, row.halvings})
      cells.push_back(fmt::format("{}", count));
    table.rows.push_back(std::move(cells));
  }
  return table;
}

Table cheapest_table(const Measurement& measurement, const Symbols& symbols) {
  Table table;
  table.head = {fmt::format("CPU {} for an error {}", symbols.micro, symbols.at_most)};
  for (const double target : error_targets()) table.head.push_back(fmt::format("{:.0e}", target));
  for (const auto& entry : cheapest(measurement)) {
    std::vector<std::string> cells{entry.settings};
    for (const auto& row : entry.rows)
      cells.push_back(formatted_us(row ? measurement.rows[*row].cpu_us : std::nullopt));
    table.rows.push_back(std::move(cells));
  }
  table.comparisons_from = table.rows.size();
  for (const auto& [peer, ours, theirs] : comparisons(measurement)) {
    std::vector<std::string> cells{fmt::format("best of hamelin over {}", peer)};
    const double longest = longest_time_of(measurement, peer);
    for (std::size_t i = 0; i < ours.size(); ++i)
      cells.push_back(!ours[i]             ? "-"
                      : theirs[i]          ? fmt::format("{:.2f}", *ours[i] / *theirs[i])
                      : longest > *ours[i] ? fmt::format("<{:.2g}", *ours[i] / longest)
                                           : "-");
    table.rows.push_back(std::move(cells));
  }
  return table;
}

namespace {

// "v4; x86-64 for hamel, lie-exact": the set of most rows, and the schemes that ran on another.
std::string instruction_sets(const std::vector<Row>& rows) {
  std::map<std::string, std::set<std::string>> schemes;
  for (const auto& row : rows) schemes[row.isa].insert(row.integrator);
  const auto most = std::max_element(
      schemes.begin(), schemes.end(),
      [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); });
  std::string text = most->first;
  for (const auto& [isa, names] : schemes)
    if (isa != most->first) text += fmt::format("; {} for {}", isa, fmt::join(names, ", "));
  return text;
}

}  // namespace

std::string about(const Measurement& measurement) {
  std::string text = fmt::format("{} joint{}{}, {} s of free motion.", measurement.dof,
                                 measurement.dof == 1 ? "" : "s",
                                 measurement.planar ? " in the plane" : "", measurement.duration_s);
  if (measurement.reference)
    text += fmt::format("\nReference: {}. Difference from {}: {:.1e} in q, {:.1e} in v.",
                        measurement.reference->scheme, measurement.reference->check,
                        measurement.reference->error_q, measurement.reference->error_v);
  else
    text += "\nNo reference: errors in q and v are not known.";
  if (!measurement.rows.empty())
    text += fmt::format("\nInstruction set: {}.", instruction_sets(measurement.rows));
  return text;
}

std::string cheaper_peers(const Measurement& measurement) {
  const auto all = comparisons(measurement);
  if (all.empty()) return "";
  std::string text;
  for (const auto& [peer, ours, theirs] : all) {
    std::vector<std::size_t> at;
    for (std::size_t i = 0; i < ours.size(); ++i)
      if (theirs[i] && (!ours[i] || *theirs[i] < *ours[i])) at.push_back(i);
    if (at.empty()) continue;
    std::vector<std::string> errors;
    errors.reserve(at.size());
    for (const std::size_t i : at) errors.push_back(fmt::format("{:.0e}", error_targets()[i]));
    const bool range = at.size() > 2 && at.back() - at.front() + 1 == at.size();
    text += fmt::format("{}{} takes less time for {}.", text.empty() ? "" : " ", peer,
                        range ? fmt::format("errors from {} to {}", errors.front(), errors.back())
                              : fmt::format("an error of {}", fmt::join(errors, ", ")));
  }
  return text.empty() ? "No peer takes less time for any of these errors." : text;
}

std::string to_table(const Measurement& measurement) {
  std::string text = fmt::format("{}: {}\n\n{}", measurement.name, about(measurement),
                                 to_text(rows_table(measurement, ascii)));
  if (measurement.reference)
    text += fmt::format("\n{}", to_text(cheapest_table(measurement, ascii)));
  if (const auto sentence = cheaper_peers(measurement); !sentence.empty())
    text += fmt::format("\n{}\n", sentence);
  for (const auto& row : measurement.rows)
    if (row.cause) text += fmt::format("\n{}: diverged: {}", row.label(), *row.cause);
  return text + (text.ends_with('\n') ? "" : "\n");
}

std::string to_markdown(const Measurement& measurement) {
  std::string text = fmt::format("{}: {}\n", measurement.name, about(measurement));
  if (!measurement.reference)
    return text + fmt::format("\n{}", hamelin::to_markdown(rows_table(measurement, typographic)));
  text += fmt::format("\n{}", hamelin::to_markdown(cheapest_table(measurement, typographic)));
  if (const auto sentence = cheaper_peers(measurement); !sentence.empty())
    text += fmt::format("\n{}\n", sentence);
  const auto compared = compared_rows(measurement);
  Measurement best = measurement;
  best.rows.clear();
  for (const std::size_t i : compared) best.rows.push_back(measurement.rows[i]);
  return text + fmt::format(
                    "\n<details><summary>The cheapest rows of hamelin and of each peer, {} "
                    "of {} rows "
                    "measured</summary>\n\n{}\n</details>\n",
                    best.rows.size(), measurement.rows.size(),
                    hamelin::to_markdown(rows_table(best, typographic)));
}

}  // namespace hamelin::accuracy
