#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <set>
#include <utility>

#include "accuracy_tables.hpp"
#include "hamelin/core/error.hpp"
#include "statistics.hpp"

namespace hamelin::study {

namespace {

using Places = std::vector<std::optional<std::size_t>>;  // of rows
using Times = std::vector<std::optional<double>>;

// What is recommended here, and what it is judged against.
constexpr std::array<const char*, 3> own_schemes{"hamel-variational", "composition", "gauss"};
constexpr std::array<const char*, 5> peers{"dop853, controlled", "dop853", "rk4", "semi-implicit-euler", "lie-exact"};

std::string shown(const std::optional<double>& value, const char* format) {
  return value ? fmt::format(fmt::runtime(format), *value) : std::string("-");
}

// 7 200 µs as "7200", 0.95 µs as "0.95": three figures at least, none behind the point where there are four before it.
std::string shown_us(const std::optional<double>& value) {
  if (!value) return "-";
  return fmt::format("{:.{}f}", *value, *value < 10.0 ? 2 : *value < 100.0 ? 1 : 0);
}

bool own(const AccuracyRow& row) {
  return std::find(own_schemes.begin(), own_schemes.end(), row.integrator) != own_schemes.end();
}

// The least time of these rows, an error at a time.
template <class Takes>
Times least_times(const Accuracy& accuracy, const Takes& takes) {
  Times best(accuracy_targets().size());
  for (const auto& row : accuracy.rows) {
    const auto bound = row.error_bound();
    if (!takes(row) || !bound || !row.cpu_us) continue;
    for (std::size_t i = 0; i < best.size(); ++i)
      if (*bound <= accuracy_targets()[i]) best[i] = std::min(best[i].value_or(*row.cpu_us), *row.cpu_us);
  }
  return best;
}

/// The best of ours beside a peer.
struct Comparison {
  std::string peer;
  Times ours, theirs;
};

std::vector<Comparison> comparisons(const Accuracy& accuracy) {
  std::vector<Comparison> all;
  const auto& rows = accuracy.rows;
  if (!accuracy.reference || std::none_of(rows.begin(), rows.end(), own)) return all;
  const Times ours = least_times(accuracy, own);
  for (const std::string peer : peers) {
    const auto takes = [&](const AccuracyRow& row) { return row.label() == peer; };
    if (std::any_of(rows.begin(), rows.end(), takes)) all.push_back({peer, ours, least_times(accuracy, takes)});
  }
  return all;
}

// What the peer's dearest row took: it does not reach errors that none of its rows reaches for less.
double dearest_of(const Accuracy& accuracy, const std::string& peer) {
  double most = 0.0;
  for (const auto& row : accuracy.rows)
    if (row.label() == peer) most = std::max(most, row.cpu_us.value_or(0.0));
  return most;
}

// The rows that the comparisons are made of: for each error the cheapest of ours and of each peer.
std::set<std::size_t> rows_behind(const Accuracy& accuracy) {
  std::set<std::size_t> rows;
  const auto all = comparisons(accuracy);
  const auto add = [&](const Times& times, const auto& takes) {
    for (std::size_t r = 0; r < accuracy.rows.size(); ++r)
      for (std::size_t i = 0; i < times.size(); ++i)
        if (times[i] && takes(accuracy.rows[r]) && accuracy.rows[r].cpu_us == times[i] &&
            *accuracy.rows[r].error_bound() <= accuracy_targets()[i])
          rows.insert(r);
  };
  for (const auto& comparison : all) {
    add(comparison.ours, own);
    add(comparison.theirs, [&](const AccuracyRow& row) { return row.label() == comparison.peer; });
  }
  return rows;
}

std::string markdown(const AccuracyTable& table) {
  const auto line = [](const std::vector<std::string>& cells) {
    return fmt::format("| {} |\n", fmt::join(cells, " | "));
  };
  std::vector<std::string> rule;
  for (std::size_t i = 0; i < table.head.size(); ++i) rule.emplace_back(i < table.words ? "---" : "--:");
  std::string text = line(table.head) + line(rule);
  for (const auto& row : table.rows) text += line(row);
  return text;
}

std::string plain(const AccuracyTable& table) {
  std::vector<std::size_t> widths;
  for (const auto& cell : table.head) widths.push_back(cell.size());
  for (const auto& row : table.rows)
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  std::string text;
  const auto add = [&](const std::vector<std::string>& row) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i)
      line += i < table.words ? fmt::format("{:<{}}  ", row[i], widths[i]) : fmt::format("{:>{}}  ", row[i], widths[i]);
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  };
  add(table.head);
  for (const auto& row : table.rows) add(row);
  return text;
}

}  // namespace

