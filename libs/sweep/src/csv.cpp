#include "hamelin/sweep/csv.hpp"

#include <fmt/format.h>

#include <map>
#include <optional>
#include <set>
#include <string>

#include "hamelin/io/csv.hpp"

namespace hamelin::sweep {

namespace {

std::string shown(const std::optional<double>& value) {
  return value ? fmt::format("{}", *value) : "";
}

/// The names of all columns that depend on the sweep.
struct ColumnNames {
  std::set<std::string> labels, varied, gains;
};

ColumnNames columns_of(const std::vector<MergedRun>& runs) {
  ColumnNames columns;
  for (const auto& r : runs) {
    for (const auto& [name, value] : r.run.labels) columns.labels.insert(name);
    for (const auto& [pointer, value] : varied_values(r.run)) columns.varied.insert(pointer);
    for (const auto& [name, value] : r.run.gains) columns.gains.insert(name);
  }
  return columns;
}

class Line {
 public:
  void add(std::string_view field) {
    if (!text_.empty()) text_ += ',';
    text_ += csv_field(field);
  }
  [[nodiscard]] std::string take() && { return std::move(text_) + "\n"; }

 private:
  std::string text_;
};

std::string names_line(const ColumnNames& columns) {
  Line line;
  for (const char* name : {"id", "directory"}) line.add(name);
  for (const auto* names : {&columns.labels, &columns.varied, &columns.gains})
    for (const auto& name : *names) line.add(name);
  for (const char* name :
       {"feasible", "reason", "outcome", "failure", "cause", "time_s", "clearance_m",
        "self_clearance_m", "certified_share", "tick_us_p50", "tick_us_p99", "judge"})
    line.add(name);
  return std::move(line).take();
}

std::string run_line(const MergedRun& r, const ColumnNames& columns) {
  const auto found = [](const auto& map, const std::string& key) {
    const auto at = map.find(key);
    return at == map.end() ? std::nullopt : std::optional(at->second);
  };
  Line line;
  line.add(r.run.id);
  line.add(r.directory.string());
  for (const auto& name : columns.labels) line.add(found(r.run.labels, name).value_or(""));
  const auto varied = varied_values(r.run);
  const std::map<std::string, std::string> by_pointer(varied.begin(), varied.end());
  for (const auto& pointer : columns.varied) line.add(found(by_pointer, pointer).value_or(""));
  for (const auto& name : columns.gains) line.add(shown(found(r.run.gains, name)));
  const RunFacts& facts = r.facts;
  line.add(r.feasible ? "true" : "false");
  for (const auto& field : {r.reason, facts.outcome, facts.failure, facts.cause}) line.add(field);
  for (const auto& value : {facts.time_s, facts.clearance_m, facts.self_clearance_m,
                            facts.certified_share, facts.tick_us_p50, facts.tick_us_p99})
    line.add(shown(value));
  line.add(facts.contact);
  return std::move(line).take();
}

}  // namespace

void write_csv(const Sweeps& sweeps, const std::function<void(std::string_view line)>& write) {
  const ColumnNames columns = columns_of(sweeps.runs);
  write(names_line(columns));
  for (const auto& r : sweeps.runs) write(run_line(r, columns));
}

}  // namespace hamelin::sweep
