#include "hamelin/sweep/page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <unordered_map>

#include "hamelin/core/error.hpp"
#include "shell.hpp"

namespace hamelin::sweep {

namespace {

/// Values as indices into a list of the different ones, in the order of their first run; -1 means
/// that there is no value.
class TextColumn {
 public:
  void add(const std::string& value) {
    if (value.empty()) return add_none();
    const auto [at, added] = known_.emplace(value, values_.size());
    if (added) values_.push_back(value);
    index_.push_back(at->second);
  }
  void add_none() { index_.push_back(-1); }
  [[nodiscard]] std::size_t size() const { return index_.size(); }
  [[nodiscard]] Json json() && {
    return {{"values", std::move(values_)}, {"index", std::move(index_)}};
  }

 private:
  std::unordered_map<std::string, std::size_t> known_;
  Json values_ = Json::array(), index_ = Json::array();
};

/// A number with six significant digits, which is more than the page shows.
Json rounded(const std::optional<double>& value) {
  if (!value || !std::isfinite(*value)) return nullptr;
  return std::stod(fmt::format("{:.6g}", *value));
}

/// Columns by name, of which a run need not have each.
template <class Column>
class NamedColumns {
 public:
  /// The column of that name, filled up to run `i`.
  Column& at(const std::string& name, std::size_t i) {
    Column& column = columns_[name];
    fill(column, i);
    return column;
  }
  template <class Finish>
  [[nodiscard]] Json json(std::size_t count, Finish finish) && {
    Json all = Json::object();
    for (auto& [name, column] : columns_) {
      fill(column, count);
      all[name] = finish(std::move(column));
    }
    return all;
  }

 private:
  static void fill(Json& column, std::size_t count) {
    if (column.is_null()) column = Json::array();
    while (column.size() < count) column.push_back(nullptr);
  }
  static void fill(TextColumn& column, std::size_t count) {
    while (column.size() < count) column.add_none();
  }
  std::map<std::string, Column> columns_;
};

/// The arguments after the scene, as they are typed.
std::string arguments_of(const std::vector<std::string>& words) {
  std::string text;
  for (std::size_t i = 1; i < words.size(); ++i)
    text += fmt::format("{}{}", text.empty() ? "" : " ", shell_word(words[i]));
  return text;
}

/// All runs in columns: 10⁵ runs stay below 20 MB, and the page reads them at once.
class Columns {
 public:
  void add(const MergedRun& merged) {
    const RunFacts& facts = merged.facts;
    ids_.push_back(merged.run.id);
    feasible_.push_back(merged.feasible ? 1 : 0);
    const auto words = run_arguments(merged.run, merged.directory);
    const std::map<std::string, std::string> texts{{"directory", merged.directory.string()},
                                                   {"scene", shell_word(words.front())},
                                                   {"arguments", arguments_of(words)},
                                                   {"outcome", facts.outcome},
                                                   {"failure", facts.failure},
                                                   {"cause", facts.cause},
                                                   {"contact", facts.contact},
                                                   {"reason", merged.reason}};
    for (const auto& [name, text] : texts) texts_.at(name, count_).add(text);
    for (const auto& [name, text] : merged.run.labels) labels_.at(name, count_).add(text);
    for (const auto& [pointer, text] : varied_values(merged.run))
      varied_.at(pointer, count_).add(text);
    for (const auto& [name, value] : merged.run.gains)
      gains_.at(name, count_).push_back(rounded(value));
    const std::map<std::string, std::optional<double>> figures{
        {"time_s", facts.time_s},
        {"clearance_m", facts.clearance_m},
        {"self_clearance_m", facts.self_clearance_m},
        {"certified_share", facts.certified_share},
        {"tick_us_p50", facts.tick_us_p50},
        {"tick_us_p99", facts.tick_us_p99}};
    for (const auto& [name, value] : figures) figures_.at(name, count_).push_back(rounded(value));
    ++count_;
  }

  [[nodiscard]] Json json() && {
    const auto text = [](TextColumn&& column) { return std::move(column).json(); };
    const auto number = [](Json&& column) { return std::move(column); };
    return {{"count", count_},
            {"id", std::move(ids_)},
            {"feasible", std::move(feasible_)},
            {"texts", std::move(texts_).json(count_, text)},
            {"labels", std::move(labels_).json(count_, text)},
            {"varied", std::move(varied_).json(count_, text)},
            {"gains", std::move(gains_).json(count_, number)},
            {"figures", std::move(figures_).json(count_, number)}};
  }

 private:
  std::size_t count_ = 0;
  Json ids_ = Json::array(), feasible_ = Json::array();
  NamedColumns<TextColumn> texts_, labels_, varied_;
  NamedColumns<Json> gains_, figures_;
};

}  // namespace

std::vector<std::pair<std::string, std::vector<Comparison>>> comparisons_of_page(
    const Sweeps& sweeps) {
  std::vector<std::pair<std::string, std::vector<Comparison>>> all;
  if (auto ablations = compare_ablations(sweeps); !ablations.empty())
    all.emplace_back("Ablations: with the part − without it", std::move(ablations));
  if (auto planners = compare_values(sweeps.runs); !planners.empty())
    all.emplace_back("Planners", std::move(planners));
  return all;
}

Json page_json(const Merged& merged, const PageExtras& extras) {
  std::set<std::string> directories;
  Columns columns;
  std::size_t recorded = 0;
  for (const auto& r : merged.sweeps.runs) {
    directories.insert(r.directory.string());
    recorded += r.facts.recorded ? 1U : 0U;
    columns.add(r);
  }
  Json replays = Json::object();
  for (const auto& [run, link] : extras.replays)
    replays[std::to_string(run)] = {{"file", link.file}, {"time_s", link.time_s}};
  Json comparisons = Json::array();
  for (const auto& [title, all] : extras.comparisons)
    comparisons.push_back({{"title", title}, {"items", to_json(all)["comparisons"]}});
  return {{"format", "hamelin.sweep-page/2"},
          {"generator", fmt::format("hamelin {}", version())},
          {"directories", directories},
          {"planned", merged.sweeps.runs.size()},
          {"recorded", recorded},
          {"summary", to_json(merged)},
          {"runs", std::move(columns).json()},
          {"replays", std::move(replays)},
          {"comparisons", std::move(comparisons)}};
}

}  // namespace hamelin::sweep