std::string AccuracyRow::label() const {
  return integrator + (order_asked ? fmt::format(":{}", order) : "") + (rtol ? ", controlled" : "");
}

std::string AccuracyRow::settings() const {
  std::string text = label();
  if (tolerance) text += fmt::format(", tolerance {:.0e}", *tolerance);
  return mode == "structure" ? text + ", structure" : text;
}

std::optional<double> AccuracyRow::error_bound() const {
  if (!error_q || !reference_error) return std::nullopt;
  return *error_q + *reference_error;
}

const std::vector<double>& accuracy_targets() {
  static const std::vector<double> targets{1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10};
  return targets;
}

std::vector<Cheapest> cheapest(const Accuracy& accuracy) {
  std::vector<Cheapest> all;
  for (std::size_t r = 0; r < accuracy.rows.size(); ++r) {
    const auto& row = accuracy.rows[r];
    const std::string settings = row.settings();
    auto at = std::find_if(all.begin(), all.end(), [&](const Cheapest& c) { return c.settings == settings; });
    if (at == all.end()) at = all.insert(all.end(), Cheapest{settings, Places(accuracy_targets().size())});
    const auto bound = row.error_bound();
    if (!bound || !row.cpu_us) continue;
    for (std::size_t i = 0; i < at->rows.size(); ++i) {
      if (*bound > accuracy_targets()[i]) continue;
      auto& best = at->rows[i];
      if (!best || *row.cpu_us < *accuracy.rows[*best].cpu_us) best = r;
    }
  }
  return all;
}

AccuracyTable rows_table(const Accuracy& accuracy, const Signs& signs) {
  AccuracyTable table;
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
                fmt::format("95 % {}", signs.plus_minus),
                fmt::format("CPU {}", signs.micro),
                "steps",
                "evaluations",
                "factor.",
                "rejected",
                "halvings"};
  table.words = 2;
  for (const auto& row : accuracy.rows) {
    std::vector<std::string> cells{row.label(),
                                   row.mode,
                                   fmt::format("{}", row.order),
                                   shown(row.step_s, "{:.6g}"),
                                   shown(row.rtol, "{:.0e}"),
                                   shown(row.tolerance, "{:.0e}")};
    if (row.completed) {
      cells.push_back(row.reference_limited ? signs.at_most + shown(row.error_bound(), "{:.1e}")
                                            : shown(row.error_q, "{:.1e}"));
      cells.push_back(shown(row.error_v, "{:.1e}"));
      cells.push_back(shown(row.energy_error_max_J, "{:.1e}"));
      cells.push_back(shown(row.drift_J_per_s, "{:.1e}"));
      cells.push_back(shown(row.drift_ci_J_per_s, "{:.0e}"));
      cells.push_back(shown_us(row.cpu_us));
    } else {
      cells.emplace_back("diverged");
      cells.resize(12, "-");
    }
    for (const long count : {row.steps, row.evaluations, row.factorizations, row.rejected, row.halvings})
      cells.push_back(fmt::format("{}", count));
    table.rows.push_back(std::move(cells));
  }
  return table;
}

AccuracyTable cheapest_table(const Accuracy& accuracy, const Signs& signs) {
  AccuracyTable table;
  table.head = {fmt::format("CPU {} for an error {}", signs.micro, signs.at_most)};
  for (const double target : accuracy_targets()) table.head.push_back(fmt::format("{:.0e}", target));
  for (const auto& entry : cheapest(accuracy)) {
    std::vector<std::string> cells{entry.settings};
    for (const auto& row : entry.rows) cells.push_back(shown_us(row ? accuracy.rows[*row].cpu_us : std::nullopt));
    table.rows.push_back(std::move(cells));
  }
  for (const auto& [peer, ours, theirs] : comparisons(accuracy)) {
    std::vector<std::string> cells{fmt::format("best of ours over {}", peer)};
    const double dearest = dearest_of(accuracy, peer);
    for (std::size_t i = 0; i < ours.size(); ++i)
      cells.push_back(!ours[i]             ? "-"
                      : theirs[i]          ? fmt::format("{:.2f}", *ours[i] / *theirs[i])
                      : dearest > *ours[i] ? fmt::format("<{:.2g}", *ours[i] / dearest)
                                           : "-");
    table.rows.push_back(std::move(cells));
  }
  return table;
}

std::string about(const Accuracy& accuracy) {
  std::string text = fmt::format("{} joint{}{}, {} s of free motion.", accuracy.dof, accuracy.dof == 1 ? "" : "s",
                                 accuracy.planar ? " in the plane" : "", accuracy.duration_s);
  if (accuracy.reference)
    text +=
        fmt::format(" Reference: {}, which differs from {} by {:.1e} in q and {:.1e} in v.", accuracy.reference->scheme,
                    accuracy.reference->check, accuracy.reference->error_q, accuracy.reference->error_v);
  else
    text += " No reference: errors in q and v are not known.";
  if (!accuracy.rows.empty()) text += fmt::format(" Instruction set: {}.", accuracy.rows.front().isa);
  return text;
}

std::string where_peers_win(const Accuracy& accuracy) {
  const auto all = comparisons(accuracy);
  if (all.empty()) return "";
  std::string text;
  for (const auto& [peer, ours, theirs] : all) {
    std::vector<std::size_t> at;
    for (std::size_t i = 0; i < ours.size(); ++i)
      if (theirs[i] && (!ours[i] || *theirs[i] < *ours[i])) at.push_back(i);
    if (at.empty()) continue;
    std::vector<std::string> errors;
    for (const std::size_t i : at) errors.push_back(fmt::format("{:.0e}", accuracy_targets()[i]));
    const bool range = at.size() > 2 && at.back() - at.front() + 1 == at.size();
    text += fmt::format("{}{}: cheaper than ours for {}.", text.empty() ? "" : " ", peer,
                        range ? fmt::format("errors from {} to {}", errors.front(), errors.back())
                              : fmt::format("an error of {}", fmt::join(errors, ", ")));
  }
  return text.empty() ? "No peer is cheaper than ours for any of these errors." : text;
}

std::string to_table(const Accuracy& accuracy) {
  std::string text = fmt::format("{}: {}\n\n{}", accuracy.name, about(accuracy), plain(rows_table(accuracy, ascii)));
  if (accuracy.reference) text += fmt::format("\n{}", plain(cheapest_table(accuracy, ascii)));
  if (const auto peers_win = where_peers_win(accuracy); !peers_win.empty()) text += fmt::format("\n{}\n", peers_win);
  for (const auto& row : accuracy.rows)
    if (row.cause) text += fmt::format("\n{}: diverged: {}", row.label(), *row.cause);
  return text + (text.ends_with('\n') ? "" : "\n");
}

std::string to_markdown(const Accuracy& accuracy) {
  std::string text = fmt::format("{}: {}\n", accuracy.name, about(accuracy));
  if (!accuracy.reference) return text + fmt::format("\n{}", markdown(rows_table(accuracy, typographic)));
  text += fmt::format("\n{}", markdown(cheapest_table(accuracy, typographic)));
  if (const auto peers_win = where_peers_win(accuracy); !peers_win.empty()) text += fmt::format("\n{}\n", peers_win);
  const auto behind = rows_behind(accuracy);
  Accuracy best = accuracy;
  best.rows.clear();
  for (const std::size_t i : behind) best.rows.push_back(accuracy.rows[i]);
  return text + fmt::format(
                    "\n<details><summary>The cheapest of ours and of each peer for each error, {} of {} rows "
                    "measured</summary>\n\n{}\n</details>\n",
                    best.rows.size(), accuracy.rows.size(), markdown(rows_table(best, typographic)));
}

Json to_json(const Accuracy& accuracy) {
  Json rows = Json::array();
  for (const auto& row : accuracy.rows)
    rows.push_back({{"integrator", row.integrator},
                    {"order", row.order},
                    {"order_asked", row.order_asked},
                    {"step_s", or_null(row.step_s)},
                    {"rtol", or_null(row.rtol)},
                    {"atol", or_null(row.atol)},
                    {"tolerance", or_null(row.tolerance)},
                    {"outcome", row.completed ? "completed" : "diverged"},
                    {"cause", row.cause ? Json(*row.cause) : Json(nullptr)},
                    {"error_q", or_null(row.error_q)},
                    {"error_v", or_null(row.error_v)},
                    {"reference_error", or_null(row.reference_error)},
                    {"reference_error_v", or_null(row.reference_error_v)},
                    {"reference_limited", row.reference_limited},
                    {"energy_error_max_J", or_null(row.energy_error_max_J)},
                    {"drift_J_per_s", or_null(row.drift_J_per_s)},
                    {"drift_ci_J_per_s", or_null(row.drift_ci_J_per_s)},
                    {"energy_samples", row.energy_samples},
                    {"cpu_us", or_null(row.cpu_us)},
                    {"evaluations", row.evaluations},
                    {"factorizations", row.factorizations},
                    {"steps", row.steps},
                    {"rejected", row.rejected},
                    {"halvings", row.halvings},
                    {"isa", row.isa},
                    {"mode", row.mode}});
  Json reference;
  if (const auto& r = accuracy.reference)
    reference = {{"scheme", r->scheme},
                 {"check", r->check},
                 {"error_q", r->error_q},
                 {"error_v", r->error_v},
                 {"evaluations", r->evaluations},
                 {"q", std::vector<double>(r->q.begin(), r->q.end())},
                 {"v", std::vector<double>(r->v.begin(), r->v.end())}};
  return {{"schema", "hamelin.accuracy/1"},
          {"version", version()},
          {"name", accuracy.name},
          {"dof", accuracy.dof},
          {"planar", accuracy.planar},
          {"duration_s", accuracy.duration_s},
          {"reference", std::move(reference)},
          {"rows", std::move(rows)},
          {"notes", accuracy.notes}};
}

Accuracy accuracy_from_json(const Json& document, const std::string& where) {
  check_shipped_schema(document, "accuracy", where);
  const auto number = [](const Json& value) {
    return value.is_null() ? std::nullopt : std::optional(value.get<double>());
  };
  const auto vector = [](const Json& value) {
    const auto numbers = value.get<std::vector<double>>();
    return Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(numbers.data(), static_cast<long>(numbers.size())));
  };
  Accuracy accuracy;
  accuracy.name = document["name"];
  accuracy.dof = document["dof"];
  accuracy.planar = document["planar"];
  accuracy.duration_s = document["duration_s"];
  accuracy.notes = document["notes"].get<std::vector<std::string>>();
  if (const Json& r = document["reference"]; !r.is_null())
    accuracy.reference = AccuracyReference{vector(r["q"]), vector(r["v"]), r["error_q"],    r["error_v"],
                                           r["scheme"],    r["check"],     r["evaluations"]};
  for (const Json& from : document["rows"]) {
    AccuracyRow row;
    row.integrator = from["integrator"];
    row.order = from["order"];
    row.order_asked = from["order_asked"];
    row.completed = from["outcome"] == "completed";
    if (!from["cause"].is_null()) row.cause = from["cause"];
    row.reference_limited = from["reference_limited"];
    row.isa = from["isa"];
    row.mode = from["mode"];
    for (const auto& [key, value] : std::initializer_list<std::pair<const char*, std::optional<double>*>>{
             {"step_s", &row.step_s},
             {"rtol", &row.rtol},
             {"atol", &row.atol},
             {"tolerance", &row.tolerance},
             {"error_q", &row.error_q},
             {"error_v", &row.error_v},
             {"reference_error", &row.reference_error},
             {"reference_error_v", &row.reference_error_v},
             {"energy_error_max_J", &row.energy_error_max_J},
             {"drift_J_per_s", &row.drift_J_per_s},
             {"drift_ci_J_per_s", &row.drift_ci_J_per_s},
             {"cpu_us", &row.cpu_us}})
      *value = number(from[key]);
    for (const auto& [key, value] :
         std::initializer_list<std::pair<const char*, long*>>{{"energy_samples", &row.energy_samples},
                                                              {"evaluations", &row.evaluations},
                                                              {"factorizations", &row.factorizations},
                                                              {"steps", &row.steps},
                                                              {"rejected", &row.rejected},
                                                              {"halvings", &row.halvings}})
      *value = from[key].get<long>();
    accuracy.rows.push_back(std::move(row));
  }
  return accuracy;
}

}  // namespace hamelin::study
